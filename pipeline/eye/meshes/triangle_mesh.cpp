#include "pipeline/eye/meshes/triangle_mesh.hpp"

#include <algorithm>
#include <cmath>

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

MeshFile read_mesh(const std::filesystem::path& file) {
  const Format& format = format_of(file);
  const std::string bytes = read_file(file);
  try {
    MeshFile result = format.parse(bytes);
    check(result.mesh);
    normalise_normals(result.mesh);
    return result;
  } catch (const Error& error) {
    throw Error(error.status(), file.string() + ": " + error.what(), error.remedy());
  }
}

void write_mesh(const std::filesystem::path& file, const TriangleMesh& mesh, bool says_lps) {
  const Format& format = format_of(file);
  check(mesh);
  write_file(file, format.format(mesh, says_lps));
}

}  // namespace emmetrope
