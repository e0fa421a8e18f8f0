#include "pipeline/base/eye_stage.hpp"

namespace emmetrope {

std::vector<Laterality> eyes_asked_for(LateralityChoice wanted) {
  std::vector<Laterality> eyes;
  for (const Laterality eye : both_eyes)
    if (includes(wanted, eye)) eyes.push_back(eye);
  return eyes;
}

std::vector<Laterality> eyes_with(const std::filesystem::path& case_folder, const std::string& stage_before,
                                  const std::string& file, LateralityChoice wanted) {
  std::vector<Laterality> eyes;
  for (const Laterality eye : eyes_asked_for(wanted))
    if (std::filesystem::exists(case_folder / stage_before / to_string(eye) / file)) eyes.push_back(eye);
  return eyes;
}

StageVerdict work_eye_by_eye(const std::vector<Laterality>& eyes, const StageVerdict& before,
                             const std::function<void(Laterality)>& work) {
  StageVerdict verdict{ExitStatus::no_result, before.reasons};
  std::size_t done = 0;
  for (const Laterality eye : eyes) {
    try {
      work(eye);
      ++done;
    } catch (const Error& error) {
      if (error.status() != ExitStatus::no_result) throw;
      verdict.reasons.push_back(std::string(clinical_name(eye)) + ": " + error.what());
    }
  }
  if (done > 0)
    verdict.status =
        done < eyes.size() || before.status == ExitStatus::partial ? ExitStatus::partial : ExitStatus::done;
  return verdict;
}

Error said_of(Laterality eye, const Error& error) {
  return {error.status(), std::string(clinical_name(eye)) + ": " + error.what(), error.remedy()};
}

std::string readings_not_used(Laterality eye) {
  return std::string(clinical_name(eye)) +
         ": what was measured of it elsewhere is not used: this run does not work on that eye";
}

Answer stage_answer(const PipelineStage& stage, const StageOutcome& outcome, const CommonOptions& common,
                    const std::function<std::optional<EyeAnswer>(Laterality)>& of_eye) {
  Answer answer;
  answer.status = outcome.verdict.status;
  answer.json = {{"status", static_cast<int>(outcome.verdict.status)},
                 {"reasons", outcome.verdict.reasons},
                 {"skipped", outcome.skipped},
                 {"wall_s", outcome.wall_s},
                 {"eyes", Json::object()}};
  for (const Laterality eye : eyes_asked_for(common.laterality)) {
    if (const auto said = of_eye(eye)) {
      answer.json["eyes"][to_string(eye)] = said->json;
      answer.text += said->text;
    }
  }
  for (const std::string& reason : outcome.verdict.reasons) answer.text += reason + "\n";
  answer.text += describe(stage.folder, outcome, common.verbosity);
  return answer;
}

}  // namespace emmetrope
