#include "pipeline/cohort/results/cohort_rows.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <boost/algorithm/string/replace.hpp>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <iterator>
#include <set>
#include <sstream>

#include "pipeline/base/case_folder.hpp"
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
Json case_json_of(const CohortFolder& cohort, const std::string& subject) {
  const fs::path file = cohort.case_folder(subject) / "case.json";
  const bool is_of_this_run = has_come_to_its_end(cohort, subject, pipeline_stages.front().command);
  return is_of_this_run && fs::exists(file) ? read_json(file) : Json::object();
}

/// A table may be handed on: where it was made is nobody's business.
std::string in_the_case(const CohortFolder& cohort, const std::string& subject, std::string text) {
  boost::replace_all(text, cohort.case_folder(subject).string(), "the case");
  boost::replace_all(text, cohort.root().string() + "/", "");
  return text;
}

/// What the stages of a subject left, by the stage's command.
class Left {
 public:
  Left(const CohortFolder& cohort, const std::string& subject) {
    for (const PipelineStage& stage : pipeline_stages) {
      StageEnd& end = ends_[stage.command] = read_end(cohort, subject, stage.command);
      if (stage.command == std::string("report") || !end.status || !gave_result(*end.status)) continue;
      try {
        read_verdict(cohort.case_folder(subject), stage.folder);
      } catch (const Error& fault) {
        end = {static_cast<int>(fault.status()), in_the_case(cohort, subject, fault.what()) +
                                                     " (remove the case: the next run makes it again)"};
      }
    }
  }
  const StageEnd& end(const std::string& command) const { return ends_.at(command); }
  /// Whether a stage left what its folder holds; else it is of an earlier run, or somebody's.
  bool has_result(const std::string& folder) const {
    const StageEnd& of_stage = end(stage_of_folder(folder)->command);
    return of_stage.status && gave_result(*of_stage.status);
  }

 private:
  std::map<std::string, StageEnd> ends_;
};

