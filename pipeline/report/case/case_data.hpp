#pragma once
#include <Eigen/Core>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/base/error.hpp"
#include "pipeline/base/json.hpp"
#include "pipeline/base/laterality.hpp"
#include "pipeline/base/measured.hpp"

/// What the stages left in a case, read and checked once.
namespace emmetrope::report {

/// correction/<eye>/sweep.csv: the first column is what was varied.
struct Sweep {
  std::vector<std::string> names;
  std::vector<std::vector<double>> rows;
};

/// One eye's results. A file that a stage did not make is null or empty.
struct EyeData {
  Laterality laterality = Laterality::od;
  Json fit, biometry, optics, wavefront, prescription;
  Json
      traced;  ///< what raytrace/stage.json says of the eye that was traced: {"lens_index", "lens_index_from"}
  std::optional<Sweep> sweep;
  std::filesystem::path uncorrected_png, corrected_png;
  std::vector<std::filesystem::path> overlays;  ///< pictures that segmentation left for this eye

  std::string id() const { return to_string(laterality); }
  std::filesystem::path mesh(const std::string& surface) const { return meshes / (surface + ".ply"); }
  std::filesystem::path meshes;
};

/// One finished stage: what stage.json says, without what differs from run to run (times, paths).
struct StageData {
  std::string name;
  ExitStatus status = ExitStatus::done;
  std::vector<std::string> reasons, warnings;
  Json provenance;  ///< version, parameters, seed, device, output hashes
};

struct CaseData {
  std::filesystem::path folder;
  Json case_json;
  std::vector<StageData> stages;                ///< those that have run, in the pipeline's order
  std::vector<EyeData> eyes;                    ///< od, os: those that were asked for
  std::vector<std::filesystem::path> overlays;  ///< pictures of stacks in which no eye was found
  std::vector<std::filesystem::path> stacks;    ///< segmentation/<stack>.nii.gz, without the label volumes

  const StageData* stage(const std::string& name) const;
  /// Pseudonym of the subject; "unknown" where case.json has none.
  std::string subject() const;
  /// False where the age was taken away: a normal range would be one for an age.
  bool has_normal_ranges = true;
  /// Of the subject as the study or `segment --age` says, else as a later stage was told.
  std::optional<double> age_years() const;
  /// Study date as YYYY-MM-DD, or empty.
  std::string study_date() const;
  /// What case.json has for it, be it a date or not; empty where it has none.
  std::string told_study_date() const;
};

/// What of a case is read: all, or no more than segmentation and meshing made.
enum class CaseExtent { whole, until_meshing };

/// \throw Error (input_invalid) when the case lacks case.json or segmentation, or a file that is read is broken
CaseData read_case(const std::filesystem::path& folder, LateralityChoice eyes,
                   CaseExtent extent = CaseExtent::whole);

/// Middle of the eye (LPS, mm): the globe's centre from the fit, else the middle of its axis; nothing for an
/// eye that was not found.
std::optional<Eigen::Vector3d> globe_centre(const EyeData& eye);

/// How far the head had moved when a stack was taken (LPS, mm): a point of the stack plus this lies where the
/// eye's surfaces are. Zero for a stack that the eye was not fitted to.
Eigen::Vector3d head_shift(const EyeData& eye, const std::string& stack);

/// Whether the eye's surfaces lie, but for the head's shift, where a stack shows them: it was fitted to it. In stacks of the
/// other contrast it may look elsewhere. Of an eye that was fitted to none this is not known: true.
bool is_fitted_to(const EyeData& eye, const std::string& stack);

/// A number of a JSON document that may be plain or measured; nothing where it is missing or null.
std::optional<double> value_of(const Json& json, const std::string& key);
/// The same by a JSON pointer, "/keratometry/flat/power_D".
std::optional<double> value_at(const Json& json, const std::string& pointer);
/// A number with its interval; nothing where it is missing or has none.
std::optional<Measured> measured_in(const Json& json, const std::string& key);

}  // namespace emmetrope::report
