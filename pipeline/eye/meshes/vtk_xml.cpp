#include "pipeline/eye/meshes/vtk_xml.hpp"

#include <fmt/format.h>
#include <openssl/evp.h>
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>

#include "pipeline/base/error.hpp"
#include "pipeline/eye/meshes/text_scanner.hpp"

namespace emmetrope {
namespace {

Error cut_short() { return input_error("the VTK file is cut short, or its arrays are broken"); }

constexpr std::size_t base64_size(std::size_t bytes) { return (bytes + 2) / 3 * 4; }

std::string decoded(std::string_view base64) {
  if (base64.size() > std::numeric_limits<int>::max() || base64.size() % 4 != 0) throw cut_short();
  std::string bytes(base64.size() / 4 * 3, '\0');
  const int count =
      EVP_DecodeBlock(reinterpret_cast<unsigned char*>(bytes.data()),
                      reinterpret_cast<const unsigned char*>(base64.data()), static_cast<int>(base64.size()));
  if (count != static_cast<int>(bytes.size())) throw cut_short();
  return bytes;
}

/// The first so many bytes of what is stored.
std::string first_bytes(std::string_view stored, std::size_t count, bool is_base64) {
  if (count > stored.size()) throw cut_short();
  if (!is_base64) return std::string(stored.substr(0, count));
  if (base64_size(count) > stored.size()) throw cut_short();
  return decoded(stored.substr(0, base64_size(count))).substr(0, count);
}

std::string inflated(std::string_view packed, std::uint64_t size) {
  constexpr std::uint64_t largest_expansion =
      1032;  // zlib's own limit: "An Explanation of the Deflate Algorithm"
  if (size > largest_expansion * (packed.size() + 1)) throw cut_short();
  std::string bytes(size, '\0');
  uLongf count = bytes.size();
  const int status = uncompress(reinterpret_cast<Bytef*>(bytes.data()), &count,
                                reinterpret_cast<const Bytef*>(packed.data()), packed.size());
  if (status != Z_OK || count != size) throw cut_short();
  return bytes;
}

template <typename Value>
std::vector<double> values(std::string bytes, bool is_reversed) {
  std::vector<double> result;
  result.reserve(bytes.size() / sizeof(Value));
  for (std::size_t at = 0; at + sizeof(Value) <= bytes.size(); at += sizeof(Value)) {
    if (is_reversed)
      std::reverse(bytes.begin() + static_cast<std::ptrdiff_t>(at),
                   bytes.begin() + static_cast<std::ptrdiff_t>(at + sizeof(Value)));
    Value value;
    std::memcpy(&value, bytes.data() + at, sizeof value);
    result.push_back(static_cast<double>(value));
  }
  return result;
}

std::vector<double> values(std::string bytes, const std::string& type, bool is_reversed) {
  using Read = std::vector<double> (*)(std::string, bool);
  static const std::map<std::string, Read> readers = {
      {"Int8", values<std::int8_t>},     {"UInt8", values<std::uint8_t>},   {"Int16", values<std::int16_t>},
      {"UInt16", values<std::uint16_t>}, {"Int32", values<std::int32_t>},   {"UInt32", values<std::uint32_t>},
      {"Int64", values<std::int64_t>},   {"UInt64", values<std::uint64_t>}, {"Float32", values<float>},
      {"Float64", values<double>},       {"String", values<std::uint8_t>}};
  const auto reader = readers.find(type);
  if (reader == readers.end()) throw input_error("a VTK array of type '" + type + "'");
  return reader->second(std::move(bytes), is_reversed);
}

std::vector<double> text_values(std::string_view text) {
  TextScanner scanner(text);
  std::vector<double> result;
  while (scanner.skip_to_word()) {
    const auto number = scanner.number();
    if (!number) throw input_error("a VTK array has a value that is no number");
    result.push_back(*number);
  }
  return result;
}

/// XML ends where raw bytes begin: <AppendedData encoding="raw">_ and then anything.
struct Parts {
  std::string xml;
  std::string_view appended;
};

Parts parts_of(const std::string& bytes) {
  const auto tag = bytes.find("<AppendedData");
  if (tag == std::string::npos) return {bytes, {}};
  const auto end = bytes.find('>', tag);
  const auto underscore = bytes.find('_', end);
  if (end == std::string::npos || underscore == std::string::npos) throw cut_short();
  return {bytes.substr(0, end + 1) + "</AppendedData></VTKFile>",
          std::string_view(bytes).substr(underscore + 1)};
}

}  // namespace

VtkXml::VtkXml(const std::string& bytes, const std::string& type) {
  const Parts parts = parts_of(bytes);
  const auto parsed = document_.load_buffer(parts.xml.data(), parts.xml.size());
  if (!parsed)
    throw input_error(
        fmt::format("no readable VTK file: {} at byte {}", parsed.description(), parsed.offset));
  const pugi::xml_node file = document_.child("VTKFile");
  data_set_ = file.child(type.c_str());
  if (!data_set_)
    throw input_error(fmt::format("a VTK file of type '{}', not {}", file.attribute("type").value(), type));
  const std::string packing = file.attribute("compressor").value();
  if (!packing.empty() && packing != "vtkZLibDataCompressor")
    throw unsupported_error("the VTK file is packed by " + packing, "write it with zlib, or not packed");
  is_packed_ = !packing.empty();
  is_big_endian_ = file.attribute("byte_order").value() == std::string("BigEndian");
  word_bytes_ = file.attribute("header_type").value() == std::string("UInt64") ? 8 : 4;
  appended_ = parts.appended;
  is_appended_base64_ = file.child("AppendedData").attribute("encoding").value() == std::string("base64");
}

std::vector<double> VtkXml::numbers(pugi::xml_node array) const {
  if (!array) return {};
  const std::string format = array.attribute("format").value(), type = array.attribute("type").value();
  if (format == "appended") {
    const std::uint64_t offset = array.attribute("offset").as_ullong();
    if (offset > appended_.size()) throw cut_short();
    return values(unpacked(std::string_view(appended_).substr(offset), is_appended_base64_), type,
                  is_big_endian_);
  }
  if (format == "binary") {
    std::string text = array.text().get();
    text.erase(std::remove_if(text.begin(), text.end(), [](unsigned char c) { return std::isspace(c) != 0; }),
               text.end());
    return text.empty() ? std::vector<double>() : values(unpacked(text, true), type, is_big_endian_);
  }
  return text_values(array.text().get());
}

std::vector<int> VtkXml::indices(pugi::xml_node array) const {
  std::vector<int> result;
  for (const double value : numbers(array)) {
    if (!(value >= 0 && value <= std::numeric_limits<int>::max()) || value != std::floor(value))
      throw input_error(
          fmt::format("{} as an index in the VTK array '{}'", value, array.attribute("Name").value()));
    result.push_back(static_cast<int>(value));
  }
  return result;
}

std::uint64_t VtkXml::header_word(std::string_view header, std::size_t k) const {
  std::string word(header.substr(k * word_bytes_, word_bytes_));
  if (is_big_endian_) std::reverse(word.begin(), word.end());
  std::uint64_t value = 0;
  std::memcpy(&value, word.data(), word.size());
  return value;
}

std::string VtkXml::unpacked(std::string_view stored, bool is_base64) const {
  const std::uint64_t count = header_word(first_bytes(stored, word_bytes_, is_base64), 0);
  if (count > stored.size()) throw cut_short();
  if (!is_packed_) return first_bytes(stored, word_bytes_ + count, is_base64).substr(word_bytes_);

  // Number of blocks, size of each, size of the last where it is smaller, then each one's packed size.
  const std::size_t header_bytes = (3 + count) * word_bytes_;
  const std::string header = first_bytes(stored, header_bytes, is_base64);
  stored.remove_prefix(is_base64 ? base64_size(header_bytes) : header_bytes);
  const std::uint64_t whole = header_word(header, 1), last = header_word(header, 2);
  std::uint64_t packed_bytes = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const std::uint64_t block = header_word(header, 3 + k);
    if (block > stored.size()) throw cut_short();
    packed_bytes += block;
  }
  const std::string packed = first_bytes(stored, packed_bytes, is_base64);
  std::string result;
  std::string_view rest = packed;
  for (std::size_t k = 0; k < count; ++k) {
    const std::uint64_t block = header_word(header, 3 + k);
    result += inflated(rest.substr(0, block), k + 1 == count && last != 0 ? last : whole);
    rest.remove_prefix(block);
  }
  return result;
}

}  // namespace emmetrope
