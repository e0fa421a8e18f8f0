#include "pipeline/report/dicom/object.hpp"

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dcostrmb.h>
#include <dcmtk/dcmdata/dctk.h>

#include <algorithm>

#include "pipeline/base/clean_text.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/version.hpp"
#include "pipeline/report/figures/encoding.hpp"

namespace emmetrope::report {
namespace {

/// The study's characters may be of any set; what is added here is ASCII.
void keep_character_set(DcmItem& dataset) {
  if (!dataset.tagExists(DCM_SpecificCharacterSet))
    dataset.putAndInsertString(DCM_SpecificCharacterSet, "ISO_IR 192");
}

}  // namespace

std::string stable_uid(const std::string& text) {
  const std::string hash = sha256_of(text);
  std::array<int, 16> bytes{};
  for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = std::stoi(hash.substr(2 * i, 2), nullptr, 16);
  bytes[6] = (bytes[6] & 0x0f) | 0x80;  // UUID version 8: made from a hash of one's own
  bytes[8] = (bytes[8] & 0x3f) | 0x80;
  std::string decimal;  // repeated division of the 128-bit number by ten
  while (std::any_of(bytes.begin(), bytes.end(), [](int b) { return b != 0; })) {
    int rest = 0;
    for (int& byte : bytes) {
      const int value = rest * 256 + byte;
      byte = value / 10;
      rest = value % 10;
    }
    decimal.insert(decimal.begin(), static_cast<char>('0' + rest));
  }
  return "2.25." + decimal;
}

std::string dicom_text(const std::string& text, std::size_t most) {
  std::string clean = clean_utf8(text);
  std::replace(clean.begin(), clean.end(), '\\', '/');
  std::size_t end = 0;
  for (std::size_t characters = 0; end < clean.size(); ++end) {
    const bool is_first_byte = (static_cast<unsigned char>(clean[end]) & 0xc0) != 0x80;
    if (is_first_byte && characters++ == most) break;
  }
  return clean.substr(0, end);
}

void check(const OFCondition& condition, const std::string& doing) {
  if (condition.bad())
    throw Error(ExitStatus::fault, "cannot make a DICOM object: " + doing + ": " + condition.text());
}

void put(DcmItem& item, unsigned short group, unsigned short element, const std::string& value) {
  const DcmTag tag(group, element);
  check(item.putAndInsertString(tag, value.c_str()), DcmTag(tag).getTagName());
}

void put_code(DcmItem& item, unsigned short group, unsigned short element, const char* value,
              const char* scheme, const char* meaning) {
  DcmItem* code = nullptr;
  check(item.findOrCreateSequenceItem(DcmTagKey(group, element), code, -2), meaning);
  put(*code, 0x0008, 0x0100, value);
  put(*code, 0x0008, 0x0102, scheme);
  put(*code, 0x0008, 0x0104, meaning);
}

void put_references(DcmItem& item, unsigned short group, unsigned short element, const SourceStudy& source) {
  for (const auto& image : source.images()) {
    DcmItem* reference = nullptr;
    check(item.findOrCreateSequenceItem(DcmTagKey(group, element), reference, -2), "source images");
    put(*reference, 0x0008, 0x1150, image.sop_class_uid);
    put(*reference, 0x0008, 0x1155, image.sop_instance_uid);
  }
}

void put_referenced_series(DcmItem& dataset, const SourceStudy& source, const std::string& series_uid) {
  std::string last;
  DcmItem* series = nullptr;
  for (const auto& image : source.images()) {  // ordered by series
    if (!series_uid.empty() && image.series_uid != series_uid) continue;
    if (image.series_uid != last) {
      check(dataset.findOrCreateSequenceItem(DCM_ReferencedSeriesSequence, series, -2), "source series");
      put(*series, 0x0020, 0x000e, image.series_uid);
      last = image.series_uid;
    }
    DcmItem* reference = nullptr;
    check(series->findOrCreateSequenceItem(DCM_ReferencedInstanceSequence, reference, -2), "source image");
    put(*reference, 0x0008, 0x1150, image.sop_class_uid);
    put(*reference, 0x0008, 0x1155, image.sop_instance_uid);
  }
}

void put_identity(DcmItem& dataset, const SourceStudy& source, const ObjectName& name) {
  put(dataset, 0x0008, 0x0060, name.modality);
  put(dataset, 0x0020, 0x000e, stable_uid("series " + source.study_uid() + name.role));
  put(dataset, 0x0008, 0x0018,
      stable_uid("instance " + source.study_uid() + name.role + name.result + version()));
  put(dataset, 0x0020, 0x0011, std::to_string(name.series_number));
  put(dataset, 0x0020, 0x0013, "1");
  put(dataset, 0x0008, 0x103e, dicom_text(name.description, 64));
  put(dataset, 0x0008, 0x0070, manufacturer);
  put(dataset, 0x0008, 0x1090, model);
  put(dataset, 0x0018, 0x1000, serial_number);
  put(dataset, 0x0018, 0x1020, dicom_text(version(), 64));
  put(dataset, 0x0008, 0x0023, source.date());
  put(dataset, 0x0008, 0x0033, source.time());
  for (const auto& tag : {DCM_InstanceCreationDate, DCM_InstanceCreationTime, DCM_SeriesDate, DCM_SeriesTime,
                          DCM_InstanceCreatorUID, DCM_TimezoneOffsetFromUTC})
    delete dataset.remove(tag);
}

void put_common(DcmItem& dataset, const SourceStudy& source, const ObjectName& name) {
  DcmItem header(source.header());
  for (DcmObject* element = header.nextInContainer(nullptr); element != nullptr;
       element = header.nextInContainer(element))
    check(dataset.insert(static_cast<DcmElement*>(element->clone()), OFTrue), "patient and study");
  keep_character_set(dataset);
  put_identity(dataset, source, name);
}

std::string file_bytes(DcmDataset& dataset) {
  DcmFileFormat file(&dataset);
  check(file.validateMetaInfo(EXS_LittleEndianExplicit), "file header");
  check(file.getDataset()->chooseRepresentation(EXS_LittleEndianExplicit, nullptr), "transfer syntax");
  std::string bytes(
      static_cast<std::size_t>(file.calcElementLength(EXS_LittleEndianExplicit, EET_ExplicitLength)) + 65536,
      '\0');
  DcmOutputBufferStream stream(bytes.data(), static_cast<offile_off_t>(bytes.size()));
  file.transferInit();
  check(file.write(stream, EXS_LittleEndianExplicit, EET_ExplicitLength, nullptr), "writing");
  file.transferEnd();
  void* start = nullptr;
  offile_off_t length = 0;
  stream.flushBuffer(start, length);
  return {static_cast<const char*>(start), static_cast<std::size_t>(length)};
}

}  // namespace emmetrope::report
