#pragma once
#include <filesystem>
#include <functional>
#include <optional>

#include "pipeline/eye/measured/uncertain_optics.hpp"
#include "raytrace/picture/trace_settings.hpp"

namespace emmetrope::raytrace {

/// A place of the retina that was seen elsewhere, in a fundus photograph say.
struct Landmark {
  Eigen::Vector2d from_pole_mm{0, 0};  ///< eye x and y
  double sigma_mm = 0;                 ///< of its place along the retina, each way; 0: exact

  /// \throw Error (usage) naming the option
  void check(const char* option) const;
};
struct Landmarks {
  std::optional<Landmark> fovea, disc;
};

/// \throw Error (input_invalid) naming the option of a landmark beside the retina
void require_on_retina(const EyeModel& eye, const Landmarks& landmarks);

/// What is uncertain of a measured eye, and how it looks: with what it wears, turned.
struct UncertainField {
  UncertainOptics optics;
  std::function<EyeModel(const EyeModel&)> as_it_looks;
  int threads = 1;
};

/// Into a folder: visual-field.json, where the retina sees the visual field by chief rays, every 5 degrees from the
/// line of sight of the picture's centre as far as the eye sees, on every 15th meridian (columns of equal length), with the
/// 95 % ellipses of a measured eye; and the retina's landmarks with the shortest ways between them.
/// \param eye  as it looks
/// \param uncertain  of a measured eye; null for one that is exact
/// \throw Error as require_on_retina
void write_visual_field(const EyeModel& eye, const TraceSettings& settings, const Landmarks& landmarks,
                        const UncertainField* uncertain, const std::filesystem::path& folder);

}  // namespace emmetrope::raytrace
