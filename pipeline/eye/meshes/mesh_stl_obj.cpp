#include <fmt/format.h>

#include <cstdint>
#include <cstring>

#include "pipeline/base/error.hpp"
#include "pipeline/eye/meshes/mesh_formats.hpp"
#include "pipeline/eye/meshes/text_scanner.hpp"

namespace emmetrope {
namespace {

/// STL repeats each vertex in every triangle: parse_stl welds them.
void add_facet(TriangleMesh& mesh, const std::array<Eigen::Vector3d, 3>& corners) {
  const int first = static_cast<int>(mesh.vertices.size());
  for (const Eigen::Vector3d& corner : corners) {
    if (!corner.allFinite()) throw input_error("an STL vertex has a coordinate that is no finite number");
    mesh.vertices.push_back(corner);
  }
  mesh.triangles.push_back({first, first + 1, first + 2});
}

constexpr std::size_t stl_header = 84, stl_record = 50;

void parse_binary_stl(const std::string& bytes, MeshFile& result) {
  std::uint32_t count = 0;
  std::memcpy(&count, bytes.data() + 80, sizeof count);
  const std::size_t expected = stl_header + stl_record * static_cast<std::size_t>(count);
  if (bytes.size() != expected)
    throw input_error(fmt::format("the STL header promises {} triangles, {} bytes; the file has {} bytes",
                                  count, expected, bytes.size()));
  note_space(std::string_view(bytes).substr(0, 80), result);
  for (std::size_t t = 0; t < count; ++t) {
    float raw[12];
    std::memcpy(raw, bytes.data() + stl_header + t * stl_record, sizeof raw);
    std::array<Eigen::Vector3d, 3> corners;
    for (int k = 0; k < 3; ++k) corners[k] = {raw[3 + 3 * k], raw[4 + 3 * k], raw[5 + 3 * k]};
    add_facet(result.mesh, corners);
  }
}

void parse_text_stl(const std::string& bytes, MeshFile& result) {
  TextScanner scanner(bytes);
  note_space(scanner.line(), result);
  std::array<Eigen::Vector3d, 3> corners;
  int filled = 0;
  bool complete = false;
  while (true) {
    const std::string_view word = scanner.word();
    if (word.empty()) break;
    if (word == "vertex") {
      if (filled == 3) throw input_error("an STL facet has more than three vertices");
      for (int k = 0; k < 3; ++k) {
        const std::optional<double> value = scanner.number();
        if (!value) throw input_error("an STL vertex has a coordinate that is no number");
        corners[filled][k] = *value;
      }
      ++filled;
    } else if (word == "endfacet") {
      if (filled != 3) throw input_error("an STL facet has fewer than three vertices");
      add_facet(result.mesh, corners);
      filled = 0;
    } else if (word == "endsolid") {
      complete = true;
      break;
    }
  }
  if (!complete) throw input_error("the STL text ends without 'endsolid'");
}

int obj_index(std::string_view text, std::size_t count) {
  int value = 0;
  const auto [end, status] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (status != std::errc{} || end != text.data() + text.size() || value == 0)
    throw input_error("OBJ face corner '" + std::string(text) + "' is no vertex number");
  const long long index = value > 0 ? value - 1LL : static_cast<long long>(count) + value;
  if (index < 0 || index >= static_cast<long long>(count))
    throw input_error(fmt::format("OBJ face corner {} lies outside the {} given before it", value, count));
  return static_cast<int>(index);
}

Eigen::Vector3d three_numbers(TextScanner& words, const char* what) {
  Eigen::Vector3d result;
  for (int k = 0; k < 3; ++k) {
    const std::optional<double> value = words.number();
    if (!value) throw input_error(std::string("an OBJ ") + what + " line has fewer than three numbers");
    result[k] = *value;
  }
  return result;
}

}  // namespace

MeshFile parse_stl(const std::string& bytes) {
  // Binary files may begin with "solid" too: the size decides.
  bool binary = bytes.size() >= stl_header;
  if (binary && bytes.compare(0, 5, "solid") == 0) {
    std::uint32_t count = 0;
    std::memcpy(&count, bytes.data() + 80, sizeof count);
    binary = bytes.size() == stl_header + stl_record * static_cast<std::size_t>(count);
  }
  MeshFile result;
  if (binary)
    parse_binary_stl(bytes, result);
  else if (bytes.compare(0, 5, "solid") == 0)
    parse_text_stl(bytes, result);
  else
    throw input_error("no STL file: shorter than its header");
  weld(result.mesh);
  return result;
}

MeshFile parse_obj(const std::string& bytes) {
  MeshFile result;
  TriangleMesh& mesh = result.mesh;
  std::vector<Eigen::Vector3d> normals;
  std::vector<int> corners, normal_of_vertex;
  TextScanner lines(bytes);
  while (!lines.at_end()) {
    const std::string_view line = lines.line();
    TextScanner words(line);
    const std::string_view key = words.word();
    if (key == "v")
      mesh.vertices.push_back(three_numbers(words, "v"));
    else if (key == "vn")
      normals.push_back(three_numbers(words, "vn"));
    else if (key == "f") {
      corners.clear();
      normal_of_vertex.resize(mesh.vertices.size(), -1);
      for (std::string_view word = words.word(); !word.empty(); word = words.word()) {
        const int vertex = obj_index(word.substr(0, word.find('/')), mesh.vertices.size());
        corners.push_back(vertex);
        const std::size_t last = word.rfind('/');
        if (last == word.find('/') || last + 1 >= word.size()) continue;
        const int normal = obj_index(word.substr(last + 1), normals.size());
        int& known = normal_of_vertex[vertex];
        if (known < 0) known = normal;
        result.has_face_normals |= !normals[known].isApprox(normals[normal], 1e-3);
      }
      add_polygon(mesh, corners);
    } else if (!key.empty() && key.front() == '#') {
      note_space(line, result);
    }
  }
  normal_of_vertex.resize(mesh.vertices.size(), -1);
  for (const int index : normal_of_vertex) {
    if (index < 0 || result.has_face_normals) {
      mesh.normals.clear();
      break;
    }
    mesh.normals.push_back(normals[index]);
  }
  return result;
}

std::string format_stl(const TriangleMesh& mesh, bool says_lps) {
  std::string bytes = says_lps ? std::string("lengths in mm, ") + space_lps : "lengths in mm";
  bytes.resize(80, ' ');
  const auto count = static_cast<std::uint32_t>(mesh.triangles.size());
  bytes.append(reinterpret_cast<const char*>(&count), sizeof count);
  for (const auto& t : mesh.triangles) {
    const Eigen::Vector3d& a = mesh.vertices[t[0]];
    const Eigen::Vector3d normal = (mesh.vertices[t[1]] - a).cross(mesh.vertices[t[2]] - a).normalized();
    float raw[12];
    for (int k = 0; k < 3; ++k) {
      raw[k] = static_cast<float>(normal[k]);
      for (int c = 0; c < 3; ++c) raw[3 + 3 * c + k] = static_cast<float>(mesh.vertices[t[c]][k]);
    }
    bytes.append(reinterpret_cast<const char*>(raw), sizeof raw);
    bytes.append(2, '\0');
  }
  return bytes;
}

std::string format_obj(const TriangleMesh& mesh, bool says_lps) {
  std::string text = "# lengths in mm\n";
  if (says_lps) text += fmt::format("# {}\n", space_lps);
  for (const Eigen::Vector3d& v : mesh.vertices) text += fmt::format("v {} {} {}\n", v.x(), v.y(), v.z());
  for (const Eigen::Vector3d& n : mesh.normals) text += fmt::format("vn {} {} {}\n", n.x(), n.y(), n.z());
  for (const auto& t : mesh.triangles)
    text += mesh.normals.empty()
                ? fmt::format("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1)
                : fmt::format("f {0}//{0} {1}//{1} {2}//{2}\n", t[0] + 1, t[1] + 1, t[2] + 1);
  return text;
}

}  // namespace emmetrope
