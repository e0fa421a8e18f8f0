#include "pipeline/eye/optics/plausible_eye.hpp"

#include <fmt/format.h>

#include "pipeline/eye/optics/paraxial.hpp"
#include "pipeline/eye/population/limits.hpp"

namespace emmetrope {

std::string implausible_eye(const EyeModel& eye) {
  // Wider than limits of measured eyes: an aphakic one has 43 D, Gullstrand's at full accommodation 71.
  constexpr Range power_D{40, 80}, length_mm{15, 40};
  const double power = cardinal_points(without_spectacle(eye), eye.reference_wavelength_nm).power_D;
  if (power_D.contains(power) && length_mm.contains(eye.axial_length_mm())) return {};
  return fmt::format(
      "eye '{}' has {:.4g} D and is {:.4g} mm long; human eyes have {:g} to {:g} D and are {:g} to {:g} mm long: check "
      "that its lengths are mm",
      eye.name, power, eye.axial_length_mm(), power_D.low, power_D.high, length_mm.low, length_mm.high);
}

}  // namespace emmetrope