void read_numbers(EyeRow& row, const CohortFolder& cohort, const Left& left) {
  const fs::path case_folder = cohort.case_folder(row.subject);
  std::map<fs::path, Json> files;
  for (const Quantity& quantity : quantities()) {
    if (!left.has_result(quantity.stage)) continue;
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

/// The stage that failed; else the first that gave less than all, of what concerns the eye.
void judge(EyeRow& row, const CohortFolder& cohort, const Left& left) {
  const bool has_refraction = row.numbers.count("refraction_m") > 0;
  row.outcome = has_refraction        ? Outcome::measured
                : row.numbers.empty() ? Outcome::no_result
                                      : Outcome::partial;
  for (const PipelineStage& stage : pipeline_stages) {
    const StageEnd& end = left.end(stage.command);
    if (!end.status || came_to_its_end(*end.status)) continue;
    if (row.outcome == Outcome::no_result || stage.command == std::string("report"))
      row.outcome = Outcome::failed;
    row.stage = stage.command;
    row.reason = one_line(said_of_eye(end.message, row.eye));
    return;
  }
  for (const PipelineStage& stage : pipeline_stages) {
    const StageEnd& end = left.end(stage.command);
    if (!end.status || *end.status == static_cast<int>(ExitStatus::done)) continue;
    const std::string reason = said_of_eye(end.message, row.eye);
    const bool is_of_the_other = has_refraction || (reason.empty() && !end.message.empty());
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

std::optional<double> told_age(const Json& plan) {
  const std::string told = plan.value("age", "");
  return told.empty() ? std::nullopt : std::optional(std::strtod(told.c_str(), nullptr));
}

/// \throw Error, Json::exception where a file is broken
std::vector<EyeRow> rows_of(const CohortFolder& cohort, const std::string& subject, const Json& plan) {
  const Left left(cohort, subject);
  const Json case_json = case_json_of(cohort, subject), who = case_json.value("subject", Json::object());
  EyeRow of_subject;
  of_subject.subject = subject;
  of_subject.told_age_years = told_age(plan);
  const Json age = who.value("age_years", Json());
  of_subject.age_years = age.is_number() ? std::optional(age.get<double>()) : of_subject.told_age_years;
  of_subject.told_sex = plan.value("sex", "");
  of_subject.sex = who.value("sex", "");
  const bool is_untold = of_subject.sex.empty() || of_subject.sex == "O";  // which anonymisers write
  if (is_untold && !of_subject.told_sex.empty()) of_subject.sex = of_subject.told_sex;
  of_subject.study = who.value("id", "");
  of_subject.scans = used_scans(case_json);
  std::vector<EyeRow> rows;
  for (const Laterality eye : eyes_asked_for(plan)) {
    EyeRow& row = rows.emplace_back(of_subject);
    row.eye = eye;
    read_numbers(row, cohort, left);
    judge(row, cohort, left);
  }
  return rows;
}

/// Of a subject whose files cannot be read.
std::vector<EyeRow> failed_rows(const std::string& subject, const Json& plan, const std::string& why) {
  std::vector<EyeRow> rows;
  for (const Laterality eye : eyes_asked_for(plan)) {
    EyeRow& row = rows.emplace_back();
    row.subject = subject;
    row.eye = eye;
    row.outcome = Outcome::failed;
    row.stage = "cohort-table";
    row.reason = one_line(why);
  }
  return rows;
}

/// A sentence of each subject whose rows the predicate has.
std::vector<std::string> of_subjects(const std::vector<EyeRow>& rows,
                                     const std::function<std::string(const EyeRow&)>& sentence_of) {
  std::vector<std::string> sentences;
  std::string before;
  for (const EyeRow& row : rows) {
    if (row.subject != before)
      if (std::string sentence = sentence_of(row); !sentence.empty())
        sentences.push_back(std::move(sentence));
    before = row.subject;
  }
  return sentences;
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
  const std::string plan = plan_hash(cohort, subject);
  return std::all_of(pipeline_stages.begin(), pipeline_stages.end(), [&](const PipelineStage& stage) {
    try {
      return read_end(cohort, subject, stage.command).plan == plan;
    } catch (const Error&) {  // not there, or broken
      return false;
    }
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
    std::vector<EyeRow> own;
    Json plan = Json::object();
    try {
      plan = plan_of(cohort, subject);
      own = rows_of(cohort, subject, plan);
    } catch (const std::exception& fault) {  // of a broken file, or of the file system
      own = failed_rows(subject, plan, in_the_case(cohort, subject, fault.what()));
    }
    std::move(own.begin(), own.end(), std::back_inserter(rows));
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
  return of_subjects(rows, [](const EyeRow& row) {
    if (row.told_sex.empty() || row.told_sex == row.sex) return std::string();
    return fmt::format(
        "{}: the images are of sex {}, by the table of participants it is {}: another person's images?",
        row.subject, row.sex, row.told_sex);
  });
}

std::vector<std::string> ages_that_differ(const std::vector<EyeRow>& rows) {
  return of_subjects(rows, [](const EyeRow& row) {
    if (!row.told_age_years || std::abs(*row.told_age_years - *row.age_years) <= rounding_of_age_years)
      return std::string();
    return fmt::format(
        "{}: the images tell an age of {:g}, the table of participants {:g}: another person's images?",
        row.subject, *row.age_years, *row.told_age_years);
  });
}

std::vector<std::string> studies_named_twice(const std::vector<EyeRow>& rows) {
  std::map<std::string, std::string> whose;
  return of_subjects(rows, [&](const EyeRow& row) {
    const auto& [first, is_new] = whose.emplace(row.study, row.subject);
    if (row.study.empty() || is_new) return std::string();
    return fmt::format(
        "{} and {} are images of one study, whose eyes count twice: is a study's folder given for "
        "one of studies?",
        first->second, row.subject);
  });
}

std::vector<std::string> doubts_about(const std::vector<EyeRow>& rows) {
  std::vector<std::string> sentences;
  for (const auto& doubts : {scans_named_twice, studies_named_twice, sexes_that_differ, ages_that_differ})
    for (std::string& sentence : doubts(rows)) sentences.push_back(std::move(sentence));
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

namespace {

/// "fit", "edges", or "fit+edges"; empty where no number tells.
std::string method_of(const EyeRow& row) {
  std::set<std::string> methods;
  for (const auto& [column, measured] : row.numbers)
    if (!measured.method.empty()) methods.insert(measured.method);
  return methods.size() > 1 ? "fit+edges" : methods.empty() ? "" : *methods.begin();
}

}  // namespace

std::string table_text(const std::vector<EyeRow>& rows) {
  std::string text = "participant_id\teye\toutcome\tstage\treason\tage\tsex\tmethod";
  for (const Quantity& quantity : quantities())
    text += fmt::format("\t{0}\t{0}_low\t{0}_high\t{0}_source", quantity.column);
  text += "\n";
  for (const EyeRow& row : rows) {
    text += fmt::format("{}\t{}\t{}\t{}\t{}\t{}\t{}\t{}", row.subject, to_string(row.eye),
                        to_string(row.outcome), cell_text(row.stage), cell_text(row.reason),
                        row.age_years ? number(*row.age_years) : not_available, cell_text(row.sex),
                        cell_text(method_of(row)));
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
      {"sex", {{"Levels", {{"M", "male"}, {"F", "female"}, {"O", "other"}}}}},
      {"method",
       {{"Description", "How the eye's images were read"},
        {"Levels",
         {{"fit", "by the fit of an eye to the voxels"},
          {"edges", "by a plain reading of edges, where the fit is withheld: wider intervals"},
          {"fit+edges", "some numbers by each"}}}}}};
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
