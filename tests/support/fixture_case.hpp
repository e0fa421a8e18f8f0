#pragma once
#include <filesystem>
#include <string>

#include "pipeline/base/json.hpp"

/// A finished case as the stages before the report leave it, made from formulas in a second: two eyes,
/// surfaces, a volume with labels, all numbers known.
namespace emmetrope::test {

struct FixtureOptions {
  bool refused = false;     ///< segmentation refused both eyes: no meshes, no numbers
  bool only_right = false;  ///< the left eye was not found
  std::string subject = "s-0a1b2c3d";
  std::string stage_warning;  ///< a warning in segmentation's stage.json
};

/// Fills `folder`, which must not exist.
void make_fixture_case(const std::filesystem::path& folder, const FixtureOptions& options = {});

/// A DICOM MR study of the fixture's volume (PatientName "DOE^JANE", 1961-02-03).
void make_fixture_study(const std::filesystem::path& folder, const std::string& patient_name = "DOE^JANE");

/// Notes in the case, as segmentation does, that it was made from this study.
void note_study(const std::filesystem::path& case_folder, const std::filesystem::path& study);

}  // namespace emmetrope::test
