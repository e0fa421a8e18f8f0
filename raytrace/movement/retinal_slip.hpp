#pragma once
#include <optional>

#include "pipeline/eye/model/eye_model.hpp"
#include "raytrace/movement/movement.hpp"

namespace emmetrope::raytrace {

/// How the image of what is far away and at rest runs over the retina. Off the axis x and y are carried along by the
/// smallest turn from the axis.
struct RetinalSlip {
  Eigen::Vector2d image_mm_s;  ///< of the image, along the retina
  Eigen::Vector2d
      direction_deg_s;  ///< of the object against the eye, across the line of sight: to the left, up
};

/// At a place of the retina and a moment, by the chief rays of half a millisecond before and after.
/// \param eye  as it looks straight ahead, with what it wears
/// \param retina_mm  eye x and y from the pole
/// \return nothing where no light from there leaves the eye, or the image runs off what it sees
/// \throw Error (input_invalid) when the eye has no stop or no retina there
std::optional<RetinalSlip> retinal_slip(const EyeModel& eye, const EyePose& pose, const Movement& movement,
                                        Laterality side, double time_s, const Eigen::Vector2d& retina_mm,
                                        double wavelength_nm);

}  // namespace emmetrope::raytrace
