#pragma once
#include <functional>
#include <optional>
#include <vector>

#include "pipeline/eye/measured/uncertain_optics.hpp"

namespace emmetrope::raytrace {

/// Where on the retina a measured eye sees a direction is known to this ellipse, with 95 %.
struct RetinaEllipse {
  Eigen::Vector2d semi_axes_mm;  ///< the longer first, along the retina
  /// Of the longer against the way from the pole (at the pole: eye +x), counter-clockwise for who looks from within.
  double axis_deg = 0;
};

/// Along the retina from its own pole, by linear propagation of what optics.json holds: cornea, lens, its index, length. The retina's shape is the one that was
/// measured, and the direction of the eye's axis is taken as known.
/// \param as_it_looks  what it wears and how it is turned
/// \param directions  unit vectors from the eye, eye frame
/// \return one a direction; nothing where the eye, or one that is as likely, does not see it
std::vector<std::optional<RetinaEllipse>> retina_ellipses(
    const UncertainOptics& optics, const std::function<EyeModel(const EyeModel&)>& as_it_looks,
    const std::vector<Eigen::Vector3d>& directions, double wavelength_nm, int threads);

}  // namespace emmetrope::raytrace
