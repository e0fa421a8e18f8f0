#include "correction/prescription/withholding.hpp"

#include <fmt/core.h>

#include "pipeline/eye/population/limits.hpp"
#include "pipeline/eye/uncertainty/uncertain_eye.hpp"

namespace emmetrope::correction {

std::string reason_to_withhold(const Measured& mean_sphere_D) {
  const double half_width_D = (mean_sphere_D.ci95[1] - mean_sphere_D.ci95[0]) / 2;
  const Range supported_D = limits_of("M_half_width_D").accepted;
  if (supported_D.contains(half_width_D)) return {};
  return fmt::format(
      "The spherical equivalent's 95 % interval, +-{:.2f} D, is wider than from no lens at all to high myopia ({:g} "
      "D): these data do not support a prescription.",
      half_width_D, 2 * supported_D.high);
}

std::string reason_of_contradiction(double innovation_sigma) {
  if (!(innovation_sigma > doubtful_innovation_sigma)) return {};
  return fmt::format(
      "The refraction that was given and the images differ by {:.1f} standard deviations: their mean supports no "
      "prescription.",
      innovation_sigma);
}

std::string reason_not_to_dispense(const Measured& mean_sphere_D) {
  const double half_width_D = (mean_sphere_D.ci95[1] - mean_sphere_D.ci95[0]) / 2;
  const Range expected_D = limits_of("M_half_width_D").plausible;
  if (expected_D.contains(half_width_D)) return {};
  return fmt::format(
      "The spherical equivalent's 95 % interval, +-{:.2f} D, is wider than +-{:g} D: an estimate, do not dispense.",
      half_width_D, expected_D.high);
}

}  // namespace emmetrope::correction
