#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "segmentation/judgement/fellow_eye.hpp"

/// Eyes of scans in memory, judged as the stage judges them.
namespace emmetrope::segmentation {

/// The stacks of a study that `segment` would use.
struct Scan {
  std::string name;
  std::vector<Stack> volumes;
  std::vector<std::string> laterality_tags;
  std::optional<double> age_years;

  std::vector<const Stack*> stacks() const;
  FoundEyes find() const { return find_eyes(stacks(), laterality_tags); }
};

/// \throw Error as the stage does
Scan read_scan(const std::filesystem::path& study);

/// Reads, fits and judges an eye that was found, alone.
void judge(JudgedEye& eye, const std::vector<const Stack*>& stacks, std::optional<double> age_years);

/// All eyes of a scan, compared and coupled; one a core.
/// \param scan  outlives what is returned
std::vector<JudgedEye> judge(const Scan& scan);

/// What the stages `segment` and `mesh` would state of the eye: the fit's quantities, without the cornea's where
/// that is withheld, or those of edges; null where it is refused.
/// \param scale_sd  of the scanner's scale, a fraction; 0: its millimetres are known
Json stated_biometry(const JudgedEye& eye, double scale_sd);

}  // namespace emmetrope::segmentation
