#include <fmt/format.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <optional>

#include "pipeline/base/error.hpp"
#include "pipeline/eye/meshes/mesh_formats.hpp"
#include "pipeline/eye/meshes/text_scanner.hpp"

namespace emmetrope {
namespace {

enum class Encoding { text, little, big };
enum class Scalar { i8, u8, i16, u16, i32, u32, f32, f64 };

Scalar scalar_from(std::string_view name) {
  static const std::map<std::string_view, Scalar> names{
      {"char", Scalar::i8},   {"int8", Scalar::i8},     {"uchar", Scalar::u8},   {"uint8", Scalar::u8},
      {"short", Scalar::i16}, {"int16", Scalar::i16},   {"ushort", Scalar::u16}, {"uint16", Scalar::u16},
      {"int", Scalar::i32},   {"int32", Scalar::i32},   {"uint", Scalar::u32},   {"uint32", Scalar::u32},
      {"float", Scalar::f32}, {"float32", Scalar::f32}, {"double", Scalar::f64}, {"float64", Scalar::f64}};
  const auto found = names.find(name);
  if (found == names.end()) throw input_error("PLY property of unknown type '" + std::string(name) + "'");
  return found->second;
}

std::size_t size_of(Scalar scalar) {
  switch (scalar) {
    case Scalar::i8:
    case Scalar::u8:
      return 1;
    case Scalar::i16:
    case Scalar::u16:
      return 2;
    case Scalar::i32:
    case Scalar::u32:
    case Scalar::f32:
      return 4;
    case Scalar::f64:
      return 8;
  }
  return 0;
}

struct Property {
  std::string name;
  Scalar scalar = Scalar::f32;
  std::optional<Scalar> list_count;  ///< set for a list: the type of its length
};

struct Element {
  std::string name;
  std::size_t count = 0;
  std::vector<Property> properties;
};

struct Header {
  Encoding encoding = Encoding::text;
  std::vector<Element> elements;
  std::size_t end = 0;  ///< where the data begin
};

/// \param file  is told of its frame
Header read_header(const std::string& bytes, MeshFile& file) {
  Header header;
  TextScanner lines(bytes);
  if (lines.line() != "ply") throw input_error("no PLY file: its first line is not 'ply'");
  bool has_format = false;
  while (true) {
    if (lines.at_end()) throw input_error("the PLY header has no 'end_header'");
    const std::string_view line = lines.line();
    TextScanner words(line);
    const std::string_view key = words.word();
    if (key == "end_header") break;
    if (key == "comment") {
      note_space(line, file);
    } else if (key == "format") {
      const std::string_view name = words.word();
      if (name == "ascii")
        header.encoding = Encoding::text;
      else if (name == "binary_little_endian")
        header.encoding = Encoding::little;
      else if (name == "binary_big_endian")
        header.encoding = Encoding::big;
      else
        throw input_error("PLY format '" + std::string(name) + "' is not known");
      has_format = true;
    } else if (key == "element") {
      Element element;
      element.name = words.word();
      const std::optional<double> count = words.number();
      if (!count || *count < 0 || *count != std::floor(*count) || *count > static_cast<double>(bytes.size()))
        throw input_error("PLY element '" + element.name + "' promises more than the file can hold");
      element.count = static_cast<std::size_t>(*count);
      header.elements.push_back(element);
    } else if (key == "property") {
      if (header.elements.empty()) throw input_error("a PLY property stands before any element");
      Property property;
      std::string_view type = words.word();
      if (type == "list") {
        property.list_count = scalar_from(words.word());
        type = words.word();
      }
      property.scalar = scalar_from(type);
      property.name = words.word();
      header.elements.back().properties.push_back(property);
    } else if (key != "obj_info" && !key.empty()) {
      throw input_error("PLY header line '" + std::string(line.substr(0, 60)) + "' is not understood");
    }
  }
  if (!has_format) throw input_error("the PLY header has no 'format' line");
  header.end = lines.position();
  return header;
}

/// Reads one scalar after another, text or binary, and never past the end.
class PlyReader {
 public:
  PlyReader(const std::string& bytes, std::size_t start, Encoding encoding)
      : bytes_(bytes), at_(start), encoding_(encoding), text_(std::string_view(bytes).substr(start)) {}

  double next(Scalar scalar) {
    if (encoding_ == Encoding::text) {
      const std::optional<double> value = text_.number();
      if (!value) throw input_error("the PLY data end early or hold something that is no number");
      return *value;
    }
    const std::size_t size = size_of(scalar);
    if (bytes_.size() - at_ < size) throw input_error("the PLY data end early");
    unsigned char raw[8] = {};
    std::memcpy(raw, bytes_.data() + at_, size);
    at_ += size;
    if (encoding_ == Encoding::big) std::reverse(raw, raw + size);
    switch (scalar) {
      case Scalar::i8:
        return as<std::int8_t>(raw);
      case Scalar::u8:
        return as<std::uint8_t>(raw);
      case Scalar::i16:
        return as<std::int16_t>(raw);
      case Scalar::u16:
        return as<std::uint16_t>(raw);
      case Scalar::i32:
        return as<std::int32_t>(raw);
      case Scalar::u32:
        return as<std::uint32_t>(raw);
      case Scalar::f32:
        return as<float>(raw);
      case Scalar::f64:
        return as<double>(raw);
    }
    return 0;
  }

  std::size_t left() const { return encoding_ == Encoding::text ? text_.left() : bytes_.size() - at_; }

