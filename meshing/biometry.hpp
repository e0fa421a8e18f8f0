#pragma once
#include <string>
#include <vector>

#include "pipeline/base/json.hpp"
#include "pipeline/base/measured.hpp"
#include "pipeline/eye/parametric/corneal_metrics.hpp"
#include "pipeline/eye/population/limits.hpp"
#include "pipeline/eye/uncertainty/uncertain_eye.hpp"

namespace emmetrope {
struct Topography;
}

namespace emmetrope::meshing {

struct BiometryOptions {
  double retinal_depth_mm = usual_retinal_depth_mm;
  double zernike_zone_mm = 6;  ///< diameter
  int zernike_order = 6;
};

/// A power vector's (M, J0, J45) view as flat, steep, cylinder and axis, with intervals by linear
/// propagation; where the cylinder's holds 0 its axis has the interval value -+ 90.
struct Keratometry {
  Measured flat_radius_mm, flat_power_D, flat_axis_deg;
  Measured steep_radius_mm, steep_power_D, steep_axis_deg;
  Measured cylinder_D;
};
/// \param power  begins with M, J0, J45
Keratometry keratometry_from(const Propagated& power);

/// biometry.json of one eye without what needs both eyes (interpupillary distance) or the study (head roll).
///
/// \param topography  its departure from a toric conicoid is part of the cornea; without it (null) the
///   irregularity is what is usual in the population, labelled so
Json biometry_json(const UncertainEye& estimate, const BiometryOptions& options,
                   const Topography* topography = nullptr);

/// Distance between the globes' centres.
///
/// \param scale_sd  relative standard deviation of the scanner's scale
/// \param head_motion_sd_mm  of the head between the series that the two eyes were measured in
Measured interpupillary_distance_mm(const UncertainEye& od, const UncertainEye& os, double scale_sd,
                                    double head_motion_sd_mm);

/// Numbers outside what eyes are: `plausibility` in biometry.json, and a sentence for each that failed.
struct PlausibilityFlag {
  std::string name;
  double value = 0;
  Range plausible;
  bool passed() const { return plausible.contains(value); }
  std::string describe() const;
};
std::vector<PlausibilityFlag> plausibility(const Json& biometry);
Json to_json(const std::vector<PlausibilityFlag>& flags);

}  // namespace emmetrope::meshing
