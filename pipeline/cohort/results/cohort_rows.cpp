#include "pipeline/cohort/results/cohort_rows.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <sstream>

#include "pipeline/base/case_scans.hpp"
#include "pipeline/base/case_subject.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/stages.hpp"
#include "pipeline/cohort/results/quantities.hpp"
#include "pipeline/cohort/subjects/stage_end.hpp"
#include "pipeline/cohort/subjects/table.hpp"
#include "pipeline/report/content/first_page.hpp"

namespace emmetrope::cohort {
namespace {

namespace fs = std::filesystem;

/// An empty object where segmentation left none.
Json case_json_of(const fs::path& case_folder) {
  const fs::path file = case_folder / "case.json";
  return fs::exists(file) ? read_json(file) : Json::object();
}

/// Whether a stage left what its folder holds; else it is of an earlier run.
bool has_result(const CohortFolder& cohort, const std::string& subject, const std::string& folder) {
  const StageEnd end = read_end(cohort, subject, stage_of_folder(folder)->command);
  return end.status && gave_result(*end.status);
}

void read_numbers(EyeRow& row, const CohortFolder& cohort) {
  const fs::path case_folder = cohort.case_folder(row.subject);
  std::map<std::string, bool> is_made;
  std::map<fs::path, Json> files;
  for (const Quantity& quantity : quantities()) {
    if (is_made.count(quantity.stage) == 0)
      is_made[quantity.stage] = has_result(cohort, row.subject, quantity.stage);
    if (!is_made.at(quantity.stage)) continue;
    const fs::path file = case_folder / quantity.stage / to_string(row.eye) / quantity.file;
    if (files.count(file) == 0) files[file] = fs::exists(file) ? read_json(file) : Json();
    const Json& json = files.at(file);
    const Json::json_pointer at(quantity.key);
    if (!json.is_object() || !json.contains(at) || is_withheld(json.at(at))) continue;
    row.numbers[quantity.column] = json.at(at).get<Measured>();
    if (quantity.column == "flat_axis" &&
        !report::has_axis(json.value(Json::json_pointer("/keratometry/cylinder_D"), Json())))
      row.numbers.erase(quantity.column);
  }
}

/// Of lines such as "OD (right): the reason" the reasons of this eye and those of none.
std::string said_of_eye(const std::string& message, Laterality eye) {
  const std::string own = std::string(clinical_name(eye)) + ": ";
  const std::string other = clinical_name(eye == Laterality::od ? Laterality::os : Laterality::od);
  std::istringstream lines(message);
  std::string said;
  for (std::string line; std::getline(lines, line);)
    if (line.rfind(other, 0) != 0)
      said += (said.empty() ? "" : "; ") + (line.rfind(own, 0) == 0 ? line.substr(own.size()) : line);
  return said;
}

/// That a refraction is no prescription, which is less than all, or an estimate that is not to be dispensed, which most
/// are: where the reason for the latter were a stage's, what failed would drown in it.
void note_reservation_about_refraction(EyeRow& row, const CohortFolder& cohort) {
  const fs::path file =
      cohort.case_folder(row.subject) / "correction" / to_string(row.eye) / "prescription.json";
  if (row.numbers.count("refraction_m") == 0 || !fs::exists(file)) return;
  const Json prescription = read_json(file);
  const Json withheld = prescription.value("withheld", Json()),
             estimate = prescription.value("estimate", Json());
  if (withheld.is_string()) {
    row.stage = "correct";
    row.reason = one_line("no prescription: " + withheld.get<std::string>());
  } else if (estimate.is_string()) {
    row.reason = one_line(estimate.get<std::string>());
  }
}

/// The first stage that gave less than all, of what concerns the eye.
void judge(EyeRow& row, const CohortFolder& cohort) {
  const bool has_refraction = row.numbers.count("refraction_m") > 0;
  row.outcome = has_refraction        ? Outcome::measured
                : row.numbers.empty() ? Outcome::no_result
                                      : Outcome::partial;
  for (const PipelineStage& stage : pipeline_stages) {
    const StageEnd end = read_end(cohort, row.subject, stage.command);
    if (!end.status || *end.status == static_cast<int>(ExitStatus::done)) continue;
    const bool is_result = *end.status == static_cast<int>(ExitStatus::partial) ||
                           *end.status == static_cast<int>(ExitStatus::no_result);
    if (!is_result && (row.outcome == Outcome::no_result || stage.command == std::string("report")))
      row.outcome = Outcome::failed;
    const std::string reason = said_of_eye(end.message, row.eye);
    const bool is_of_the_other = is_result && (has_refraction || (reason.empty() && !end.message.empty()));
    if (is_of_the_other) continue;
    row.stage = stage.command;
    row.reason = one_line(reason);
    return;
  }
  note_reservation_about_refraction(row, cohort);
}

/// What is to be done for a subject; an empty object where nobody says.
Json plan_of(const CohortFolder& cohort, const std::string& subject) {
  const fs::path file = cohort.subject_file(subject);
  return fs::exists(file) ? read_json(file) : Json::object();
}

std::vector<Laterality> eyes_asked_for(const Json& plan) {
  const std::string asked = plan.value("eyes", "both");
  if (asked == "od") return {Laterality::od};
  if (asked == "os") return {Laterality::os};
  return {both_eyes.begin(), both_eyes.end()};
}

/// At the examination, as the images say, else as the table of participants does.
std::optional<double> age_of(const fs::path& case_folder, const Json& plan) {
  if (const std::optional<double> age_years = subject_age_years(case_folder)) return age_years;
  const std::string told = plan.value("age", "");
  return told.empty() ? std::nullopt : std::optional(std::strtod(told.c_str(), nullptr));
}

std::string number(double value) { return fmt::format("{:.6g}", value); }

}  // namespace

const char* to_string(Outcome outcome) {
  switch (outcome) {
    case Outcome::measured:
      return "measured";
    case Outcome::partial:
      return "partial";
    case Outcome::no_result:
      return "no_result";
    default:
      return "failed";
  }
}

bool is_finished(const CohortFolder& cohort, const std::string& subject) {
  return std::all_of(pipeline_stages.begin(), pipeline_stages.end(), [&](const PipelineStage& stage) {
    return fs::exists(cohort.end_file(subject, stage.command));
  });
}

std::vector<std::string> listed_subjects(const CohortFolder& cohort) {
  std::istringstream lines(read_file(cohort.root() / "subjects.txt"));
  std::vector<std::string> subjects;
  for (std::string subject; std::getline(lines, subject);) subjects.push_back(subject);
  return subjects;
}

std::vector<EyeRow> read_rows(const CohortFolder& cohort, const std::vector<std::string>& subjects) {
  std::vector<EyeRow> rows;
  for (const std::string& subject : subjects) {
    const fs::path case_folder = cohort.case_folder(subject);
    const Json plan = plan_of(cohort, subject);
    const std::optional<double> age_years = age_of(case_folder, plan);
    const std::string told_sex = plan.value("sex", "");
    try {
      const Json case_json = case_json_of(case_folder);
      const std::string sex = case_json.value("subject", Json::object()).value("sex", "");
      const std::set<std::string> scans = used_scans(case_json);
      for (const Laterality eye : eyes_asked_for(plan)) {
        EyeRow& row = rows.emplace_back();
        row.subject = subject;
        row.eye = eye;
        row.age_years = age_years;
        row.sex = sex.empty() ? told_sex : sex;
        row.told_sex = told_sex;
        row.scans = scans;
        read_numbers(row, cohort);
        judge(row, cohort);
      }
    } catch (const Json::exception& fault) {
      throw input_error(case_folder.string() + ": " + fault.what(), "run emmetrope cohort --force");
    }
  }
  return rows;
}

std::vector<std::pair<const EyeRow*, const EyeRow*>> fellow_eyes(const std::vector<EyeRow>& rows) {
  std::vector<std::pair<const EyeRow*, const EyeRow*>> fellows;
  for (std::size_t i = 1; i < rows.size(); ++i) {
    const EyeRow &right = rows[i - 1], &left = rows[i];
    if (right.subject == left.subject && right.eye == Laterality::od && left.eye == Laterality::os)
      fellows.emplace_back(&right, &left);
  }
  return fellows;
}

std::vector<std::string> scans_named_twice(const std::vector<EyeRow>& rows) {
  std::vector<std::string> sentences;
  std::map<std::pair<Laterality, std::string>, const EyeRow*> whose;
  for (const EyeRow& row : rows) {
    if (row.numbers.empty()) continue;
    std::string numbers;
    for (const auto& [column, measured] : row.numbers)
      numbers += fmt::format(" {} {} {} {}", column, measured.value, measured.ci95[0], measured.ci95[1]);
    const auto before = [&](const std::string& told) {
      const EyeRow* first = whose.emplace(std::pair(row.eye, told), &row).first->second;
      return first == &row ? nullptr : first;
    };
    const EyeRow *of_numbers = before(numbers), *of_voxels = nullptr;
    for (const std::string& scan : row.scans)
      if (const EyeRow* first = before(scan)) of_voxels = first;
    if (of_voxels || of_numbers)
      sentences.push_back(
          fmt::format("{} of {} and of {} have {}: one scan under two names?", clinical_name(row.eye),
                      (of_voxels ? of_voxels : of_numbers)->subject, row.subject,
                      of_voxels ? "images with the same voxels" : "the same numbers to the last digit"));
  }
  return sentences;
}

std::vector<std::string> sexes_that_differ(const std::vector<EyeRow>& rows) {
  std::vector<std::string> sentences;
  std::string before;
  for (const EyeRow& row : rows) {
    const bool is_told_by_both = !row.told_sex.empty() && row.sex != "O";  // which anonymisers write
    if (row.subject != before && is_told_by_both && row.told_sex != row.sex)
      sentences.push_back(fmt::format(
          "{}: the images are of sex {}, by the table of participants it is {}: another person's images?",
          row.subject, row.sex, row.told_sex));
    before = row.subject;
  }
  return sentences;
}

std::vector<std::string> doubts_about(const std::vector<EyeRow>& rows) {
  std::vector<std::string> sentences = scans_named_twice(rows);
  for (std::string& sentence : sexes_that_differ(rows)) sentences.push_back(std::move(sentence));
  return sentences;
}

Outcomes count_outcomes(const std::vector<EyeRow>& rows) {
  const auto count = [&](Outcome outcome) {
    return static_cast<std::size_t>(
        std::count_if(rows.begin(), rows.end(), [&](const EyeRow& row) { return row.outcome == outcome; }));
  };
  return {count(Outcome::measured), count(Outcome::partial), count(Outcome::no_result),
          count(Outcome::failed)};
}

std::string table_text(const std::vector<EyeRow>& rows) {
  std::string text = "participant_id\teye\toutcome\tstage\treason\tage\tsex";
  for (const Quantity& quantity : quantities())
    text += fmt::format("\t{0}\t{0}_low\t{0}_high\t{0}_source", quantity.column);
  text += "\n";
  for (const EyeRow& row : rows) {
    text += fmt::format("{}\t{}\t{}\t{}\t{}\t{}\t{}", row.subject, to_string(row.eye), to_string(row.outcome),
                        cell_text(row.stage), cell_text(row.reason),
                        row.age_years ? number(*row.age_years) : not_available, cell_text(row.sex));
    for (const Quantity& quantity : quantities()) {
      if (const auto found = row.numbers.find(quantity.column); found != row.numbers.end()) {
        const Measured& measured = found->second;
        text += fmt::format("\t{}\t{}\t{}\t{}", number(measured.value), number(measured.ci95[0]),
                            number(measured.ci95[1]), measured.source);
      } else {
        for (int i = 0; i < 4; ++i) text += std::string("\t") + not_available;
      }
    }
    text += "\n";
  }
  return text;
}

Json table_dictionary() {
  Json dictionary{
      {"participant_id", {{"Description", "The study's folder, or sub-X[_ses-Y] of a BIDS dataset"}}},
      {"eye", {{"Levels", {{"od", "right"}, {"os", "left"}}}}},
      {"outcome",
       {{"Levels",
         {{"measured",
           "with a refraction; no prescription, or an estimate that is not to be dispensed, where a reason says so"},
          {"partial", "some of the numbers; the others are n/a"},
          {"no_result", "the images do not support any number"},
          {"failed", "the study could not be read, or the machine failed"}}}}},
      {"stage", {{"Description", "The command that gave less than all"}}},
      {"reason", {{"Description", "Why"}}},
      {"age", {{"Description", "At the examination"}, {"Units", "year"}}},
      {"sex", {{"Levels", {{"M", "male"}, {"F", "female"}, {"O", "other"}}}}}};
  for (const Quantity& quantity : quantities()) {
    Json& value = dictionary[quantity.column];
    value = {{"Description", quantity.description}};
    const auto with_unit = [&](Json column) {
      if (!quantity.unit.empty()) column["Units"] = quantity.unit;
      return column;
    };
    value = with_unit(value);
    dictionary[quantity.column + "_low"] =
        with_unit({{"Description", "Lower end of the 95 % interval of " + quantity.column}});
    dictionary[quantity.column + "_high"] =
        with_unit({{"Description", "Upper end of the 95 % interval of " + quantity.column}});
    dictionary[quantity.column + "_source"] = {
        {"Description",
         "Where " + quantity.column + " comes from: mri, mri+prior, prior, labels, keratometry, ..."}};
  }
  return dictionary;
}

}  // namespace emmetrope::cohort
