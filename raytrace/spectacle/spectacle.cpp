#include "raytrace/spectacle/spectacle.hpp"

#include <fmt/format.h>

#include <cmath>

#include "pipeline/base/checked_object.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"

namespace emmetrope::raytrace {
namespace {

/// A radius beyond which nobody can tell a meridian from a straight line (1e-6 D).
constexpr double flat_radius_mm = 1e9;
/// Between the front plane and the back vertex of a "thin" lens: a plane front has no power, so that the back
/// vertex power is the lens's power whatever lies between; enough for the back of +20 D to stay behind it 12
/// mm off the axis.
constexpr double slab_mm = 4, slab_radius_mm = 12;
constexpr double usual_thickness_mm = 2;
/// Prescriptions hold at this wavelength.
constexpr double prescription_nm = 589.3;

double radius_mm(double curvature_per_mm) {
  return std::abs(curvature_per_mm) < 1 / flat_radius_mm ? flat_radius_mm : 1 / curvature_per_mm;
}

/// Tilt of a front surface behind which a ray from the eye along the axis leaves it deviated by the prism:
/// n sin i = sin(i + deviation).
double tilt_rad(const Prism& prism, double index) {
  const double deviation = std::atan(prism.dioptres / 100);
  return std::atan2(std::sin(deviation), index - std::cos(deviation));
}

/// The front turned so that the lens is thick at the base.
void tilt(Surface& front, const Prism& prism, double index) {
  const double t = tilt_rad(prism, index), base = prism.base_deg * degree;
  const Eigen::Vector3d normal(-std::sin(t) * std::cos(base), -std::sin(t) * std::sin(base), std::cos(t));
  front.tilt_deg = {std::asin(-normal.y()) / degree, std::atan2(normal.x(), normal.z()) / degree};
}

EyeModel with_lens(const EyeModel& eye, ShapePtr front_shape, ShapePtr back, double back_vertex_mm,
                   double thickness_mm, const Medium& material, const Prism& prism,
                   double semi_diameter_mm = 0) {
  EyeModel result = eye;
  result.media["spectacle"] = material;
  result.media["air"] = Medium{1.0, {}, {}};
  Surface front;
  front.name = "spectacle_front";
  front.shape = std::move(front_shape);
  front.position_mm = -back_vertex_mm - thickness_mm;
  front.medium_after = "spectacle";
  front.semi_diameter_mm = semi_diameter_mm;
  tilt(front, prism, material.index);
  Surface rear;
  rear.name = "spectacle_back";
  rear.shape = std::move(back);
  rear.position_mm = -back_vertex_mm;
  rear.medium_after = "air";
  rear.semi_diameter_mm = semi_diameter_mm;
  result.surfaces.insert(result.surfaces.begin(), {front, rear});
  return result;
}

/// Least thickness within the rim: front and back along 36 half meridians.
double least_thickness_mm(const Shape& front, const Shape& back, double centre_mm, double rim_mm,
                          double slope) {
  double least = centre_mm;
  for (int k = 0; k < 36; ++k) {
    const double x = rim_mm * std::cos(10 * k * degree), y = rim_mm * std::sin(10 * k * degree);
    const auto d = front.depth_mm(x, y), e = back.depth_mm(x, y);
    if (!d || !e)
      throw usage_error(fmt::format("the {} of the spectacle ends within its semi-diameter of {} mm",
                                    d ? "back" : "front", rim_mm),
                        "use a flatter base curve, a lower power or a smaller lens");
    least = std::min(least, centre_mm + *e - *d);
  }
  return least - slope * rim_mm;
}

}  // namespace

EyeModel with_thin_lens(const EyeModel& eye, const PowerVector& power, double vertex_distance_mm,
                        const Prism& prism) {
  constexpr double index = 1.5;
  const SpheroCylinder lens = to_sphero_cylinder(power);
  const double curvature_per_D = 1e-3 / (1 - index);  // back surface, light from glass to air
  ShapePtr back =
      make_biconic(radius_mm(lens.sphere_D * curvature_per_D),
                   radius_mm((lens.sphere_D + lens.cylinder_D) * curvature_per_D), 0, 0, lens.axis_deg);
  const double thickness = slab_mm + slab_radius_mm * std::tan(tilt_rad(prism, index));
  return with_lens(eye, make_plane(), std::move(back), vertex_distance_mm, thickness, {index, {}, {}}, prism);
}

EyeModel with_plano_cylinder(const EyeModel& eye, double radius, double axis_deg, double distance_mm,
                             double index, double centre_thickness_mm) {
  ShapePtr back = make_biconic(flat_radius_mm, radius, 0, 0, axis_deg);
  return with_lens(eye, make_plane(), std::move(back), distance_mm, centre_thickness_mm, {index, {}, {}}, {});
}

EyeModel with_meniscus(const EyeModel& eye, const Meniscus& lens) {
  Medium material;
  double index = lens.index;
  if (lens.abbe) {
    material.dispersion = {Dispersion::Formula::abbe, {lens.index, *lens.abbe}};
    material.index = material.dispersion.formula_index(eye.reference_wavelength_nm);
    index = material.dispersion.formula_index(prescription_nm);
  } else {
    material.index = index;
  }
  const double front_radius_mm = radius_mm(lens.base_D * 1e-3 / (index - 1));
  const ShapePtr front = make_sphere(front_radius_mm);
  const SpheroCylinder power = to_sphero_cylinder(lens.power);
  const auto back_of = [&](double thickness_mm) {
    // F'v = F1 / (1 - F1 t/n) + F2, and F2 = (1 - n) / R2
    const double from_front = lens.base_D / (1 - 1e-3 * thickness_mm / index * lens.base_D);
    const auto radius = [&](double vertex_power_D) {
      return radius_mm((vertex_power_D - from_front) * 1e-3 / (1 - index));
    };
    return make_biconic(radius(power.sphere_D), radius(power.sphere_D + power.cylinder_D), 0, 0,
                        power.axis_deg);
  };
  const double slope = std::tan(tilt_rad(lens.prism, index));
  double thickness = lens.centre_thickness_mm.value_or(usual_thickness_mm);
  // The back follows from the thickness, and weakly: a few rounds settle both to a micrometre.
  for (int round = 0; round < 8 && !lens.centre_thickness_mm; ++round)
    thickness = std::max(usual_thickness_mm, thickness + least_edge_mm -
                                                 least_thickness_mm(*front, *back_of(thickness), thickness,
                                                                    lens.semi_diameter_mm, slope));
  const ShapePtr back = back_of(thickness);
  if (!(least_thickness_mm(*front, *back, thickness, lens.semi_diameter_mm, slope) > 0))
    throw usage_error(fmt::format("a spectacle {} mm thick has no edge left at {} mm from its centre",
                                  thickness, lens.semi_diameter_mm),
                      "make it thicker or smaller");
  return with_lens(eye, front, back, lens.vertex_distance_mm, thickness, material, lens.prism,
                   lens.semi_diameter_mm);
}

EyeModel fixed_to_head(const EyeModel& eye, const Eigen::Isometry3d& eye_from_head) {
  EyeModel result = eye;
  if (eye_from_head.isApprox(Eigen::Isometry3d::Identity(), 0)) return result;
  for (Surface& surface : result.surfaces) {
    if (surface.name.rfind("spectacle", 0) != 0) continue;
    if (surface.shape->type() == "mesh")
      throw unsupported_error(
          "surface \"" + surface.name + "\" is a mesh: it cannot stay with the head while the eye turns",
          "use a formula, or no gaze");
    const Eigen::Isometry3d place = eye_from_head * surface.eye_from_surface();
    const Eigen::Vector3d vertex = place.translation(), normal = place.linear().col(2);
    surface.decentre_mm = vertex.head<2>();
    surface.position_mm = -vertex.z();
    surface.tilt_deg = {std::asin(-normal.y()) / degree, std::atan2(normal.x(), normal.z()) / degree};
    // What tilts about x and y leave of the turn is one about the surface's own z.
    const Eigen::Matrix3d rest = surface.eye_from_surface().linear().transpose() * place.linear();
    const double roll_deg = std::atan2(rest(1, 0), rest(0, 0)) / degree;
    Json form = surface.shape->to_json();
    if (!form.contains("axis_deg")) continue;
    form["axis_deg"] = form["axis_deg"].get<double>() + roll_deg;
    CheckedObject keys(form, surface.name);
    surface.shape = shape_from_json(keys.text("type"), keys);
  }
  return result;
}

}  // namespace emmetrope::raytrace
