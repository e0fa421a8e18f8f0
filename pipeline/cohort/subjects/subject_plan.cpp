#include "pipeline/cohort/subjects/subject_plan.hpp"

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
  write_if_new(cohort.subject_file(subject.id), to_json(subject).dump(2) + "\n");
}

void write_if_new(const std::filesystem::path& file, const std::string& text) {
  if (!std::filesystem::exists(file) || read_file(file) != text) write_file(file, text);
}

}  // namespace emmetrope::cohort
