#include "segmentation/intake/subject.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <boost/algorithm/string.hpp>
#include <boost/date_time/gregorian/gregorian.hpp>
#include <cmath>
#include <iterator>
#include <set>

#include "pipeline/base/files.hpp"
#include "pipeline/base/iso_date.hpp"
#include "segmentation/intake/plausible.hpp"
#include "segmentation/intake/tag_values.hpp"

namespace emmetrope::segmentation {
namespace {

/// By less an age agrees with dates of which the year alone is told, as 1 January.
constexpr double largest_contradiction_years = 2;
/// Ages within a series: it may run into a birthday.
constexpr double same_age_years = 1;
/// A series acquired by more before or after the date of its study is another visit's, or the date is not its own.
constexpr double same_visit_years = 1;

/// A date YYYYMMDD in years.
std::optional<double> years_of(const std::string& date) {
  if (date.size() != 8) return {};
  const auto year = parse_number(date.substr(0, 4)), month = parse_number(date.substr(4, 2)),
             day = parse_number(date.substr(6));
  if (!year || !month || !day) return {};
  return *year + (*month - 1) / 12 + (*day - 1) / 365.25;
}

/// From the date of birth to that of the study; of a person or not.
std::optional<double> years_by_dates(const ImageHeader& header) {
  const auto born = years_of(header.value(tag::patient_birth_date)),
             studied = years_of(header.value(tag::study_date));
  if (!born || !studied) return {};
  return *studied - *born;
}

std::optional<double> age_by_dates(const ImageHeader& header) {
  const auto years = years_by_dates(header);
  return years && is_plausible_age(*years) ? years : std::nullopt;
}

std::optional<double> age_of(const ImageHeader& header) {
  if (const auto age = parse_age_years(header.value(tag::patient_age))) return age;
  const auto by_dates = age_by_dates(header);
  return by_dates ? std::optional(std::floor(*by_dates)) : std::nullopt;
}

/// What is wrong with the age, if anything; the dates, which identify, are not told.
std::string oddity_of_age(const ScannedFile& file) {
  const ImageHeader& header = file.header;
  const std::string dates =
      fmt::format("{} and {}", to_string(tag::patient_birth_date), to_string(tag::study_date));
  const auto told = parse_age_years(header.value(tag::patient_age)), by_dates = age_by_dates(header);
  if (!told && !by_dates && years_by_dates(header))
    return fmt::format(
        "{}: by {} the patient is not above 0 and at most {:g} years old; no age is taken from them, --age gives it",
        file.name(), dates, human_age_years.high);
  // Those who take identity off write 89 or 90 for everybody older.
  const bool is_capped = told && by_dates && (*told == 89 || *told == 90) && *by_dates > *told;
  if (told && by_dates && !is_capped && std::abs(*told - *by_dates) > largest_contradiction_years)
    return fmt::format("{}: {} contradicts {} by more than {:g} years; {} is used", file.name(),
                       to_string(tag::patient_age), dates, largest_contradiction_years,
                       to_string(tag::patient_age));
  return {};
}

/// Anonymisers and archives may write a date of their own into the study alone.
std::string oddity_of_date(const ScannedFile& file) {
  const auto studied = years_of(file.header.value(tag::study_date));
  for (const Tag& tag : {tag::acquisition_date, tag::series_date})
    if (const auto other = years_of(file.header.value(tag));
        studied && other && std::abs(*studied - *other) > same_visit_years)
      return fmt::format(
          "{}: {} contradicts {} by more than {:g} year; reports, and an age by dates, have the first",
          file.name(), to_string(tag::study_date), to_string(tag), same_visit_years);
  return {};
}

/// Two spellings of a person's name share a part; of another script nothing can be said.
bool names_differ(const std::string& one, const std::string& other) {
  const auto parts_of = [](const std::string& name) {
    std::set<std::string> parts;
    boost::algorithm::split(parts, boost::algorithm::to_upper_copy(name.substr(0, name.find('='))),
                            boost::algorithm::is_any_of("^ ,.-"));
    parts.erase("");
    return parts;
  };
  const auto is_latin = [](const std::string& name) {
    return std::all_of(name.begin(), name.end(), [](unsigned char c) { return c < 0x80; });
  };
  std::vector<std::string> shared;
  const auto a = parts_of(one), b = parts_of(other);
  std::set_intersection(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(shared));
  return is_latin(one) && is_latin(other) && !a.empty() && !b.empty() && shared.empty();
}

bool values_differ(const Tag& tag, const std::string& one, const std::string& other) {
  if (std::string_view(tag.keyword) == tag::patient_name.keyword) return names_differ(one, other);
  if (std::string_view(tag.keyword) != tag::patient_age.keyword) return one != other;
  const auto a = parse_age_years(one), b = parse_age_years(other);
  return a && b && std::abs(*a - *b) > same_age_years;
}

/// Past midnight some scanners write the next day.
bool are_days_apart(const std::string& one, const std::string& other) {
  return std::abs((boost::gregorian::from_string(one) - boost::gregorian::from_string(other)).days()) > 1;
}

/// What a value says of a visit: a date as ISO 8601 writes it, F or M (O is also for what is not known), an age; or nothing.
std::string said_of_visit(const Tag& tag, const std::string& value) {
  const std::string_view keyword = tag.keyword;
  if (keyword == tag::study_date.keyword) return iso_date(value);
  if (keyword == tag::patient_sex.keyword) return value == "F" || value == "M" ? value : "";
  return parse_age_years(value) ? value : "";
}

/// By which series of one study are told apart.
constexpr Tag of_contradictions[] = {tag::patient_sex, tag::patient_age, tag::study_date};

/// What a person has one of at a visit.
constexpr Tag of_one_visit[] = {tag::patient_sex, tag::patient_age, tag::issuer_of_patient_id,
                                tag::study_date, tag::patient_name};

}  // namespace

std::optional<double> parse_age_years(const std::string& text) {
  if (text.size() != 4) return {};
  const auto number = parse_number(text.substr(0, 3));
  const double in_years = text[3] == 'Y'   ? 1
                          : text[3] == 'M' ? 1.0 / 12
                          : text[3] == 'W' ? 7 / 365.25
                          : text[3] == 'D' ? 1 / 365.25
                                           : 0;
  if (!number || !is_plausible_age(*number * in_years)) return {};
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

void Patients::compare_within_series(const ScannedFile& file) {
  OfSeries& series = series_[file.header.value(tag::series_instance)];
  if (const std::string warning = oddity_of_age(file); !warning.empty())
    series.warnings.emplace("age", warning);
  if (const std::string warning = oddity_of_date(file); !warning.empty())
    series.warnings.emplace("date", warning);
  for (const Tag& tag : of_one_visit) {
    const auto& value = file.header.value(tag);
    if (value.empty()) continue;
    const Found& first = series.first.try_emplace(tag.keyword, Found{file.name(), value}).first->second;
    if (values_differ(tag, first.value, value))
      series.warnings.emplace(
          tag.keyword,
          fmt::format(
              "{} and {}: {} differs within the series; where it is of two patients or visits, give one",
              first.file, file.name(), to_string(tag)));
  }
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
  compare_within_series(file);
  const auto& study = header.value(tag::study_instance);
  Subject& subject = subjects_[study];
  // Without PatientID: a short number could be found again by trying them all.
  if (const auto& uid = study.empty() ? header.value(tag::series_instance) : study;
      !uid.empty() && subject.id.empty())
    subject.id = sha256_of(uid).substr(0, 16);
  if (!subject.age_years) subject.age_years = age_of(header);
  const auto& sex = header.value(tag::patient_sex);
  if (subject.sex.empty() && (sex == "M" || sex == "F" || sex == "O")) subject.sex = sex;
}

std::string Patients::conflict() const { return conflict_; }
std::vector<std::string> Patients::warnings(const std::string& series_uid) const {
  std::vector<std::string> texts;
  if (const auto found = series_.find(series_uid); found != series_.end())
    for (const auto& [subject, text] : found->second.warnings) texts.push_back(text);
  return texts;
}
std::map<std::string, Subject> Patients::subjects() const { return subjects_; }
std::map<std::string, TagValues> Patients::visits() const {
  std::map<std::string, TagValues> visits;
  for (const auto& [uid, series] : series_)
    for (const Tag& tag : of_contradictions)
      if (const auto found = series.first.find(tag.keyword); found != series.first.end())
        if (std::string said = said_of_visit(tag, found->second.value); !said.empty())
          visits[uid][tag.keyword] = std::move(said);
  return visits;
}

std::string contradiction(const TagValues& one, const TagValues& other) {
  for (const Tag& tag : of_contradictions) {
    const auto a = one.find(tag.keyword), b = other.find(tag.keyword);
    if (a == one.end() || b == other.end() || a->second == b->second) continue;
    const bool is_date = std::string_view(tag.keyword) == tag::study_date.keyword;
    if (is_date ? are_days_apart(a->second, b->second) : values_differ(tag, a->second, b->second))
      return to_string(tag);
  }
  return {};
}

}  // namespace emmetrope::segmentation
