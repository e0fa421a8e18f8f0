#include "raytrace/spectacle/spectacle.hpp"

#include <cmath>

namespace emmetrope {
namespace {

/// A radius beyond which nobody can tell a meridian from a straight line (1e-6 D).
constexpr double flat_radius_mm = 1e9;
/// Between the front plane and the back vertex of a "thin" lens: a plane front has no power, so that the back
/// vertex power is the lens's power whatever lies between; enough for the back of +20 D to stay behind it 12
/// mm off the axis.
constexpr double slab_mm = 4;

double radius_mm(double curvature_per_mm) {
  return std::abs(curvature_per_mm) < 1 / flat_radius_mm ? flat_radius_mm : 1 / curvature_per_mm;
}

EyeModel with_lens(const EyeModel& eye, ShapePtr back, double back_vertex_mm, double thickness_mm,
                   double index) {
  EyeModel result = eye;
  result.media["spectacle"] = Medium{index, {}, {}};
  result.media["air"] = Medium{1.0, {}, {}};
  Surface front;
  front.name = "spectacle_front";
  front.shape = make_plane();
  front.position_mm = -back_vertex_mm - thickness_mm;
  front.medium_after = "spectacle";
  Surface rear;
  rear.name = "spectacle_back";
  rear.shape = std::move(back);
  rear.position_mm = -back_vertex_mm;
  rear.medium_after = "air";
  result.surfaces.insert(result.surfaces.begin(), {front, rear});
  return result;
}

}  // namespace

EyeModel with_thin_lens(const EyeModel& eye, const PowerVector& power, double vertex_distance_mm) {
  constexpr double index = 1.5;
  const SpheroCylinder lens = to_sphero_cylinder(power);
  const double curvature_per_D = 1e-3 / (1 - index);  // back surface, light from glass to air
  ShapePtr back =
      make_biconic(radius_mm(lens.sphere_D * curvature_per_D),
                   radius_mm((lens.sphere_D + lens.cylinder_D) * curvature_per_D), 0, 0, lens.axis_deg);
  return with_lens(eye, std::move(back), vertex_distance_mm, slab_mm, index);
}

EyeModel with_plano_cylinder(const EyeModel& eye, double radius, double axis_deg, double distance_mm,
                             double index, double centre_thickness_mm) {
  ShapePtr back = make_biconic(flat_radius_mm, radius, 0, 0, axis_deg);
  return with_lens(eye, std::move(back), distance_mm, centre_thickness_mm, index);
}

}  // namespace emmetrope
