#include "segmentation/intake/subject.hpp"

#include <fmt/format.h>

#include "pipeline/base/files.hpp"
#include "segmentation/intake/tag_values.hpp"

namespace emmetrope::segmentation {
namespace {

/// A date YYYYMMDD in years.
std::optional<double> years_of(const std::string& date) {
  if (date.size() != 8) return {};
  const auto year = parse_number(date.substr(0, 4)), month = parse_number(date.substr(4, 2)),
             day = parse_number(date.substr(6));
  if (!year || !month || !day) return {};
  return *year + (*month - 1) / 12 + (*day - 1) / 365.25;
}

/// PatientAge, an Age String (PS3.5 6.2): "026Y", "018M", "012W", "100D".
std::optional<double> age_of(const std::string& text) {
  if (text.size() != 4) return {};
  const auto number = parse_number(text.substr(0, 3));
  if (!number || *number < 0) return {};
  switch (text[3]) {
    case 'Y':
      return *number;
    case 'M':
      return *number / 12;
    case 'W':
      return *number * 7 / 365.25;
    case 'D':
      return *number / 365.25;
    default:
      return {};
  }
}

std::optional<double> age_of(const ImageHeader& header) {
  if (const auto age = age_of(header.value(tag::patient_age))) return age;
  const auto born = years_of(header.value(tag::patient_birth_date)),
             studied = years_of(header.value(tag::study_date));
  if (!born || !studied || *studied < *born) return {};
  return std::floor(*studied - *born);
}

}  // namespace

void Patients::compare(const Tag& tag, Found& first, const ScannedFile& file) {
  const auto& value = file.header.value(tag);
  if (value.empty()) return;
  if (first.value.empty()) first = {file.name(), value};
  if (value != first.value && conflict_.empty())
    conflict_ = fmt::format("{} and {} are of two patients: {} differs; give the study of one patient",
                            first.file, file.name(), to_string(tag));
}

void Patients::add(const ScannedFile& file) {
  const ImageHeader& header = file.header;
  compare(tag::patient_id, first_id_, file);
  // One name may be written in several ways, so it counts only where nothing better is there.
  if (!header.has(tag::patient_id)) compare(tag::patient_name, first_name_, file);
  compare(tag::patient_birth_date, first_birth_date_, file);
  if (described_) return;
  described_ = true;
  // Without PatientID: a short number could be found again by trying them all.
  if (header.has(tag::study_instance))
    subject_.id = sha256_of(header.value(tag::study_instance)).substr(0, 16);
  subject_.age_years = age_of(header);
  const auto& sex = header.value(tag::patient_sex);
  subject_.sex = sex == "M" || sex == "F" || sex == "O" ? sex : "";
}

std::string Patients::conflict() const { return conflict_; }
Subject Patients::subject() const { return subject_; }

}  // namespace emmetrope::segmentation
