#include "correction/prescription/peripheral.hpp"

#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/optics/chief_ray.hpp"
#include "pipeline/eye/optics/retina_point.hpp"
#include "raytrace/wavefront/wavefront.hpp"

namespace emmetrope::correction {
namespace {

/// Nothing where not all of the direction's rays come out of the eye.
std::optional<FieldPoint> refraction_towards(const EyeModel& eye, double wavelength_nm,
                                             const ChiefRays& chief_rays, double horizontal_deg,
                                             double vertical_deg) {
  const std::optional<Eigen::Vector3d> image =
      chief_rays.image_of({std::tan(horizontal_deg * degree), std::tan(vertical_deg * degree), 1});
  const auto behind_equator = image ? meet_retina(eye, image->head<2>()) : std::nullopt;
  if (!behind_equator || (behind_equator->position_mm - *image).norm() > 1e-6) return std::nullopt;
  raytrace::WavefrontSettings settings;
  settings.wavelength_nm = wavelength_nm;
  settings.order = 4;
  settings.fovea_mm = image->head<2>();
  try {
    return FieldPoint{horizontal_deg, vertical_deg,
                      raytrace::measure_wavefront(eye, settings).minimum_rms_spot};
  } catch (const Error& error) {
    if (error.status() != ExitStatus::no_result) throw;
    return std::nullopt;
  }
}

}  // namespace

std::vector<FieldPoint> peripheral_refraction(const EyeModel& eye, double wavelength_nm, double reach_deg,
                                              int points_across) {
  const ChiefRays chief_rays(eye, wavelength_nm);
  const double half = 0.5 * (points_across - 1), step_deg = reach_deg / half;
  std::vector<FieldPoint> field;
  for (int row = 0; row < points_across; ++row)
    for (int column = 0; column < points_across; ++column)
      if (const auto point = refraction_towards(eye, wavelength_nm, chief_rays, step_deg * (column - half),
                                                step_deg * (half - row)))
        field.push_back(*point);
  return field;
}

}  // namespace emmetrope::correction
