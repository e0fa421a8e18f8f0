#include "segmentation/intake/subject.hpp"

#include <fmt/format.h>

#include "pipeline/base/files.hpp"
#include "segmentation/intake/plausible.hpp"
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

std::optional<double> age_of(const ImageHeader& header) {
  if (const auto age = parse_age_years(header.value(tag::patient_age))) return age;
  const auto born = years_of(header.value(tag::patient_birth_date)),
             studied = years_of(header.value(tag::study_date));
  if (!born || !studied || *studied < *born || *studied - *born >= largest_age_years) return {};
  return std::floor(*studied - *born);
}

}  // namespace

std::optional<double> parse_age_years(const std::string& text) {
  if (text.size() != 4) return {};
  const auto number = parse_number(text.substr(0, 3));
  const double in_years = text[3] == 'Y'   ? 1
                          : text[3] == 'M' ? 1.0 / 12
                          : text[3] == 'W' ? 7 / 365.25
                          : text[3] == 'D' ? 1 / 365.25
                                           : -1;
  if (!number || *number < 0 || in_years < 0 || *number * in_years >= largest_age_years) return {};
  return *number * in_years;
}

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
  // One name may be written in several ways, so it counts only where a file has nothing better.
  lacks_id_ = lacks_id_ || !header.has(tag::patient_id);
  if (lacks_id_)
    compare(tag::patient_name, first_name_, file);
  else if (first_name_.value.empty())
    first_name_ = {file.name(), header.value(tag::patient_name)};
  compare(tag::patient_birth_date, first_birth_date_, file);
  const auto& study = header.value(tag::study_instance);
  Subject& subject = subjects_[study];
  // Without PatientID: a short number could be found again by trying them all.
  if (!study.empty() && subject.id.empty()) subject.id = sha256_of(study).substr(0, 16);
  if (!subject.age_years) subject.age_years = age_of(header);
  const auto& sex = header.value(tag::patient_sex);
  if (sex == "M" || sex == "F" || sex == "O") subject.sex = sex;
}

std::string Patients::conflict() const { return conflict_; }
std::map<std::string, Subject> Patients::subjects() const { return subjects_; }

}  // namespace emmetrope::segmentation
