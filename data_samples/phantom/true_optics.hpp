#pragma once
#include "data_samples/phantom/geometry.hpp"
#include "pipeline/eye/model/eye_model.hpp"

namespace emmetrope::phantom {

/// The true eye as an optical system: Gullstrand's indices, a homogeneous lens, the retina's ellipsoid moved
/// to the photoreceptors 0.20 mm behind the interface, with its pole where the axis meets it (a bulge is in
/// the pole's depth, not in the surface around it).
/// \param lens_index  equivalent
EyeModel true_optics(const PlacedEye& eye, double lens_index);

}  // namespace emmetrope::phantom
