#include "pipeline/eye/meshes/triangle_mesh.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/eye/meshes/mesh_formats.hpp"

namespace emmetrope {
namespace {

struct Format {
  const char* ending;
  MeshFile (*parse)(const std::string& bytes);
  std::string (*format)(const TriangleMesh& mesh, bool says_lps);
};

// A new file format is one line here.
constexpr Format formats[] = {{".ply", parse_ply, format_ply},
                              {".stl", parse_stl, format_stl},
                              {".obj", parse_obj, format_obj},
                              {".vtp", parse_vtp, format_vtp}};

const Format& format_of(const std::filesystem::path& file) {
  std::string ending = file.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return std::tolower(c); });
  for (const Format& format : formats)
    if (ending == format.ending) return format;
  throw unsupported_error(file.string() + ": the ending '" + ending + "' is no mesh format that is known",
                          "use .ply, .stl, .obj or .vtp");
}

void check(const TriangleMesh& mesh) {
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i)
    if (!mesh.vertices[i].allFinite())
      throw input_error("vertex " + std::to_string(i) + " has a coordinate that is no finite number");
  if (!mesh.normals.empty() && mesh.normals.size() != mesh.vertices.size())
    throw input_error(std::to_string(mesh.normals.size()) + " normals for " +
                      std::to_string(mesh.vertices.size()) + " vertices");
  const int count = static_cast<int>(mesh.vertices.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (const int corner : mesh.triangles[t])
      if (corner < 0 || corner >= count)
        throw input_error("triangle " + std::to_string(t) + " names vertex " + std::to_string(corner) +
                          " of " + std::to_string(count));
}

// Files keep normals with few digits; a zero normal would poison interpolation, so all are then left out.
void normalise_normals(TriangleMesh& mesh) {
  for (Eigen::Vector3d& normal : mesh.normals) {
    const double length = normal.norm();
    if (!(length > 1e-6) || !std::isfinite(length)) {
      mesh.normals.clear();
      return;
    }
    normal /= length;
  }
}

}  // namespace

void note_space(std::string_view comment, MeshFile& file) {
  file.says_lps |= comment.find(space_lps) != std::string_view::npos;
  file.says_ras |= comment.find("SPACE=RAS") != std::string_view::npos;
}

bool weld(TriangleMesh& mesh) {
  constexpr double same_normal = 1e-3;  // what digits leave
  TriangleMesh welded;
  std::map<std::array<double, 3>, int> places;
  std::vector<bool> used(mesh.vertices.size(), false);
  for (const auto& triangle : mesh.triangles)
    for (const int corner : triangle) used[corner] = true;
  std::vector<int> place_of(mesh.vertices.size(), -1);
  bool has_several_normals = false;
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    if (!used[i]) continue;
    const Eigen::Vector3d& v = mesh.vertices[i];
    const auto [place, is_new] =
        places.try_emplace({v.x(), v.y(), v.z()}, static_cast<int>(welded.vertices.size()));
    place_of[i] = place->second;
    if (is_new) {
      welded.vertices.push_back(v);
      if (!mesh.normals.empty()) welded.normals.push_back(mesh.normals[i]);
    } else if (!mesh.normals.empty()) {
      has_several_normals |= (welded.normals[place->second] - mesh.normals[i]).norm() > same_normal;
    }
  }
  if (has_several_normals) welded.normals.clear();
  std::set<std::array<int, 3>> known;
  for (const auto& [a, b, c] : mesh.triangles) {
    const std::array<int, 3> corners{place_of[a], place_of[b], place_of[c]};
    std::array<int, 3> sorted = corners;
    std::sort(sorted.begin(), sorted.end());
    if (sorted[0] != sorted[1] && sorted[1] != sorted[2] && known.insert(sorted).second)
      welded.triangles.push_back(corners);
  }
  mesh = std::move(welded);
  return has_several_normals;
}

MeshFile read_mesh(const std::filesystem::path& file) {
  const Format& format = format_of(file);
  const std::string bytes = read_file(file);
  try {
    MeshFile result = format.parse(bytes);
    check(result.mesh);
    normalise_normals(result.mesh);
    return result;
  } catch (const Error& error) {
    throw Error(error.status(), file.string() + ": " + error.what(),
                error.remedy().empty() ? "copy or export the file again" : error.remedy());
  }
}

void write_mesh(const std::filesystem::path& file, const TriangleMesh& mesh, bool says_lps) {
  const Format& format = format_of(file);
  check(mesh);
  write_file(file, format.format(mesh, says_lps));
}

}  // namespace emmetrope
