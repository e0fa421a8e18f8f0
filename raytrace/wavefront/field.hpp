#pragma once
#include <filesystem>

#include "pipeline/base/progress.hpp"
#include "pipeline/eye/optics/chief_ray.hpp"
#include "raytrace/wavefront/wavefront.hpp"

namespace emmetrope::raytrace {

/// Directions of the visual field: lines of sight by their angles against the eye's axis towards +x and +y
/// (atan x/z, atan y/z), even in both, out to an eccentricity.
struct FieldGrid {
  double reach_deg = 60;
  double step_deg = 5;

  /// \throw Error (usage)
  void check() const;
  /// Rows from the top, each from -x to +x.
  std::vector<Eigen::Vector2d> directions_deg() const;
};

/// Where the retina sees a direction, eye frame; nothing where it does not.
/// \param direction_deg  as of FieldGrid; one of them may be up to 180 where the other is 0
/// \throw Error (usage) where they are no direction
std::optional<Eigen::Vector3d> retina_seeing(const ChiefRays& chief_rays,
                                             const Eigen::Vector2d& direction_deg);

/// Where the retina sees a direction, and the wavefront of the light between.
struct FieldWavefront {
  Eigen::Vector2d direction_deg{0, 0};
  Eigen::Vector3d retina_mm{0, 0, 0};
  Wavefront wavefront;
};
/// Nothing where the retina behind its equator does not see the direction, or too little of its light comes
/// through.
/// \param settings  its fovea_mm is not looked at
std::optional<FieldWavefront> wavefront_towards(const EyeModel& eye, const ChiefRays& chief_rays,
                                                const Eigen::Vector2d& direction_deg,
                                                WavefrontSettings settings);

/// Into a folder: field.json (columns of equal length, one entry a direction), psf-grid.tiff (a page each) and
/// psf-grid.png, all of them at a glance.
/// \param settings  its fovea_mm is not looked at
void write_field(const EyeModel& eye, const FieldGrid& grid, const WavefrontSettings& settings,
                 const std::filesystem::path& folder, int threads, Verbosity verbosity);
/// Takes those of an earlier eye away.
void remove_field(const std::filesystem::path& folder);

}  // namespace emmetrope::raytrace
