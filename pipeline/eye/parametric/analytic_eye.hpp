#pragma once
#include <vector>

#include "pipeline/eye/model/eye_model.hpp"
#include "pipeline/eye/parametric/parametric_eye.hpp"

namespace emmetrope {

/// What light does not reveal to MRI.
struct OpticalDefaults {
  double lens_index = lens_index_at_age(usual_age_years).mean;  ///< equivalent
  double lens_index_sigma = usual_lens_index_sigma;
  double retinal_depth_mm = usual_retinal_depth_mm;
  double pupil_mm = 3;  ///< iris aperture for a prescription
};

/// The front surface of the fitted cornea: a biconic, with Zernike terms where it is irregular.
ShapePtr anterior_cornea_shape(const ParametricEye& eye);

/// Cornea, iris, lens and retina as formulas. The retina is the globe's ellipsoid, its pole where the
/// displaced interface meets the axis.
///
/// \param anterior_cornea  instead of the fitted one; may be null
std::vector<Surface> analytic_surfaces(const ParametricEye& eye, const ShapePtr& anterior_cornea = nullptr,
                                       const OpticalDefaults& defaults = {});

/// Depths at which the eye's axis meets the lens, which may be tilted and off the axis.
struct LensOnAxis {
  double front_mm = 0, back_mm = 0;
};
LensOnAxis lens_on_axis(const ParametricEye& eye);

/// The optical system of the eye: Gullstrand's indices with Le Grand's dispersion, a homogeneous lens, the
/// retina at the photoreceptors.
EyeModel analytic_eye(const ParametricEye& eye, const ShapePtr& anterior_cornea = nullptr,
                      const OpticalDefaults& defaults = {});

}  // namespace emmetrope
