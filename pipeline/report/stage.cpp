#include "pipeline/report/stage.hpp"

#include "pipeline/base/case_folder.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/process.hpp"
#include "pipeline/report/case/case_data.hpp"
#include "pipeline/report/content/content.hpp"
#include "pipeline/report/dicom/write_objects.hpp"
#include "pipeline/report/living/case_eyes.hpp"
#include "pipeline/report/page/html.hpp"
#include "pipeline/report/page/viewer.hpp"
#include "pipeline/report/pdf/pdf.hpp"

namespace emmetrope::report {
namespace {

namespace fs = std::filesystem;

/// All that decides the report: every result of the stages before, their verdicts, and what can be drawn
/// here.
StageSpec spec_of(const CaseData& data, const ReportOptions& options, const SourceStudy& source,
                  std::uint64_t seed) {
  StageSpec spec;
  spec.stage = "report";
  Json stages = Json::object();
  for (const auto& stage : data.stages)
    stages[stage.name] = {{"status", static_cast<int>(stage.status)},
                          {"reasons", stage.reasons},
                          {"warnings", stage.warnings},
                          {"provenance", stage.provenance}};
  Json eyes = Json::array();
  for (const auto& eye : data.eyes) eyes.push_back(eye.id());
  spec.parameters = {{"eyes", eyes},
                     {"identified", options.identified},
                     {"no_face", options.no_face},
                     {"gnuplot", find_program("gnuplot").has_value()},
                     {"source", source.fingerprint()},
                     {"viewer", has_viewer_library()},
                     {"seed", seed},
                     {"stages", stages}};
  if (fs::exists(data.folder / "case.json")) spec.inputs.push_back({"case.json", data.folder / "case.json"});
  for (const auto& stage : data.stages) {
    const auto files = inputs_below(data.folder, stage.name);
    spec.inputs.insert(spec.inputs.end(), files.begin(), files.end());
  }
  return spec;
}

Json eyes_answer(const Document& document) {
  Json eyes = Json::object();
  for (const auto& section : document.sections)
    for (const auto& block : section.blocks)
      if (const auto* cards = std::get_if<EyeCards>(&block.block))
        for (const auto& card : cards->cards) {
          Json eye{{"verdict", card.verdict}, {"reasons", Json::array()}};
          for (const Finding& finding : card.reasons) eye["reasons"].push_back(finding.what);
          if (!card.prescription.empty()) eye["prescription"] = card.prescription;
          eyes[card.id] = eye;
        }
  return eyes;
}

/// The study that the DICOM objects belong to: as told, else where segmentation read it.
fs::path study_of(const CaseData& data, const ReportOptions& options) {
  if (!options.study.empty()) {
    if (!fs::exists(options.study))
      throw input_error("--study: " + options.study.string() + " does not exist",
                        "give the folder of the DICOM study that the case was made from");
    return options.study;
  }
  const Json stage = read_json(data.folder / "segmentation" / "stage.json");
  const fs::path study =
      stage.contains("study") && stage["study"].is_string() ? stage["study"].get<std::string>() : "";
  std::error_code missing;
  return fs::exists(study, missing) ? study : fs::path();
}

struct Source {
  SourceStudy study;
  std::string note;  ///< why the objects do not belong to the patient's study
};

Source source_of(const CaseData& data, const ReportOptions& options) {
  const fs::path study = study_of(data, options);
  std::string note =
      "The DICOM study is not at hand: the DICOM objects carry the pseudonym and belong to a study of their "
      "own (give the study with --study).";
  if (!study.empty()) {
    try {
      return {SourceStudy::read(
                  study, noted_study(data.case_json, read_json(data.folder / "segmentation" / "stage.json"))),
              ""};
    } catch (const Error& error) {
      if (!options.study.empty() || error.status() != ExitStatus::input_invalid) throw;
      // Not what the error says: it names the folder, which may bear a person's name.
      note =
          "The DICOM objects carry the pseudonym and belong to a study of their own: the study's folder does not "
          "hold the DICOM files that the case was made from, or it was made from NIfTI volumes, which name no patient, or "
          "from files without StudyInstanceUID or whose PatientID cannot be converted from its character set.";
    }
  }
  if (options.identified)
    throw input_error("--identified needs the DICOM study that the case was made from, which is not at hand",
                      "give it with --study");
  return {SourceStudy::pseudonymous(data.subject(), data.study_date()), note};
}

/// The page within its size: the viewer gets what the rest leaves.
std::string page_of(const CaseData& data, const Document& document, Face face, const CommonOptions& common,
                    Notes& notes) {
  CaseEyes eyes = living_eyes_of(data, common.thread_count(), common.seed);
  const LivingPanel living = make_living_panel(eyes.eyes, std::move(eyes.notes));
  const std::size_t without_viewer = render_html(document, {}, living).size();
  const ViewerData viewer =
      make_viewer_data(data, most_page_bytes - std::min(without_viewer, most_page_bytes), face);
  if (!viewer.note.empty()) notes.push_back(viewer.note);
  return render_html(document, viewer, living);
}

}  // namespace

std::optional<SourceStudy> source_study_of(const CaseData& data) {
  Source source = source_of(data, {});
  return source.note.empty() ? std::optional(std::move(source.study)) : std::nullopt;
}

Answer write_report(const ReportOptions& options, const CommonOptions& common) try {
  quiet_dicom_library();
  const CaseData data = read_case(options.case_folder, common.laterality);
  const Source source = source_of(data, options);
  const auto work = [&](StageWorkspace& workspace) {
    Notes notes;
    if (!source.note.empty()) notes.push_back(source.note);
    notes.insert(notes.end(), source.study.warnings().begin(), source.study.warnings().end());
    const Document document = make_document(
        data,
        {options.identified ? source.study.identity() : std::string(), study_date_of(data, source.study)},
        notes);
    const Pdf pdf = render_pdf(document);
    write_file(workspace.folder() / "report.html",
               page_of(data, document, options.no_face ? Face::taken_off : Face::shown, common, notes));
    write_file(workspace.folder() / "report.pdf", pdf.bytes);
    write_objects(workspace.folder(), data, source.study, pdf.bytes, options.identified, notes);
    for (const auto& note : notes) workspace.warn(note);
    workspace.provenance()["answer"] = {{"eyes", eyes_answer(document)}, {"pages", pdf.pages}};
    return StageVerdict{};
  };
  const StageOutcome outcome =
      run_stage(options.case_folder, spec_of(data, options, source.study, common.seed), common, work);
  const fs::path html = options.case_folder / "report" / "report.html";
  Answer answer;
  answer.json = outcome.stage_json.value("answer", Json::object());
  answer.json["html"] = html.string();
  answer.json["skipped"] = outcome.skipped;
  answer.json["pdf"] = (options.case_folder / "report" / "report.pdf").string();
  answer.text = describe("report", outcome, common.verbosity) + html.string() + "\n";
  return answer;
} catch (const nlohmann::json::exception& fault) {
  throw input_error("a JSON file of the case " + options.case_folder.string() +
                        " does not hold what its stage writes: " + fault.what(),
                    "run the stages again: emmetrope run STUDY -o " + options.case_folder.string());
}

}  // namespace emmetrope::report
