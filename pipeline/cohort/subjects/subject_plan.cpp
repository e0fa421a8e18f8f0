#include "pipeline/cohort/subjects/subject_plan.hpp"

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/stages.hpp"

namespace emmetrope::cohort {

std::vector<std::string> shared_options(const CommonOptions& common) {
  std::vector<std::string> words{"--seed", std::to_string(common.seed)};
  if (!common.device.empty()) words.insert(words.end(), {"--device", common.device});
  if (common.laterality != LateralityChoice::both)
    words.insert(words.end(), {"--laterality", to_string(common.laterality)});
  return words;
}

void write_subject(const CohortFolder& cohort, Subject subject, const CommonOptions& common) {
  const std::vector<std::string> shared = shared_options(common);
  for (const PipelineStage& stage : pipeline_stages) {
    std::vector<std::string>& words = subject.options[stage.command];
    words.insert(words.end(), shared.begin(), shared.end());
  }
  std::filesystem::create_directories(cohort.subject_file(subject.id).parent_path());
  Json plan = to_json(subject);
  plan["eyes"] = to_string(common.laterality);
  write_if_new(cohort.subject_file(subject.id), plan.dump(2) + "\n");
}

void write_if_new(const std::filesystem::path& file, const std::string& text) {
  const auto holds = [&] { return std::filesystem::exists(file) && read_file(file) == text; };
  if (holds()) return;
  try {
    write_file(file, text);
  } catch (const Error&) {
    if (!holds()) throw;  // else another job wrote it meanwhile
  }
}

}  // namespace emmetrope::cohort
