#pragma once
#include <string>

#include "pipeline/report/dicom/source_study.hpp"

class DcmDataset;
class DcmItem;
class OFCondition;

/// What all DICOM objects of the report share. For the .cpp files of this folder only.
namespace emmetrope::report {

/// "2.25." and the decimal form of a UUID made from the text's SHA-256: the same text gives the same UID, so
/// that a second run replaces an object instead of adding one.
std::string stable_uid(const std::string& text);

/// Text for a short attribute: UTF-8, no control characters, no backslash, at most `most` characters.
std::string dicom_text(const std::string& text, std::size_t most);
/// Of a PatientID (VR LO), and of each part of a name.
inline constexpr std::size_t most_patient_id = 64;

/// How one object is named in its study.
struct ObjectName {
  std::string role;  ///< "report": decides its series and instance UIDs
  std::string modality;
  std::string description;  ///< SeriesDescription
  int series_number = 9000;
  std::string result;  ///< hash of the result that the object tells
};

/// Patient, study, series, equipment and SOP common attributes. Dates are the study's, so that the same case
/// gives the same bytes.
void put_common(DcmItem& dataset, const SourceStudy& source, const ObjectName& name);
/// Series, equipment, UIDs and dates alone: for datasets that a DCMTK class has filled with UIDs and dates of
/// its own.
void put_identity(DcmItem& dataset, const SourceStudy& source, const ObjectName& name);
void put(DcmItem& item, unsigned short group, unsigned short element, const std::string& value);
/// Scheme of codes that no standard has.
inline constexpr const char* own_scheme = "99EMMETROPE";
/// A sequence with one coded entry.
void put_code(DcmItem& item, unsigned short group, unsigned short element, const char* value,
              const char* scheme, const char* meaning);
/// (SOP class, SOP instance) of every source image in a sequence.
void put_references(DcmItem& item, unsigned short group, unsigned short element, const SourceStudy& source);

/// Common Instance Reference module: every source image, by series.
/// \param series_uid  of this series only; empty: of all
void put_referenced_series(DcmItem& dataset, const SourceStudy& source, const std::string& series_uid);

/// A Part 10 file in memory, explicit little endian.
std::string file_bytes(DcmDataset& dataset);

/// \throw Error (fault) naming what was being done
void check(const OFCondition& condition, const std::string& doing);

/// Equipment of every object.
inline constexpr const char* manufacturer = "Emmetrope project";
inline constexpr const char* model = "Emmetrope";
inline constexpr const char* serial_number = "0";

}  // namespace emmetrope::report
