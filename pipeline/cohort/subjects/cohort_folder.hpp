#pragma once
#include <filesystem>
#include <string>
#include <string_view>

namespace emmetrope::cohort {

/// Where things are in OUT of `emmetrope cohort STUDIES -o OUT`.
class CohortFolder {
 public:
  explicit CohortFolder(std::filesystem::path root) : root_(std::move(root)) {}
  const std::filesystem::path& root() const { return root_; }
  /// What is to be done for a subject: to_json(Subject).
  std::filesystem::path subject_file(const std::string& subject) const {
    return root_ / "subjects" / (subject + ".json");
  }
  std::filesystem::path case_folder(const std::string& subject) const { return root_ / "cases" / subject; }
  /// How a stage ended for a subject: to_json(StageEnd).
  std::filesystem::path end_file(const std::string& subject, std::string_view stage) const {
    return root_ / "ends" / subject / (std::string(stage) + ".json");
  }
  /// What the stage's command told.
  std::filesystem::path log_file(const std::string& subject, std::string_view stage) const {
    return root_ / "logs" / subject / (std::string(stage) + ".log");
  }

 private:
  std::filesystem::path root_;
};

}  // namespace emmetrope::cohort
