#include "data_samples/phantom/truth.hpp"

#include <algorithm>
#include <cmath>

#include "data_samples/phantom/true_optics.hpp"
#include "pipeline/base/astigmatism.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/base/version.hpp"
#include "pipeline/eye/instruments/topography.hpp"
#include "pipeline/eye/optics/paraxial.hpp"
#include "pipeline/eye/parametric/corneal_metrics.hpp"
#include "pipeline/eye/parametric/retinal_metrics.hpp"
#include "pipeline/eye/population/population.hpp"
#include "pipeline/eye/surfaces/zernike.hpp"

namespace emmetrope::phantom {
namespace {

using Eigen::Vector3d;

constexpr double keratometry_zone_mm = 1.5;
constexpr double zernike_zone_mm = 6;
constexpr int zernike_order = 6;

/// A meridian of a biconic is a conic: curvature at the apex and asphericity.
struct Meridian {
  double curvature_per_mm, q;
};

Meridian meridian(const EyeGeometry& eye, double meridian_deg) {
  const double angle = (meridian_deg - eye.cornea_axis_deg) * degree;
  const double c2 = std::cos(angle) * std::cos(angle);
  const double s2 = 1 - c2;
  const double rx = eye.cornea_radius_x_mm;
  const double ry = eye.cornea_radius_y_mm;
  const double curvature = c2 / rx + s2 / ry;
  const double k = (1 + eye.cornea_q_x) * c2 / (rx * rx) + (1 + eye.cornea_q_y) * s2 / (ry * ry);
  return {curvature, k / (curvature * curvature) - 1};
}

/// Width of the cornea's section at a depth along a meridian.
double section_mm(const EyeGeometry& eye, double meridian_deg, double depth_mm) {
  const Meridian m = meridian(eye, meridian_deg);
  return 2 * std::sqrt(2 * depth_mm / m.curvature_per_mm - (1 + m.q) * depth_mm * depth_mm);
}

/// Zernike terms (OSA) of the cornea's height over the zone, by quadrature: Gauss-like in area, even in
/// angle.
Json corneal_zernike_um(const EyeGeometry& eye) {
  constexpr int rings = 200;
  constexpr int spokes = 48;
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(zernike_count(zernike_order));
  for (int i = 0; i < rings; ++i)
    for (int j = 0; j < spokes; ++j) {
      const double rho = std::sqrt((i + 0.5) / rings);  // rings of equal area
      const double x = rho * std::cos(2 * pi * j / spokes), y = rho * std::sin(2 * pi * j / spokes);
      const double height_um =
          -1000 * anterior_cornea_depth_mm(eye, x * zernike_zone_mm / 2, y * zernike_zone_mm / 2);
      sum += height_um * zernike_values(zernike_order, x, y);
    }
  Json terms = Json::array();
  for (const double term : sum) terms.push_back(term / (rings * spokes));
  return terms;
}

/// As the contract defines its numbers on a surface without symmetry: no closed form.
Json irregular_cornea_truth(const EyeGeometry& eye) {
  const CornealDepth depth = [&](double x, double y) { return anterior_cornea_depth_mm(eye, x, y); };
  const CornealPower power = corneal_power(depth);
  const double half = std::hypot(power.J0_D, power.J45_D);
  const double flat_deg = normalise_axis_deg(std::atan2(power.J45_D, power.J0_D) / degree / 2);
  const double steep_deg = normalise_axis_deg(flat_deg + 90);
  const auto meridian = [](double power_D, double axis_deg) {
    return Json{{"radius_mm", keratometric_D_mm / power_D}, {"power_D", power_D}, {"axis_deg", axis_deg}};
  };
  Json json = Json::object();
  json["keratometry"] = {{"flat", meridian(power.M_D - half, flat_deg)},
                         {"steep", meridian(power.M_D + half, steep_deg)},
                         {"cylinder_D", 2 * half},
                         {"asphericity_q", asphericity(depth)}};
  json["astigmatism"] = {{"M_D", power.M_D},
                         {"J0_D", power.J0_D},
                         {"J45_D", power.J45_D},
                         {"type", astigmatism_type(steep_deg)},
                         {"irregularity_um", irregularity_um(depth)},
                         {"section_2p3mm",
                          {{"vertical_mm", section_width_mm(depth, 2.3, pi / 2)},
                           {"horizontal_mm", section_width_mm(depth, 2.3, 0)}}}};
  return json;
}

Json cornea_truth(const EyeGeometry& eye) {
  if (eye.cone_height_um != 0) return irregular_cornea_truth(eye);
  const auto power = [&](double angle) { return keratometric_D_mm / keratometric_radius_mm(eye, angle); };
  // A biconic is symmetric about its principal meridians, so there the power is extreme.
  double flat_deg = normalise_axis_deg(eye.cornea_axis_deg);
  double steep_deg = normalise_axis_deg(eye.cornea_axis_deg + 90);
  if (power(flat_deg) > power(steep_deg)) std::swap(flat_deg, steep_deg);
  const double steep_D = power(steep_deg);
  const double flat_D = power(flat_deg);
  double q = 0;
  for (int i = 0; i < 180; ++i) q += meridian(eye, i).q / 180;

  Json json = Json::object();
  json["keratometry"] = {
      {"flat", {{"radius_mm", keratometric_D_mm / flat_D}, {"power_D", flat_D}, {"axis_deg", flat_deg}}},
      {"steep", {{"radius_mm", keratometric_D_mm / steep_D}, {"power_D", steep_D}, {"axis_deg", steep_deg}}},
      {"cylinder_D", steep_D - flat_D},
      {"asphericity_q", q}};
  const double half = (steep_D - flat_D) / 2;
  json["astigmatism"] = {
      {"M_D", (steep_D + flat_D) / 2},
      {"J0_D", half * std::cos(2 * flat_deg * degree)},
      {"J45_D", half * std::sin(2 * flat_deg * degree)},
      {"type", astigmatism_type(steep_deg)},
      {"irregularity_um", 0.0},
      {"section_2p3mm",
       {{"vertical_mm", section_mm(eye, 90, 2.3)}, {"horizontal_mm", section_mm(eye, 0, 2.3)}}}};
  return json;
}

/// Where the eye's axis meets a lens surface: with tilt and decentre not quite at its vertex.
double lens_depth_mm(const EyeGeometry& eye, bool front) {
  const double a = eye.lens_tilt_x_deg * degree;
  const double b = eye.lens_tilt_y_deg * degree;
  const double middle = eye.anterior_chamber_depth_mm + eye.lens_thickness_mm / 2;
  const Eigen::Matrix3d lens_from_eye =
      (Eigen::AngleAxisd(b, Vector3d::UnitY()) * Eigen::AngleAxisd(a, Vector3d::UnitX()))
          .toRotationMatrix()
          .transpose();
  const double radius = front ? eye.lens_anterior_radius_mm : eye.lens_posterior_radius_mm;
  const double q = front ? eye.lens_anterior_q : eye.lens_posterior_q;
  const double sign = front ? 1 : -1;
  // Newton in z along the axis on sign * z_lens + depth(r) - thickness / 2 = 0; the slope is close to sign.
  double z = sign * eye.lens_thickness_mm / 2;
  for (int i = 0; i < 20; ++i) {
    const Vector3d p = lens_from_eye * Vector3d(-eye.lens_decentre_x_mm, -eye.lens_decentre_y_mm, z);
    const double r2 = p.head<2>().squaredNorm();
    const double depth = r2 / radius / (1 + std::sqrt(1 - (1 + q) * r2 / (radius * radius)));
    z -= sign * (sign * p.z() + depth - eye.lens_thickness_mm / 2);
  }
  return middle - z;
}

/// From the globe's centre.
InterfaceDistance interface_of(const PlacedEye& eye) {
  const EyeGeometry& g = eye.geometry;
  const Eigen::Rotation2Dd turn(g.globe_axis_deg * degree);
  const Vector3d centre(0, 0, -eye.globe_centre_depth_mm());
  return [eye, turn, centre, half_axes = Vector3d(g.globe_semi_x_mm, g.globe_semi_y_mm, g.globe_semi_z_mm)](
             const Vector3d& direction) {
    Vector3d scaled = direction;
    scaled.head<2>() = turn.inverse() * scaled.head<2>();
    scaled = scaled.cwiseQuotient(half_axes).normalized();
    scaled.head<2>() = turn * scaled.head<2>();
    return (retina_point(eye, scaled) - centre).norm();
  };
}

Json globe_truth(const PlacedEye& eye) {
  const InterfaceDistance interface = interface_of(eye);
  const EyeGeometry& g = eye.geometry;
  const BestEllipsoid narrow = best_ellipsoid(interface, 120), wide = best_ellipsoid(interface, 240);
  const LensBack lens{g.anterior_chamber_depth_mm + g.lens_thickness_mm, g.lens_posterior_radius_mm,
                      g.lens_posterior_q, g.lens_equator_radius_mm};
  const auto meridians = [](const Eigen::Vector2d& v) {
    return Json{{"horizontal", v.x()}, {"vertical", v.y()}};
  };
  return {{"globe_width_mm", globe_extent_mm(interface, Vector3d::UnitX())},
          {"globe_height_mm", globe_extent_mm(interface, Vector3d::UnitY())},
          {"globe_depth_mm", globe_extent_mm(interface, Vector3d::UnitZ())},
          {"retina",
           {{"vertex_radius_mm", meridians(wide.vertex_radius_mm)},
            {"vertex_radius_120_mm", meridians(narrow.vertex_radius_mm)},
            {"q_120", narrow.q},
            {"q_240", wide.q},
            {"axis_120_deg", meridians(narrow.axis_deg)},
            {"axis_240_deg", meridians(wide.axis_deg)},
            {"tilt_deg", meridians(rim_tilt_deg(interface, 120))},
            {"volume_mm3", vitreous_volume_mm3(interface, eye.globe_centre_depth_mm(), lens)},
            {"area_mm2", retinal_area_mm2(interface, 240)},
            {"staphyloma_index", macular_curvature_index(interface)}}}};
}

}  // namespace

double keratometric_radius_mm(const EyeGeometry& eye, double meridian_deg) {
  const Meridian m = meridian(eye, meridian_deg);
  const double radius = 1 / m.curvature_per_mm;
  return std::sqrt(radius * radius - m.q * keratometry_zone_mm * keratometry_zone_mm);
}

Vector3d retina_point(const PlacedEye& eye, const Vector3d& scaled_direction) {
  const EyeGeometry& g = eye.geometry;
  const double away = std::hypot(g.bulge_x_deg, g.bulge_y_deg) * degree;
  const double around = std::atan2(g.bulge_y_deg, g.bulge_x_deg);
  const Vector3d bulge(std::sin(away) * std::cos(around), std::sin(away) * std::sin(around), -std::cos(away));
  const double angle = std::acos(std::clamp(scaled_direction.dot(bulge), -1.0, 1.0));
  const double width = g.bulge_width_deg * degree;
  const double radius = 1 + g.bulge_height_mm / 11 * std::exp(-0.5 * angle * angle / (width * width));
  const Eigen::Rotation2Dd turn(g.globe_axis_deg * degree);
  Vector3d in_globe = scaled_direction;
  in_globe.head<2>() = turn.inverse() * in_globe.head<2>();
  Vector3d p =
      radius * Vector3d(g.globe_semi_x_mm, g.globe_semi_y_mm, g.globe_semi_z_mm).cwiseProduct(in_globe);
  p.head<2>() = turn * p.head<2>();
  return p - Vector3d(0, 0, eye.globe_centre_depth_mm());
}

double pole_depth_mm(const EyeGeometry& eye) {
  PlacedEye placed;
  placed.geometry = eye;
  return -retina_point(placed, -Vector3d::UnitZ()).z();
}

Json eye_truth(const PlacedEye& eye, double lens_index) {
  const EyeGeometry& g = eye.geometry;
  HeadGeometry holder;
  holder.od = g;
  Json json = Json::object();
  json["laterality"] = to_string(eye.laterality);
  json["lps_from_eye"] = to_json_matrix(eye.lps_from_eye);
  json["axial_length_mm"] = pole_depth_mm(g);
  json["optical_axial_length_mm"] = pole_depth_mm(g) + usual_retinal_depth_mm;
  json["corneal_thickness_mm"] = g.cornea_thickness_mm;
  const double front = lens_depth_mm(g, true);
  json["anterior_chamber_depth_mm"] = front;
  json["lens_thickness_mm"] = lens_depth_mm(g, false) - front;
  json["lens_anterior_radius_mm"] = g.lens_anterior_radius_mm;
  json["lens_posterior_radius_mm"] = g.lens_posterior_radius_mm;
  json.update(globe_truth(eye));
  json.update(cornea_truth(g));
  json["cornea_zernike_um"] = corneal_zernike_um(g);
  json["zone_mm"] = zernike_zone_mm;
  json["lens_index"] = lens_index;
  const EyeModel optics = true_optics(eye, lens_index);
  const PowerVector refraction = paraxial_refraction(optics, optics.reference_wavelength_nm);
  json["refraction"] = {{"M_D", refraction.M_D}, {"J0_D", refraction.J0_D}, {"J45_D", refraction.J45_D}};
  const Vector3d centre = eye.globe_centre_lps();
  json["globe_centre_lps_mm"] = {centre.x(), centre.y(), centre.z()};
  json["geometry"] = to_json(holder)["od"];
  json["optics"] = to_json(optics);
  return json;
}

Json truth(const HeadGeometry& head) {
  Json json = Json::object();
  json["synthetic"] = true;
  json["program"] = "emmetrope phantom " + version();
  json["age_years"] = head.age_years;
  json["head_roll_deg"] = head.roll_deg;
  json["interpupillary_distance_mm"] = head.interpupillary_distance_mm;
  for (const Laterality laterality : both_eyes) {
    Json& eye = json["eyes"][to_string(laterality)] = eye_truth(place(head, laterality), head.lens_index);
    for (const char* of_head : {"head_roll_deg", "interpupillary_distance_mm"}) eye[of_head] = json[of_head];
  }
  json["head"] = to_json(head);
  return json;
}

}  // namespace emmetrope::phantom
