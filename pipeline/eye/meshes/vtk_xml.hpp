#pragma once
#include <cstdint>
#include <pugixml.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace emmetrope {

/// The arrays of a VTK XML file ("VTK XML Formats", docs.vtk.org): text, base64 or raw bytes, inline or appended, of either
/// byte order, packed by zlib or not. vtkXMLPolyDataReader is not used: it believes what a broken file says of its own
/// sizes and types, and reads and writes beyond its memory. Here every size is held against the bytes that are there.
/// \throw Error (input_invalid; unsupported: another packing than zlib)
class VtkXml {
 public:
  /// \param type the data set that is wanted: "PolyData"
  VtkXml(const std::string& bytes, const std::string& type);

  pugi::xml_node data_set() const { return data_set_; }

  /// All values of an <Array> or <DataArray>; of strings their characters, each ended by a zero.
  std::vector<double> numbers(pugi::xml_node array) const;

  /// \param array an empty node is an array without values
  std::vector<int> indices(pugi::xml_node array) const;

 private:
  /// An array's values as they lie in memory. \param stored begins where the array does and may go on behind it
  std::string unpacked(std::string_view stored, bool is_base64) const;
  /// The word of a header, as number k of them.
  std::uint64_t header_word(std::string_view header, std::size_t k) const;

  pugi::xml_document document_;
  pugi::xml_node data_set_;
  std::string appended_;
  bool is_appended_base64_ = false;
  bool is_big_endian_ = false;
  bool is_packed_ = false;
  std::size_t word_bytes_ = 4;
};

}  // namespace emmetrope
