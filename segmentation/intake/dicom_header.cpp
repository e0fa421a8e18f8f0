#include "segmentation/intake/dicom_header.hpp"

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dcspchrs.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/ofstd/ofchrenc.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <optional>
#include <regex>

#include "pipeline/base/clean_text.hpp"
#include "pipeline/base/error.hpp"
#include "segmentation/intake/tag_values.hpp"

namespace emmetrope::segmentation {
namespace {

/// Levels of nested sequences; what real objects use is below 10, and DCMTK's own later limit is 64.
constexpr int deepest_nesting = 64;

DcmTagKey key(const Tag& tag) { return {tag.group, tag.element}; }

enum class Guess { part10, bare_data_set, other };

/// From the first bytes: a Part 10 file, a data set without preamble (it begins in group 2 or 8), or
/// something else.
Guess guess_format(const std::filesystem::path& file) {
  std::array<unsigned char, 132> start{};
  std::ifstream stream(file, std::ios::binary);
  stream.read(reinterpret_cast<char*>(start.data()), start.size());
  if (stream.gcount() == 132 && std::equal(start.begin() + 128, start.end(), "DICM")) return Guess::part10;
  if (stream.gcount() < 16) return Guess::other;
  const bool little = (start[0] == 2 || start[0] == 8) && start[1] == 0 && start[3] == 0 && start[2] < 0x20;
  const bool big = start[0] == 0 && start[1] == 8 && start[2] == 0 && start[3] < 0x20;
  return little || big ? Guess::bare_data_set : Guess::other;
}

std::string what_else(const std::filesystem::path& file) {
  static const std::regex packed(R"(.*\.(zip|tar|tgz|gz|7z|rar))", std::regex::icase);
  return std::regex_match(file.filename().string(), packed) ? "an archive: unpack it" : "not a DICOM file";
}

bool is_text(DcmEVR vr) {
  switch (vr) {
    case EVR_FD:
    case EVR_FL:
    case EVR_OB:
    case EVR_OW:
    case EVR_SL:
    case EVR_SQ:
    case EVR_SS:
    case EVR_UL:
    case EVR_US:
      return false;
    default:
      return true;
  }
}

/// The item itself or one around it, whose character set holds within.
DcmItem& with_character_set(DcmItem& item) {
  DcmItem* told = &item;
  while (!told->tagExists(DCM_SpecificCharacterSet) && told->getParentItem() != nullptr)
    told = told->getParentItem();
  return *told;
}

/// Japanese and simplified Chinese with escape sequences (PS3.5 6.1.2.5), for which the C library has no
/// converter, as the country's extended Unix code, which has none; nothing where there are other sequences.
/// \param high_bytes  what stands before a byte above 127 outside of two-byte sets; null: such a byte means nothing
std::optional<std::string> extended_unix_code(const std::string& text, const char* high_bytes) {
  enum class Set { one_byte, two_bytes, supplement };
  static const std::pair<std::string, Set> escapes[] = {
      {"\x1B$B", Set::two_bytes}, {"\x1B$@", Set::two_bytes}, {"\x1B$(D", Set::supplement},
      {"\x1B(B", Set::one_byte},  {"\x1B(J", Set::one_byte},  {"\x1B)I", Set::one_byte},
      {"\x1B$)A", Set::one_byte}};
  std::string code;
  Set set = Set::one_byte;
  for (std::size_t i = 0; i < text.size();) {
    const auto* escape = std::find_if(std::begin(escapes), std::end(escapes), [&](const auto& one) {
      return text.compare(i, one.first.size(), one.first) == 0;
    });
    if (escape != std::end(escapes)) {
      set = escape->second;
      i += escape->first.size();
      continue;
    }
    const std::size_t bytes = set == Set::one_byte ? 1 : 2;
    const bool is_high = (text[i] & 0x80) != 0;
    if (text[i] == '\x1B' || i + bytes > text.size() || (is_high && high_bytes == nullptr)) return {};
    if (set == Set::supplement) code += '\x8F';
    if (set == Set::one_byte && is_high) code += high_bytes;
    for (const std::size_t end = i + bytes; i < end; ++i)
      code += static_cast<char>(set == Set::one_byte ? text[i] : text[i] | 0x80);
  }
  return code;
}

bool convert_extended_unix_code(const std::string& character_sets, std::string& text) {
  const auto has = [&](const char* set) {
    return ("\\" + character_sets + "\\").find(std::string("\\") + set + "\\") != std::string::npos;
  };
  const bool chinese = has("ISO 2022 IR 58"), katakana = has("ISO 2022 IR 13") || has("ISO_IR 13");
  if (!chinese && !katakana && !has("ISO 2022 IR 87") && !has("ISO 2022 IR 159")) return false;
  const auto code = extended_unix_code(text, chinese ? "" : katakana ? "\x8E" : nullptr);
  OFCharacterEncoding converter;
  OFString utf8;
  if (!code || converter.selectEncoding(chinese ? "GB2312" : "EUC-JP", "UTF-8").bad() ||
      converter.convertString(OFString(code->c_str(), code->size()), utf8).bad())
    return false;
  text.assign(utf8.c_str(), utf8.length());
  return true;
}

/// From the character set of the item, and clean; what it is where this fails is not told.
bool convert_to_utf8(DcmItem& item, std::string& text) {
  const bool is_ascii = std::all_of(text.begin(), text.end(), [](char letter) {
    return static_cast<unsigned char>(letter) < 0x80 && letter != '\x1B';
  });
  if (is_ascii) return make_clean_utf8(text);
  DcmItem& data_set = with_character_set(item);
  DcmSpecificCharacterSet converter;
  OFString utf8, character_sets;
  // An escape sequence that is left over is of a set that was not told.
  if (converter.selectCharacterSet(data_set).good() &&
      converter.convertString(OFString(text.c_str(), text.size()), utf8, "\\^=").good() &&
      utf8.find('\x1B') == OFString_npos) {
    text.assign(utf8.c_str(), utf8.length());
    return make_clean_utf8(text);
  }
  return data_set.findAndGetOFStringArray(DCM_SpecificCharacterSet, character_sets).good() &&
         convert_extended_unix_code(character_sets.c_str(), text) && make_clean_utf8(text);
}

/// What is readable of a text that cannot be converted.
std::string ascii_part(std::string text) {
  text.resize(std::min(text.find('\x1B'), text.size()));
  for (char& letter : text)
    if ((letter & 0x80) != 0) letter = '?';
  return text;
}

struct HeaderText {
  /// Of one that cannot be converted what is ASCII, so that names are found in other texts
  std::string utf8;
  bool is_converted = true;
};

/// The element's value as text, empty when it is absent.
/// \throw Error when its VR is of another kind than the standard's, so that its bytes mean something else
HeaderText text_of(DcmItem& item, const Tag& tag) {
  DcmElement* element = nullptr;
  if (item.findAndGetElement(key(tag), element).bad() || element == nullptr) return {};
  const DcmEVR expected = DcmTag(key(tag)).getEVR();
  const bool comparable = (tag.group & 1) == 0 && expected != EVR_xs && element->getVR() != EVR_UN;
  if (comparable && is_text(element->getVR()) != is_text(expected))
    throw input_error(fmt::format("{} has the value representation {}, not {}", to_string(tag),
                                  DcmVR(element->getVR()).getVRName(), DcmVR(expected).getVRName()));
  OFString value;
  if (item.findAndGetOFStringArray(key(tag), value).bad()) return {};
  std::string text(value.c_str(), value.length());
  while (!text.empty() && (text.back() == ' ' || text.back() == '\0')) text.pop_back();
  for (char& letter : text)
    if ((static_cast<unsigned char>(letter) < 0x20 && letter != '\x1B') || letter == 0x7F) letter = '?';
  std::string utf8 = text;  // escape sequences are part of some character sets
  if (convert_to_utf8(item, utf8)) return {utf8};
  return {ascii_part(std::move(text)), false};
}

/// A text of a header alone, which goes into other objects, is left out where it cannot be converted.
void read_text(DcmDataset& data_set, const Tag& wanted, Request request, ImageHeader& header) {
  HeaderText text = text_of(data_set, wanted);
  if (!text.is_converted) header.unreadable.insert(wanted.keyword);
  if (!text.utf8.empty() && (text.is_converted || request == Request::everything))
    header.data_set[wanted.keyword] = std::move(text.utf8);
}

void read_attribute(DcmItem& groups, const Tag& macro, const Tag& attribute, TagValues& values) {
  DcmItem* item = nullptr;
  if (groups.findAndGetSequenceItem(key(macro), item, 0).bad() || item == nullptr) return;
  if (auto value = text_of(*item, attribute).utf8; !value.empty())
    values[attribute.keyword] = std::move(value);
}

void read_frame(DcmItem& groups, TagValues& values) {
  for (const Tag& macro : {tag::unassigned_shared_sequence, tag::unassigned_per_frame_sequence})
    for (const Tag& attribute : tag::of_classic_images) read_attribute(groups, macro, attribute, values);
  for (const auto& [macro, attribute] : tag::of_frames) read_attribute(groups, macro, attribute, values);
}

/// As far as it matters: exporters round, and write -0 or 2e-10 for 0.
bool is_same_value(const std::string& one, const std::string& other) {
  const auto parts = split_values(one), others = split_values(other);
  return std::equal(parts.begin(), parts.end(), others.begin(), others.end(),
                    [](const std::string& a, const std::string& b) {
                      const auto x = parse_number(a), y = parse_number(b);
                      return a == b || (x && y && std::abs(*x - *y) <= 1e-3 * (1 + std::abs(*x)));
                    });
}

/// A macro is shared or a frame's own, never both (PS3.3 C.7.6.16.1.1): of two that differ one was forgotten by who
/// changed the other.
void require_one_place(const TagValues& shared, const TagValues& own) {
  for (const Tag& tag :
       {tag::image_orientation, tag::image_position, tag::pixel_spacing, tag::slice_thickness,
        tag::spacing_between_slices, tag::rescale_slope, tag::rescale_intercept}) {
    const auto for_all = shared.find(tag.keyword), of_frame = own.find(tag.keyword);
    if (for_all != shared.end() && of_frame != own.end() && !is_same_value(for_all->second, of_frame->second))
      throw input_error(fmt::format("{} is {} in the shared functional groups and {} in those of a frame",
                                    to_string(tag), in_quotes(for_all->second), in_quotes(of_frame->second)));
  }
}

/// Functional groups of each frame, the shared ones where it has none; one empty entry for a classic image.
std::vector<TagValues> read_frames(DcmDataset& data_set) {
  TagValues shared;
  DcmItem* groups = nullptr;
  if (data_set.findAndGetSequenceItem(DCM_SharedFunctionalGroupsSequence, groups, 0).good() &&
      groups != nullptr)
    read_frame(*groups, shared);
  DcmSequenceOfItems* per_frame = nullptr;
  if (data_set.findAndGetSequence(DCM_PerFrameFunctionalGroupsSequence, per_frame).bad() ||
      per_frame == nullptr)
    return {shared};
  std::vector<TagValues> frames;
  for (auto* item = per_frame->nextInContainer(nullptr); item != nullptr;
       item = per_frame->nextInContainer(item)) {
    TagValues own;
    read_frame(*dynamic_cast<DcmItem*>(item), own);
    require_one_place(shared, own);
    own.insert(shared.begin(), shared.end());
    frames.push_back(std::move(own));
  }
  return frames;
}

bool nests_deeper(DcmObject& object, int levels) {
  if (levels < 0) return true;
  for (auto* inner = object.nextInContainer(nullptr); inner != nullptr; inner = object.nextInContainer(inner))
    if (!inner->isLeaf() && nests_deeper(*inner, levels - 1)) return true;
  return false;
}

/// Nothing of it is measured: what cannot be read is left out.
template <std::size_t Count>
void read_what_is_there(const Tag (&tags)[Count], DcmDataset& data_set, Request request,
                        ImageHeader& header) {
  for (const auto& wanted : tags) {
    try {
      read_text(data_set, wanted, request, header);
    } catch (const Error&) {
    }
  }
}

/// OtherPatientIDs, and what OtherPatientIDsSequence has in its place since 2017; what cannot be read is left out.
void read_other_ids(DcmDataset& data_set, ImageHeader& header) {
  DcmSequenceOfItems* others = nullptr;
  if (data_set.findAndGetSequence(DCM_OtherPatientIDsSequence, others).bad() || others == nullptr) return;
  for (auto* item = others->nextInContainer(nullptr); item != nullptr; item = others->nextInContainer(item)) {
    try {
      const auto id = text_of(*dynamic_cast<DcmItem*>(item), tag::patient_id).utf8;
      if (id.empty()) continue;
      std::string& ids = header.data_set[tag::other_patient_ids.keyword];
      ids += (ids.empty() ? "" : "\\") + id;
    } catch (const Error&) {
    }
  }
}

void read_description(DcmDataset& data_set, ImageHeader& header) {
  OFString raw;
  if (data_set.findAndGetOFStringArray(key(tag::series_description), raw).bad()) return;
  header.description = raw.c_str();
  if (convert_to_utf8(data_set, header.description)) return;
  header.unreadable.insert(tag::series_description.keyword);
  header.description.clear();  // nobody's name is found in it
}

}  // namespace

ImageHeader read_header(const std::filesystem::path& file, DcmFileFormat& parsed, Request request) {
  ImageHeader header;
  const Guess guess = guess_format(file);
  if (guess == Guess::other) {
    header.reason = what_else(file);
    return header;
  }
  const OFCondition loaded = parsed.loadFile(file.c_str());
  DcmDataset& data_set = *parsed.getDataset();
  OFString value;
  if (parsed.getMetaInfo()->findAndGetOFString(DCM_MediaStorageSOPClassUID, value).good() &&
      value == uid::directory) {
    header.kind = FileKind::directory;
    header.reason = "a DICOMDIR, an index without images";
    return header;
  }
  const bool stated = parsed.getMetaInfo()->findAndGetOFString(DCM_TransferSyntaxUID, value).good();
  header.transfer_syntax = stated ? value.c_str() : DcmXfer(data_set.getOriginalXfer()).getXferID();
  header.kind = FileKind::damaged;
  try {
    if (nests_deeper(data_set, 2 * deepest_nesting))
      throw input_error(fmt::format("sequences are nested more than {} deep", deepest_nesting));
    for (const auto& wanted : tag::of_data_set) read_text(data_set, wanted, request, header);
    read_other_ids(data_set, header);
    read_what_is_there(tag::of_identity, data_set, request, header);
    if (request == Request::header) read_what_is_there(tag::of_study, data_set, request, header);
    if (data_set.tagExists(key(tag::modality_lut))) header.data_set[tag::modality_lut.keyword] = "present";
    read_description(data_set, header);
    header.frames = read_frames(data_set);
  } catch (const Error& fault) {
    header.reason = fault.what();
    return header;
  }
  if (loaded.bad()) {
    if (guess == Guess::bare_data_set && !header.has(tag::sop_class))
      return {FileKind::not_dicom, "not a DICOM file"};
    header.reason = fmt::format("cannot be parsed to its end: {}", loaded.text());
    return header;
  }
  if (guess == Guess::bare_data_set && !header.has(tag::sop_class) && !header.has(tag::series_instance))
    return {FileKind::not_dicom, "not a DICOM file"};
  // An image that has lost its pixels must not pass for a report.
  const bool is_image = header.has(tag::rows) || data_set.tagExists(DCM_PixelData);
  header.kind = is_image ? FileKind::image : FileKind::no_image;
  if (header.kind == FileKind::no_image)
    header.reason =
        fmt::format("DICOM without pixels, {} {}", to_string(tag::sop_class), header.value(tag::sop_class));
  return header;
}

}  // namespace emmetrope::segmentation