 private:
  template <typename T>
  static double as(const unsigned char* raw) {
    T value;
    std::memcpy(&value, raw, sizeof value);
    return static_cast<double>(value);
  }

  const std::string& bytes_;
  std::size_t at_;
  Encoding encoding_;
  TextScanner text_;
};

void read_vertices(PlyReader& reader, const Element& element, TriangleMesh& mesh) {
  const std::array<const char*, 6> wanted{"x", "y", "z", "nx", "ny", "nz"};
  std::array<int, 6> column{-1, -1, -1, -1, -1, -1};
  std::size_t record = 0;
  for (std::size_t p = 0; p < element.properties.size(); ++p) {
    for (std::size_t k = 0; k < wanted.size(); ++k)
      if (element.properties[p].name == wanted[k]) column[k] = static_cast<int>(p);
    record += size_of(element.properties[p].scalar);
  }
  if (column[0] < 0 || column[1] < 0 || column[2] < 0) throw input_error("the PLY vertices have no x, y, z");
  if (element.count > reader.left())
    throw input_error("the PLY header promises more vertices than there are");
  const bool has_normals = column[3] >= 0 && column[4] >= 0 && column[5] >= 0;
  mesh.vertices.reserve(std::min(element.count, reader.left() / std::max<std::size_t>(1, record / 4)));
  std::vector<double> values(element.properties.size());
  for (std::size_t i = 0; i < element.count; ++i) {
    for (std::size_t p = 0; p < values.size(); ++p) {
      const Property& property = element.properties[p];
      if (property.list_count) throw input_error("the PLY vertices hold a list, which is not supported");
      values[p] = reader.next(property.scalar);
    }
    mesh.vertices.emplace_back(values[column[0]], values[column[1]], values[column[2]]);
    if (has_normals) mesh.normals.emplace_back(values[column[3]], values[column[4]], values[column[5]]);
  }
}

/// What a list of floating-point numbers holds may be none.
int vertex_number(double value) {
  if (!(std::abs(value) <= std::numeric_limits<int>::max()) || value != std::floor(value))
    throw input_error(fmt::format("a PLY face names vertex {}: vertices have whole numbers", value));
  return static_cast<int>(value);
}

void read_others(PlyReader& reader, const Element& element, TriangleMesh& mesh) {
  std::vector<int> corners;
  for (std::size_t i = 0; i < element.count; ++i)
    for (const Property& property : element.properties) {
      if (!property.list_count) {
        reader.next(property.scalar);
        continue;
      }
      const double length = reader.next(*property.list_count);
      if (!(length >= 0 && length <= static_cast<double>(reader.left())))  // NaN is no length
        throw input_error("a PLY list is longer than the file");
      if (length != std::floor(length))
        throw input_error(fmt::format("a PLY list has {} entries: lists have whole lengths", length));
      const bool is_polygon =
          element.name == "face" && (property.name == "vertex_indices" || property.name == "vertex_index");
      corners.clear();
      for (int k = 0; k < static_cast<int>(length); ++k) {
        const double value = reader.next(property.scalar);
        if (is_polygon) corners.push_back(vertex_number(value));
      }
      if (is_polygon) add_polygon(mesh, corners);
    }
}

template <typename T>
void append(std::string& bytes, T value) {
  char raw[sizeof value];
  std::memcpy(raw, &value, sizeof value);
  bytes.append(raw, sizeof value);
}

}  // namespace

void add_polygon(TriangleMesh& mesh, const std::vector<int>& corners) {
  if (corners.size() < 3) throw input_error("a face has fewer than three corners");
  for (std::size_t k = 2; k < corners.size(); ++k)
    mesh.triangles.push_back({corners[0], corners[k - 1], corners[k]});
}

MeshFile parse_ply(const std::string& bytes) {
  MeshFile result;
  const Header header = read_header(bytes, result);
  PlyReader reader(bytes, header.end, header.encoding);
  for (const Element& element : header.elements) {
    // Even text takes two bytes a number.
    if (!element.properties.empty() && element.count > reader.left())
      throw input_error("PLY element '" + element.name + "' promises more than the file holds");
    if (element.name == "vertex")
      read_vertices(reader, element, result.mesh);
    else
      read_others(reader, element, result.mesh);
  }
  return result;
}

std::string format_ply(const TriangleMesh& mesh, bool says_lps) {
  std::string bytes = "ply\nformat binary_little_endian 1.0\ncomment lengths in mm\n";
  if (says_lps) bytes += std::string("comment ") + space_lps + "\n";
  bytes += "element vertex " + std::to_string(mesh.vertices.size()) + "\n";
  for (const char* name : {"x", "y", "z"}) bytes += std::string("property double ") + name + "\n";
  if (!mesh.normals.empty())
    for (const char* name : {"nx", "ny", "nz"}) bytes += std::string("property double ") + name + "\n";
  bytes += "element face " + std::to_string(mesh.triangles.size()) +
           "\nproperty list uchar int vertex_indices\nend_header\n";
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    for (int k = 0; k < 3; ++k) append(bytes, mesh.vertices[i][k]);
    if (!mesh.normals.empty())
      for (int k = 0; k < 3; ++k) append(bytes, mesh.normals[i][k]);
  }
  for (const auto& triangle : mesh.triangles) {
    append(bytes, std::uint8_t{3});
    for (const int corner : triangle) append(bytes, static_cast<std::int32_t>(corner));
  }
  return bytes;
}

}  // namespace emmetrope
