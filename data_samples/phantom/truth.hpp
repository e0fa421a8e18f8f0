#pragma once
#include <vector>

#include "data_samples/phantom/geometry.hpp"
#include "data_samples/phantom/render.hpp"
#include "pipeline/base/json.hpp"

namespace emmetrope::phantom {

/// Axial radius of the anterior cornea's meridian at 1.5 mm from the apex, as keratometry is defined.
double keratometric_radius_mm(const EyeGeometry& eye, double meridian_deg);
/// Depth at which the axis meets the vitreo-retinal interface, bulge included.
double pole_depth_mm(const EyeGeometry& eye);
/// The interface in the eye's frame, along a unit direction of scaled space (globe's half axes as units).
Eigen::Vector3d retina_point(const PlacedEye& eye, const Eigen::Vector3d& scaled_direction);

/// Every true value of one eye, named as in biometry.json but exact; besides "geometry" (the fields of
/// EyeGeometry in the eye's frame), "optics" (a complete eye.json) and "refraction" (paraxial, at the corneal
/// vertex, 589.3 nm).
/// \param lens_index  equivalent
Json eye_truth(const PlacedEye& eye, double lens_index);

/// {"synthetic": true, "eyes": {"od": {...}, "os": {...}}, "interpupillary_distance_mm", "head_roll_deg",
/// "head", ...}.
Json truth(const HeadGeometry& head);

}  // namespace emmetrope::phantom
