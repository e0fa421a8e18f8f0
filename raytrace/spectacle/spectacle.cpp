#include "raytrace/spectacle/spectacle.hpp"

#include <fmt/format.h>

#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/model/mesh_shape.hpp"

namespace emmetrope::raytrace {
namespace {

/// A radius beyond which nobody can tell a meridian from a straight line (1e-6 D).
constexpr double flat_radius_mm = 1e9;
/// Between the front plane and the back vertex of a "thin" lens: a plane front has no power, so that the back
/// vertex power is the lens's power whatever lies between; enough for the back of +20 D to stay behind it 12
/// mm off the axis.
constexpr double slab_mm = 4, slab_radius_mm = 12;
constexpr double usual_thickness_mm = 2;
constexpr const char *front_name = "spectacle_front", *back_name = "spectacle_back";
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

/// Two surfaces and what lies between them.
struct Lens {
  ShapePtr front, back;
  double back_vertex_mm = 0;  ///< in front of the cornea
  double thickness_mm = 0;
  Medium material;
  Prism prism;
  double semi_diameter_mm = 0;
};

EyeModel with_lens(const EyeModel& eye, const Lens& lens) {
  for (const Surface& surface : eye.surfaces)
    if (surface.name == front_name || surface.name == back_name)
      throw usage_error("the eye wears a spectacle already: \"" + surface.name + "\"",
                        "put the lens before the bare eye; several lenses together are a file of surfaces");
  EyeModel result = eye;
  result.media["spectacle"] = lens.material;
  result.media["air"] = Medium{1.0, {}, {}};
  Surface front;
  front.name = front_name;
  front.shape = lens.front;
  front.position_mm = -lens.back_vertex_mm - lens.thickness_mm;
  front.medium_after = "spectacle";
  front.semi_diameter_mm = lens.semi_diameter_mm;
  front.bearer = Bearer::head;
  tilt(front, lens.prism, lens.material.index);
  Surface back;
  back.name = back_name;
  back.shape = lens.back;
  back.position_mm = -lens.back_vertex_mm;
  back.medium_after = "air";
  back.semi_diameter_mm = lens.semi_diameter_mm;
  back.bearer = Bearer::head;
  result.surfaces.insert(result.surfaces.begin(), {front, back});
  return result;
}

/// A lens that is ground, without its material.
struct Blank {
  const Shape &front, &back;
  double centre_mm = 0, rim_mm = 0;
  double slope = 0, base_rad = 0;  ///< of the prism's wedge, thick towards its base
};

/// Least thickness within the rim: of the centre and of ten rings of 36 places.
double least_thickness_mm(const Blank& blank) {
  double least = blank.centre_mm;
  constexpr int rings = 10;
  for (int ring = 1; ring <= rings; ++ring)
    for (int k = 0; k < 36; ++k) {
      const double from_centre = blank.rim_mm * ring / rings, x = from_centre * std::cos(10 * k * degree),
                   y = from_centre * std::sin(10 * k * degree);
      const auto d = blank.front.depth_mm(x, y), e = blank.back.depth_mm(x, y);
      if (!d || !e)
        throw usage_error(fmt::format("the {} of the spectacle ends within its semi-diameter of {} mm",
                                      d ? "back" : "front", blank.rim_mm),
                          "use a flatter base curve, a lower power or a smaller lens");
      const double towards_base = x * std::cos(blank.base_rad) + y * std::sin(blank.base_rad);
      least = std::min(least, blank.centre_mm + *e - *d + blank.slope * towards_base);
    }
  return least;
}

}  // namespace

EyeModel with_thin_lens(const EyeModel& eye, const PowerVector& power, double vertex_distance_mm,
                        const Prism& prism) {
  constexpr double index = 1.5;
  const SpheroCylinder notation = to_sphero_cylinder(power);
  const double curvature_per_D = 1e-3 / (1 - index);  // back surface, light from glass to air
  Lens lens;
  lens.front = make_plane();
  lens.back = make_biconic(radius_mm(notation.sphere_D * curvature_per_D),
                           radius_mm((notation.sphere_D + notation.cylinder_D) * curvature_per_D), 0, 0,
                           notation.axis_deg);
  lens.back_vertex_mm = vertex_distance_mm;
  lens.thickness_mm = slab_mm + slab_radius_mm * std::tan(tilt_rad(prism, index));
  lens.material.index = index;
  lens.prism = prism;
  return with_lens(eye, lens);
}

EyeModel with_plano_cylinder(const EyeModel& eye, double radius, double axis_deg, double distance_mm,
                             double index, double centre_thickness_mm) {
  Lens lens;
  lens.front = make_plane();
  lens.back = make_biconic(flat_radius_mm, radius, 0, 0, axis_deg);
  lens.back_vertex_mm = distance_mm;
  lens.thickness_mm = centre_thickness_mm;
  lens.material.index = index;
  return with_lens(eye, lens);
}

EyeModel with_meniscus(const EyeModel& eye, const Meniscus& meniscus) {
  Medium material;
  double index = meniscus.index;
  if (meniscus.abbe) {
    material.dispersion = {Dispersion::Formula::abbe, {meniscus.index, *meniscus.abbe}};
    material.index = material.dispersion.formula_index(eye.reference_wavelength_nm);
    index = material.dispersion.formula_index(prescription_nm);
  } else {
    material.index = index;
  }
  const double front_radius_mm = radius_mm(meniscus.base_D * 1e-3 / (index - 1));
  const ShapePtr front = make_sphere(front_radius_mm);
  const SpheroCylinder power = to_sphero_cylinder(meniscus.power);
  const auto back_of = [&](double thickness_mm) {
    // F'v = F1 / (1 - F1 t/n) + F2, and F2 = (1 - n) / R2
    const double from_front = meniscus.base_D / (1 - 1e-3 * thickness_mm / index * meniscus.base_D);
    const auto radius = [&](double vertex_power_D) {
      return radius_mm((vertex_power_D - from_front) * 1e-3 / (1 - index));
    };
    return make_biconic(radius(power.sphere_D), radius(power.sphere_D + power.cylinder_D), 0, 0,
                        power.axis_deg);
  };
  const auto least_of = [&](double thickness_mm) {
    const ShapePtr its_back = back_of(thickness_mm);
    return least_thickness_mm({*front, *its_back, thickness_mm, meniscus.semi_diameter_mm,
                               std::tan(tilt_rad(meniscus.prism, index)), meniscus.prism.base_deg * degree});
  };
  double thickness = meniscus.centre_thickness_mm.value_or(usual_thickness_mm);
  // The back follows from the thickness, and weakly: a few rounds settle both to a micrometre.
  for (int round = 0; round < 8 && !meniscus.centre_thickness_mm; ++round)
    thickness = std::max(usual_thickness_mm, thickness + least_edge_mm - least_of(thickness));
  const ShapePtr back = back_of(thickness);
  if (!(least_of(thickness) > 0))
    throw usage_error(
        fmt::format("a spectacle {} mm thick at its centre has no glass left somewhere within {} mm of it",
                    thickness, meniscus.semi_diameter_mm),
        "make it thicker or smaller");
  Lens lens;
  lens.front = front;
  lens.back = back;
  lens.back_vertex_mm = meniscus.vertex_distance_mm;
  lens.thickness_mm = thickness;
  lens.material = material;
  lens.prism = meniscus.prism;
  lens.semi_diameter_mm = meniscus.semi_diameter_mm;
  return with_lens(eye, lens);
}

void PlanoCylinder::check() const {
  if (std::abs(radius_mm) < 10) throw usage_error("--plano-cylinder: a radius below 10 mm is no spectacle");
  if (!(axis_deg >= 0 && axis_deg <= 180))
    throw usage_error("--plano-cylinder: the axis must be 0 to 180 degrees");
}

EyeModel with_spectacle(const EyeModel& eye, const Spectacle& spectacle) {
  struct Put {
    const EyeModel& eye;
    EyeModel operator()(const ThinLens& lens) const {
      return with_thin_lens(eye, lens.power, lens.vertex_distance_mm, lens.prism);
    }
    EyeModel operator()(const Meniscus& lens) const { return with_meniscus(eye, lens); }
    EyeModel operator()(const PlanoCylinder& lens) const {
      return with_plano_cylinder(eye, lens.radius_mm, lens.axis_deg);
    }
    EyeModel operator()(const SurfacesFile& surfaces) const { return with_surfaces_of(eye, surfaces.file); }
  };
  return std::visit(Put{eye}, spectacle);
}

EyeModel fixed_to_head(const EyeModel& eye, const Eigen::Isometry3d& eye_from_head) {
  EyeModel result = eye;
  if (eye_from_head.isApprox(Eigen::Isometry3d::Identity(), 0)) return result;
  for (Surface& surface : result.surfaces) {
    if (surface.bearer != Bearer::head) continue;
    if (mesh_of(surface) != nullptr)
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
    if (!surface.is_stop()) surface.shape = turned_about_axis(surface.shape, roll_deg);
  }
  return result;
}

}  // namespace emmetrope::raytrace
