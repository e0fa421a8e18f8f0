#pragma once
#include "pipeline/base/power_vector.hpp"
#include "raytrace/eye/eye_model.hpp"

namespace emmetrope {

/// Puts a thin sphero-cylindrical lens in front of the eye: two real surfaces, "spectacle_front" (plane,
/// without power) and "spectacle_back" (biconic, q = 0), of index 1.5. The back vertex stands
/// `vertex_distance_mm` in front of the corneal apex and has the power `power`; the glass between plane and
/// back vertex (4 mm) keeps plus lenses whole and changes nothing for a distant object.
EyeModel with_thin_lens(const EyeModel& eye, const PowerVector& power, double vertex_distance_mm);

/// The paper's spectacle: plano front "spectacle_front", cylindrical back "spectacle_back" of radius
/// `radius_mm` (textbook sign: +50 mm is -10 D at index 1.5), `axis_deg` its meridian without power, back
/// vertex at `distance_mm` in front of the cornea.
EyeModel with_plano_cylinder(const EyeModel& eye, double radius_mm, double axis_deg, double distance_mm = 10,
                             double index = 1.5, double centre_thickness_mm = 1.0);

}  // namespace emmetrope
