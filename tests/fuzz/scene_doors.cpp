#include <opencv2/imgcodecs.hpp>

#include "pipeline/base/files.hpp"
#include "raytrace/scene/model_file.hpp"
#include "raytrace/scene/picture.hpp"
#include "raytrace/scene/scene_json.hpp"
#include "tests/fuzz/door_groups.hpp"

namespace emmetrope::fuzz {
namespace {

namespace fs = std::filesystem;
using Folder = const fs::path&;
using Seeds = std::vector<std::string>;

constexpr auto scene = R"({"name": "card and wall", "background": [0.5, 0.5, 0.5], "objects": [
  {"type": "plane", "centre_mm": [0, 0, 400], "right_mm": [-30, 0, 0], "up_mm": [0, 20, 0],
   "chart": "letters:logmar=0.5"},
  {"type": "plane", "centre_mm": [0, 0, 6000], "right_mm": [-3000, 0, 0], "up_mm": [0, 3000, 0], "lit": true,
   "colour": [0.2, 0.3, 0.9], "chart": "dial"}],
  "lights": [{"type": "point", "position_mm": [250, 60, 350], "reference_mm": 350, "colour": [0.9, 0.85, 0.8]},
             {"type": "directional", "direction": [0, -1, 1]}], "ambient": [0.1, 0.1, 0.1]})";

constexpr auto obj = R"(mtllib paint.mtl
v 0 0 0
v 1 0 0
v 0 1 0
v 1 1 0.2
vt 0 0
vt 1 0
vt 0 1
vn 0 0 1
usemtl paint
f 1/1/1 2/2/1 3/3/1
f 2 4 3
)";

/// One triangle: three float32 corners in base64.
constexpr auto gltf = R"({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
  "nodes": [{"mesh": 0, "translation": [0, 0, 2]}],
  "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
  "materials": [{"pbrMetallicRoughness": {"baseColorFactor": [0.25, 0.5, 0.75, 1]}}],
  "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}],
  "bufferViews": [{"buffer": 0, "byteLength": 36}],
  "buffers": [{"byteLength": 36, "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]})";

std::string word(std::size_t value) {
  std::string bytes;
  for (int shift = 0; shift < 32; shift += 8) bytes += static_cast<char>(value >> shift & 0xff);
  return bytes;
}

/// The triangle as one binary file (glTF 2.0, 4.4).
std::string glb() {
  std::string json = gltf;
  const std::string uri =
      R"(, "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA")";
  json.erase(json.find(uri), uri.size());
  json.resize((json.size() + 3) / 4 * 4, ' ');
  const std::string one("\0\0\x80\x3f", 4), zeros(16, '\0');
  const std::string corners = zeros.substr(0, 12) + one + zeros.substr(0, 12) + one + zeros.substr(0, 4);
  return "glTF" + word(2) + word(12 + 8 + json.size() + 8 + corners.size()) + word(json.size()) + "JSON" +
         json + word(corners.size()) + std::string("BIN\0", 4) + corners;
}

Door model_door(const std::string& ending, std::string whole,
                std::function<std::string(const std::string&, Random&)> mutate) {
  return {"model." + ending, "model." + ending,
          [whole = std::move(whole)](Folder folder) {
            write_file(folder.parent_path() / "paint.mtl",
                       "newmtl paint\nKd 1 0.5 0.2\nKs 0.5 0.5 0.5\nNs 40\n");
            return Seeds{whole};
          },
          std::move(mutate), [](const fs::path& file) { raytrace::read_model(file); }};
}

Seeds pictures(Folder) {
  cv::Mat picture(6, 5, CV_8UC3);
  for (int k = 0; k < 90; ++k) picture.data[k] = static_cast<unsigned char>(40 * k);
  Seeds seeds;
  for (const char* ending : {".png", ".jpg", ".tiff"}) {
    std::vector<unsigned char> bytes;
    cv::imencode(ending, picture, bytes);
    seeds.emplace_back(bytes.begin(), bytes.end());
  }
  return seeds;
}

Seeds spectra(Folder folder) {
  const fs::path file = folder / "spectra.tiff";
  cv::imwritemulti(file.string(), std::vector<cv::Mat>(3, cv::Mat(4, 5, CV_32FC1, cv::Scalar(0.5))));
  return {read_file(file)};
}

}  // namespace

std::vector<Door> scene_doors() {
  return {
      {"scene.json", "scene.json", [](Folder) { return Seeds{scene}; }, mutate_json,
       [](const fs::path& file) { raytrace::read_scene(file); }},
      model_door("obj", obj, mutate_text),
      model_door("gltf", gltf, mutate_json),
      model_door("glb", glb(), mutate_bytes),
      {"picture", "picture", pictures, mutate_bytes,
       [](const fs::path& file) { raytrace::read_picture(file); }},
      {"spectra", "spectra.tiff", spectra, mutate_bytes,
       [](const fs::path& file) {
         raytrace::read_spectral_picture(file, {450, 550, 650});
       }},
  };
}

}  // namespace emmetrope::fuzz
