#include "pipeline/report/dicom/deidentify_command.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <memory>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/scratch_folder.hpp"
#include "pipeline/report/case/case_data.hpp"
#include "pipeline/report/content/content.hpp"
#include "pipeline/report/dicom/object.hpp"
#include "pipeline/report/dicom/write_objects.hpp"
#include "pipeline/report/pdf/pdf.hpp"

namespace emmetrope::report {
namespace {

namespace fs = std::filesystem;

constexpr const char* left_out = "A remark, left out here as it may quote the study's headers";

/// As it is typed.
struct DeidentifyFlags {
  fs::path case_folder, output;
  std::string subject;
  bool keeps_age = false;
};

/// Empty where objects can carry it as it is.
std::string patient_id(const std::string& text) {
  const bool is_one =
      !text.empty() && text.front() != ' ' && text.back() != ' ' && dicom_text(text, most_patient_id) == text;
  return is_one ? ""
                : fmt::format(
                      "\"{}\" cannot be a PatientID: give 1 to {} characters, without \\, control characters "
                      "and spaces at the ends",
                      text, most_patient_id);
}

/// That there was a warning or a reason, and of which eye: the words themselves may quote the study's headers.
std::string without_words(const std::string& text) {
  for (const Laterality eye : both_eyes)
    if (const std::string name = std::string(clinical_name(eye)) + ": "; text.rfind(name, 0) == 0)
      return name + left_out;
  return left_out;
}

/// The case without what the profile takes away and the pages would tell: dates, texts of the study's headers (in
/// descriptions, warnings and reasons), digests of its files, age and sex, and what follows from age: the lens index and
/// normal ranges.
CaseData without_identity(CaseData data, const DeidentifyFlags& flags) {
  Json& json = data.case_json;
  for (const char* key : {"study_date", "date", "study"}) json.erase(key);
  if (json.contains("series"))
    for (Json& series : json["series"])
      if (series.is_object()) series.erase("description");
  if (json.contains("stacks"))
    for (Json& stack : json["stacks"])
      if (stack.is_object()) stack.erase("reason");
  for (StageData& stage : data.stages) {
    for (std::string& warning : stage.warnings) warning = without_words(warning);
    for (std::string& reason : stage.reasons) reason = without_words(reason);
    stage.provenance.erase("inputs_sha256");
    if (!flags.keeps_age && stage.provenance.contains("parameters"))
      for (const char* key : {"age_years", "age_given_years"}) stage.provenance["parameters"].erase(key);
  }
  if (!flags.keeps_age)
    for (EyeData& eye : data.eyes) {
      if (const auto lens = "/eye/media/lens"_json_pointer;
          eye.optics.is_object() && eye.optics.contains(lens))
        eye.optics[lens].erase("index");
      eye.traced = Json();
      if (eye.prescription.is_object() && eye.prescription.contains("calibration"))
        for (const char* key : {"lens_index_before", "lens_index_after", "text"})
          eye.prescription["calibration"].erase(key);
    }
  data.has_normal_ranges = flags.keeps_age;
  Json subject;
  subject["id"] = flags.subject.empty() ? data.subject() : flags.subject;
  if (flags.keeps_age)
    for (const char* key : {"age_years", "sex"})
      if (const Json known = json.value("subject", Json::object()).value(key, Json()); !known.is_null())
        subject[key] = known;
  json["subject"] = subject;
  return data;
}

/// \param study  tells this study from another of a subject of the same name
Deidentified header_of(const CaseData& data, const std::string& study, const DeidentifyFlags& flags) {
  const Json subject = data.case_json.at("subject");
  Deidentified header{data.subject(), study, {}, {}};
  if (flags.keeps_age) {
    if (const auto age_years = value_of(subject, "age_years"))
      header.age = fmt::format("{:03d}Y", static_cast<int>(*age_years));
    header.sex = subject.value("sex", std::string());
  }
  return header;
}

Answer deidentify(DeidentifyFlags flags, const CommonOptions& common) {
  if (flags.case_folder.empty())
    throw usage_error("the case folder is missing", "name it: emmetrope deidentify CASE");
  if (flags.output.empty()) flags.output = flags.case_folder / "deidentified";
  if (fs::exists(flags.output) && (!fs::is_directory(flags.output) || !fs::is_empty(flags.output)))
    throw usage_error("-o: " + flags.output.string() + " is there and no empty folder",
                      "name a new folder: what lies there may tell what this leaves out");
  quiet_dicom_library();
  const CaseData whole = read_case(flags.case_folder, common.laterality);
  const std::string study = sha256_of(whole.subject() + sha256_of_file(flags.case_folder / "case.json"));
  const CaseData data = without_identity(whole, flags);
  const SourceStudy source = SourceStudy::deidentified(header_of(data, study, flags));
  Notes notes;
  const Pdf pdf = render_pdf(make_document(data, {}, notes));
  // Beside the folder that is wanted, whose place it takes when it is whole.
  const fs::path wanted = flags.output.has_filename() ? flags.output : flags.output.parent_path();
  const ScratchFolder scratch(wanted.string() + ".writing-" + std::to_string(::getpid()));
  write_objects(scratch.path(), data, source, pdf.bytes, false, notes);
  fs::rename(scratch.path(), wanted);
  Json files = Json::array();
  for (const auto& entry : fs::recursive_directory_iterator(flags.output))
    if (entry.is_regular_file()) files.push_back(fs::relative(entry.path(), flags.output).string());
  std::sort(files.begin(), files.end());
  return {
      ExitStatus::done,
      {{"folder", flags.output.string()}, {"files", files}, {"subject", data.subject()}, {"notes", notes}},
      fmt::format("{} files in {}\n", files.size(), flags.output.string())};
}

}  // namespace

Command deidentify_command() {
  const auto flags = std::make_shared<DeidentifyFlags>();
  Command command;
  command.name = "deidentify";
  command.summary =
      "A case's DICOM objects without identity: PS3.15 Basic Application Level Confidentiality Profile, with "
      "clean descriptors and structured content.";
  command.example = "emmetrope deidentify CASE -o OUT";
  command.declare = [flags](CLI::App& app) {
    app.add_option("CASE", flags->case_folder, "Case folder");
    app.add_option("-o,--output", flags->output, "Folder to make (CASE/deidentified)")->type_name("FOLDER");
    app.add_option(
           "--subject", flags->subject,
           "PatientID and PatientName instead of the case's pseudonym, which an archive can find again")
        ->check(patient_id);
    app.add_flag("--keep-age", flags->keeps_age, "Age and sex stay (Retain Patient Characteristics option)");
  };
  command.run = [flags](const CommonOptions& common) { return deidentify(*flags, common); };
  return command;
}

}  // namespace emmetrope::report
