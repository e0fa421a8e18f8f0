#include "data_samples/phantom/geometry.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <functional>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"

namespace emmetrope::phantom {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Vector3d;

template <class Owner>
struct Field {
  const char* name;
  double Owner::*member;
};

#define FIELD(owner, member) \
  Field<owner> { #member, &owner::member }
const std::vector<Field<EyeGeometry>> eye_fields{FIELD(EyeGeometry, cornea_radius_x_mm),
                                                 FIELD(EyeGeometry, cornea_radius_y_mm),
                                                 FIELD(EyeGeometry, cornea_q_x),
                                                 FIELD(EyeGeometry, cornea_q_y),
                                                 FIELD(EyeGeometry, cornea_axis_deg),
                                                 FIELD(EyeGeometry, cone_height_um),
                                                 FIELD(EyeGeometry, cone_width_mm),
                                                 FIELD(EyeGeometry, cone_x_mm),
                                                 FIELD(EyeGeometry, cone_y_mm),
                                                 FIELD(EyeGeometry, cone_back_ratio),
                                                 FIELD(EyeGeometry, cornea_thickness_mm),
                                                 FIELD(EyeGeometry, cornea_back_ratio),
                                                 FIELD(EyeGeometry, limbus_radius_mm),
                                                 FIELD(EyeGeometry, anterior_chamber_depth_mm),
                                                 FIELD(EyeGeometry, lens_thickness_mm),
                                                 FIELD(EyeGeometry, lens_anterior_radius_mm),
                                                 FIELD(EyeGeometry, lens_posterior_radius_mm),
                                                 FIELD(EyeGeometry, lens_anterior_q),
                                                 FIELD(EyeGeometry, lens_posterior_q),
                                                 FIELD(EyeGeometry, lens_decentre_x_mm),
                                                 FIELD(EyeGeometry, lens_decentre_y_mm),
                                                 FIELD(EyeGeometry, lens_tilt_x_deg),
                                                 FIELD(EyeGeometry, lens_tilt_y_deg),
                                                 FIELD(EyeGeometry, lens_equator_radius_mm),
                                                 FIELD(EyeGeometry, iris_diameter_mm),
                                                 FIELD(EyeGeometry, iris_thickness_mm),
                                                 FIELD(EyeGeometry, ciliary_thickness_mm),
                                                 FIELD(EyeGeometry, axial_length_mm),
                                                 FIELD(EyeGeometry, globe_semi_x_mm),
                                                 FIELD(EyeGeometry, globe_semi_y_mm),
                                                 FIELD(EyeGeometry, globe_semi_z_mm),
                                                 FIELD(EyeGeometry, globe_axis_deg),
                                                 FIELD(EyeGeometry, bulge_height_mm),
                                                 FIELD(EyeGeometry, bulge_width_deg),
                                                 FIELD(EyeGeometry, bulge_x_deg),
                                                 FIELD(EyeGeometry, bulge_y_deg),
                                                 FIELD(EyeGeometry, wall_lateral_mm),
                                                 FIELD(EyeGeometry, wall_axial_mm),
                                                 FIELD(EyeGeometry, lid_thickness_mm),
                                                 FIELD(EyeGeometry, gaze_horizontal_deg),
                                                 FIELD(EyeGeometry, gaze_vertical_deg)};
/// Written down where an eye has them.
const std::vector<Field<EyeGeometry>> eye_structures{FIELD(EyeGeometry, choroid_mm),
                                                     FIELD(EyeGeometry, wall_variation),
                                                     FIELD(EyeGeometry, tendon_mm),
                                                     FIELD(EyeGeometry, nucleus_share),
                                                     FIELD(EyeGeometry, liquefied_share),
                                                     FIELD(EyeGeometry, lid_slope),
                                                     FIELD(EyeGeometry, proptosis_mm),
                                                     FIELD(EyeGeometry, tumour_mm),
                                                     FIELD(EyeGeometry, tumour_x_deg),
                                                     FIELD(EyeGeometry, tumour_y_deg),
                                                     FIELD(EyeGeometry, oil),
                                                     FIELD(EyeGeometry, buckle_mm),
                                                     FIELD(EyeGeometry, implant)};
const std::vector<Field<HeadGeometry>> head_fields{FIELD(HeadGeometry, interpupillary_distance_mm),
                                                   FIELD(HeadGeometry, roll_deg),
                                                   FIELD(HeadGeometry, position_x_mm),
                                                   FIELD(HeadGeometry, position_y_mm),
                                                   FIELD(HeadGeometry, position_z_mm),
                                                   FIELD(HeadGeometry, age_years),
                                                   FIELD(HeadGeometry, lens_index)};
#undef FIELD

/// All that can be set.
const std::vector<Field<EyeGeometry>> all_eye_fields = [] {
  std::vector<Field<EyeGeometry>> all = eye_fields;
  all.insert(all.end(), eye_structures.begin(), eye_structures.end());
  return all;
}();

template <class Owner>
std::vector<std::string> names_of(const std::vector<Field<Owner>>& fields) {
  std::vector<std::string> names;
  names.reserve(fields.size());
  for (const auto& field : fields) names.emplace_back(field.name);
  return names;
}

template <class Owner>
double* find(const std::vector<Field<Owner>>& fields, Owner& owner, const std::string& name) {
  for (const auto& field : fields)
    if (name == field.name) return &(owner.*field.member);
  return nullptr;
}

template <class Owner>
Json fields_to_json(const std::vector<Field<Owner>>& fields, const Owner& owner) {
  Json json = Json::object();
  for (const auto& field : fields) json[field.name] = owner.*field.member;
  return json;
}

Json eye_to_json(const EyeGeometry& eye) {
  static const EyeGeometry without;
  Json json = fields_to_json(eye_fields, eye);
  for (const auto& field : eye_structures)
    if (eye.*field.member != without.*field.member) json[field.name] = eye.*field.member;
  return json;
}

template <class Owner>
void assign(const std::vector<Field<Owner>>& fields, Owner& owner, const std::string& assignments) {
  for (std::size_t begin = 0; begin < assignments.size();) {
    const std::size_t end = std::min(assignments.find(',', begin), assignments.size());
    const std::string item = assignments.substr(begin, end - begin);
    begin = end + 1;
    const std::size_t equals = item.find('=');
    const std::string name = item.substr(0, equals);
    double* const number = find(fields, owner, name);
    if (number == nullptr)
      throw usage_error(fmt::format("unknown geometry key \"{}\"", name),
                        fmt::format("use one of: {}", fmt::join(names_of(fields), ", ")));
    const std::string value = equals == std::string::npos ? "" : item.substr(equals + 1);
    const auto [last, fault] = std::from_chars(value.data(), value.data() + value.size(), *number);
    if (fault != std::errc{} || last != value.data() + value.size())
      throw usage_error(fmt::format("geometry key \"{}\" needs a number, \"{}\" found", name, value),
                        fmt::format("write {}=NUMBER", name));
  }
}

EyeGeometry eye_from_json(const Json& json, const std::string& where) {
  EyeGeometry eye;
  for (const auto& [key, value] : json.items()) {
    double* const number = find(all_eye_fields, eye, key);
    if (number == nullptr) throw input_error(fmt::format("unknown key \"{}.{}\"", where, key));
    if (!value.is_number()) throw input_error(fmt::format("\"{}.{}\" is no number", where, key));
    *number = value.get<double>();
  }
  return eye;
}

/// The same eye seen from a frame that is turned by -angle about z.
EyeGeometry turned(EyeGeometry eye, double angle_deg) {
  eye.cornea_axis_deg = normalise_axis_deg(eye.cornea_axis_deg + angle_deg);
  eye.globe_axis_deg = normalise_axis_deg(eye.globe_axis_deg + angle_deg);
  const Eigen::Rotation2Dd turn(angle_deg * degree);
  const Eigen::Vector2d decentre = turn * Eigen::Vector2d(eye.lens_decentre_x_mm, eye.lens_decentre_y_mm);
  eye.lens_decentre_x_mm = decentre.x();
  eye.lens_decentre_y_mm = decentre.y();
  const Eigen::Vector2d cone = turn * Eigen::Vector2d(eye.cone_x_mm, eye.cone_y_mm);
  eye.cone_x_mm = cone.x();
  eye.cone_y_mm = cone.y();
  const Eigen::Vector2d bulge = turn * Eigen::Vector2d(eye.bulge_x_deg, eye.bulge_y_deg);
  eye.bulge_x_deg = bulge.x();
  eye.bulge_y_deg = bulge.y();
  const Eigen::Vector2d tumour = turn * Eigen::Vector2d(eye.tumour_x_deg, eye.tumour_y_deg);
  eye.tumour_x_deg = tumour.x();
  eye.tumour_y_deg = tumour.y();
  // The lens is round: its axis says all. R = Ry(b) Rx(a) takes z to (cos a sin b, -sin a, cos a cos b).
  const double a = eye.lens_tilt_x_deg * degree;
  const double b = eye.lens_tilt_y_deg * degree;
  const Vector3d axis = Eigen::AngleAxisd(angle_deg * degree, Vector3d::UnitZ()) *
                        Vector3d(std::cos(a) * std::sin(b), -std::sin(a), std::cos(a) * std::cos(b));
  eye.lens_tilt_x_deg = -std::asin(axis.y()) / degree;
  eye.lens_tilt_y_deg = std::atan2(axis.x(), axis.z()) / degree;
  return eye;
}

double cornea_depth_mm(const EyeGeometry& eye, double r_mm) {
  const double radius = 0.5 * (eye.cornea_radius_x_mm + eye.cornea_radius_y_mm);
  const double q = 0.5 * (eye.cornea_q_x + eye.cornea_q_y);
  const double s = r_mm * r_mm / radius;
  return s / (1 + std::sqrt(std::max(0.0, 1 - (1 + q) * s / radius)));
}

}  // namespace

double cone_depth_mm(const EyeGeometry& eye, double x_mm, double y_mm) {
  if (eye.cone_height_um == 0) return 0;
  const auto bulge = [&](double x, double y) {
    const double r2 = std::pow(x - eye.cone_x_mm, 2) + std::pow(y - eye.cone_y_mm, 2);
    return 1e-3 * eye.cone_height_um * std::exp(-r2 / (2 * eye.cone_width_mm * eye.cone_width_mm));
  };
  return bulge(0, 0) - bulge(x_mm, y_mm);
}

double anterior_cornea_depth_mm(const EyeGeometry& eye, double x_mm, double y_mm) {
  const Eigen::Vector2d p = Eigen::Rotation2Dd(-eye.cornea_axis_deg * degree) * Eigen::Vector2d(x_mm, y_mm);
  const double u = p.x() / eye.cornea_radius_x_mm, v = p.y() / eye.cornea_radius_y_mm;
  return (p.x() * u + p.y() * v) /
             (1 + std::sqrt(1 - (1 + eye.cornea_q_x) * u * u - (1 + eye.cornea_q_y) * v * v)) +
         cone_depth_mm(eye, x_mm, y_mm);
}

Isometry3d lps_from_head(const HeadGeometry& head) {
  Isometry3d transform = Isometry3d::Identity();
  // About +y (posterior) a positive angle takes +x to -z; the left eye is to rise.
  transform.linear() = Eigen::AngleAxisd(-head.roll_deg * degree, Vector3d::UnitY()).toRotationMatrix();
  transform.translation() = Vector3d(head.position_x_mm, head.position_y_mm, head.position_z_mm);
  return transform;
}

Isometry3d PlacedEye::lps_from_turned_eye() const {
  return lps_from_eye * Eigen::AngleAxisd(turn_deg * degree, Vector3d::UnitZ());
}

PlacedEye place(const HeadGeometry& head, Laterality laterality) {
  const EyeGeometry& eye = head.eye(laterality);
  const double side = laterality == Laterality::od ? -1 : 1;
  const double h = eye.gaze_horizontal_deg * degree;
  const double v = eye.gaze_vertical_deg * degree;
  const Vector3d axis(std::sin(h) * std::cos(v), -std::cos(h) * std::cos(v), std::sin(v));
  const Vector3d centre(side * head.interpupillary_distance_mm / 2, -eye.proptosis_mm, 0);
  const Vector3d apex = centre + (eye.axial_length_mm - eye.globe_semi_z_mm) * axis;
  const Isometry3d head_from_eye = lps_from_eye(apex, axis);
  const Isometry3d to_lps = lps_from_head(head);

  PlacedEye placed;
  placed.laterality = laterality;
  placed.lps_from_eye = lps_from_eye(to_lps * apex, to_lps.linear() * axis);
  const Matrix3d turn = placed.lps_from_eye.linear().transpose() * to_lps.linear() * head_from_eye.linear();
  placed.turn_deg = std::atan2(turn(1, 0), turn(0, 0)) / degree;
  placed.geometry = turned(eye, placed.turn_deg);
  return placed;
}

void check(const HeadGeometry& head) {
  const auto require = [](bool good, const std::string& eye, const std::string& what) {
    if (!good)
      throw usage_error(fmt::format("{}: {}", eye, what), "see docs/use/phantom.md for the geometry");
  };
  for (const Laterality laterality : both_eyes) {
    const EyeGeometry& eye = head.eye(laterality);
    const std::string name = to_string(laterality);
    for (const auto& field : all_eye_fields)
      require(std::isfinite(eye.*field.member), name, fmt::format("{} is not finite", field.name));
    for (const double radius : {eye.cornea_radius_x_mm, eye.cornea_radius_y_mm})
      require(radius > 5.5 && radius < 12, name, "cornea_radius_x_mm and _y_mm must lie between 5.5 and 12");
    for (const double q : {eye.cornea_q_x, eye.cornea_q_y})
      require(q > -1.5 && q < 0.5, name, "cornea_q_x and _y must lie between -1.5 and 0.5");
    require(eye.cornea_back_ratio > 0.7 && eye.cornea_back_ratio < 0.95, name,
            "cornea_back_ratio must lie between 0.7 and 0.95");
    require(eye.cone_height_um >= 0 && eye.cone_height_um < 200 && eye.cone_width_mm > 0.8 &&
                eye.cone_width_mm < 4 && std::hypot(eye.cone_x_mm, eye.cone_y_mm) < 3 &&
                eye.cone_back_ratio >= 0 && eye.cone_back_ratio < 4,
            name,
            "the cone must be up to 200 um high, 0.8 to 4 mm wide, within 3 mm of the apex, cone_back_ratio "
            "up to 4");
    require(eye.cornea_thickness_mm > 1e-3 * eye.cone_height_um * (eye.cone_back_ratio - 1) + 0.15, name,
            "the cone leaves less than 0.15 mm of cornea");
    require(eye.limbus_radius_mm > 4.5 && eye.limbus_radius_mm < 7, name,
            "limbus_radius_mm must lie between 4.5 and 7");
    require(eye.cornea_thickness_mm > 0.2 && eye.cornea_thickness_mm < 1, name,
            "cornea_thickness_mm must lie between 0.2 and 1");
    require(eye.anterior_chamber_depth_mm > eye.cornea_thickness_mm + 0.8, name,
            "anterior_chamber_depth_mm leaves no chamber in front of the lens");
    require(eye.lens_thickness_mm > (eye.implant != 0 ? 0.5 : 2) && eye.lens_thickness_mm < 7, name,
            "lens_thickness_mm must lie between 2 and 7 (an implant's from 0.5)");
    require(eye.lens_anterior_radius_mm > 4 && eye.lens_posterior_radius_mm > 3.5, name,
            "lens radii are too small");
    require(eye.lens_equator_radius_mm > (eye.implant != 0 ? 2.5 : 3.5) && eye.lens_equator_radius_mm < 5.5,
            name, "lens_equator_radius_mm must lie between 3.5 and 5.5 (an implant's from 2.5)");
    require(std::hypot(eye.lens_decentre_x_mm, eye.lens_decentre_y_mm) < 1.5 &&
                std::hypot(eye.lens_tilt_x_deg, eye.lens_tilt_y_deg) < 20,
            name, "the lens is decentred or tilted too far (1.5 mm, 20 deg)");
    require(eye.axial_length_mm > 18 && eye.axial_length_mm < 35, name,
            "axial_length_mm must lie between 18 and 35");
    for (const double semi : {eye.globe_semi_x_mm, eye.globe_semi_y_mm, eye.globe_semi_z_mm})
      require(semi > 8 && semi < 17, name, "globe_semi_*_mm must lie between 8 and 17");
    require(eye.axial_length_mm - 2 * eye.globe_semi_z_mm > 0.3, name,
            "the globe's ellipsoid reaches the cornea: axial_length_mm is too small for globe_semi_z_mm");
    require(eye.wall_lateral_mm > 0.2 && eye.wall_axial_mm > 0.2, name, "the wall is thinner than 0.2 mm");
    require(eye.choroid_mm >= 0 && eye.choroid_mm < std::min(eye.wall_lateral_mm, eye.wall_axial_mm), name,
            "choroid_mm must be less than the wall's thickness");
    require(std::abs(eye.wall_variation) <= 0.5 && std::abs(eye.lid_slope) <= 0.8, name,
            "wall_variation must lie within 0.5, lid_slope within 0.8");
    require(eye.nucleus_share >= 0 && eye.nucleus_share < 0.95 && eye.liquefied_share >= 0 &&
                eye.liquefied_share <= 0.8,
            name, "nucleus_share must lie between 0 and 0.95, liquefied_share between 0 and 0.8");
    require(eye.tendon_mm >= 0 && eye.tendon_mm < 4 && eye.tumour_mm >= 0 && eye.tumour_mm < 10 &&
                eye.buckle_mm >= 0 && eye.buckle_mm < 5,
            name, "tendon_mm must lie between 0 and 4, tumour_mm to 10, buckle_mm to 5");
    require(std::abs(eye.proptosis_mm) < 8, name, "proptosis_mm must lie within 8");
    require(eye.bulge_width_deg > 5 && std::abs(eye.bulge_height_mm) < 4, name,
            "bulge_width_deg must exceed 5 and bulge_height_mm lie within 4");
    require(eye.lid_thickness_mm >= 0 && eye.lid_thickness_mm < 5, name,
            "lid_thickness_mm must lie between 0 and 5");
    require(std::hypot(eye.gaze_horizontal_deg, eye.gaze_vertical_deg) < 45, name,
            "gaze is more than 45 deg off straight ahead");
  }
  const auto& [od, os] = std::tie(head.od, head.os);
  require(head.interpupillary_distance_mm / 2 > 8 + std::max(od.globe_semi_x_mm, os.globe_semi_x_mm), "head",
          "interpupillary_distance_mm leaves no nose between the globes");
}

Json to_json(const HeadGeometry& head) {
  Json json = fields_to_json(head_fields, head);
  json["od"] = eye_to_json(head.od);
  json["os"] = eye_to_json(head.os);
  return json;
}

HeadGeometry head_from_json(const Json& json) {
  HeadGeometry head;
  for (const auto& [key, value] : json.items()) {
    if (key == "od" || key == "os") {
      (key == "od" ? head.od : head.os) = eye_from_json(value, key);
      continue;
    }
    double* const number = find(head_fields, head, key);
    if (number == nullptr) throw input_error(fmt::format("unknown key \"{}\"", key));
    if (!value.is_number()) throw input_error(fmt::format("\"{}\" is no number", key));
    *number = value.get<double>();
  }
  return head;
}

void set_fields(EyeGeometry& eye, const std::string& assignments) {
  assign(all_eye_fields, eye, assignments);
}
void set_fields(HeadGeometry& head, const std::string& assignments) {
  assign(head_fields, head, assignments);
}
std::vector<std::string> eye_field_names() { return names_of(all_eye_fields); }
std::vector<std::string> head_field_names() { return names_of(head_fields); }

double matching_globe_semi_z_mm(const EyeGeometry& eye) {
  // The outer ellipsoid's front, AL - c - (c + wall) sqrt(1 - r^2/a^2), lies at the limbus' depth.
  const double lateral = 0.5 * (eye.globe_semi_x_mm + eye.globe_semi_y_mm) + eye.wall_lateral_mm;
  const double slope = std::sqrt(1 - std::pow(eye.limbus_radius_mm / lateral, 2));
  return (eye.axial_length_mm - cornea_depth_mm(eye, eye.limbus_radius_mm) - eye.wall_axial_mm * slope) /
         (1 + slope);
}

HeadGeometry sample_head() {
  HeadGeometry head;
  EyeGeometry& od = head.od;
  od.cornea_radius_x_mm = 7.89;  // 42.8 D along the flat meridian, 45.0 D along the steep one
  od.cornea_radius_y_mm = 7.49;
  od.cornea_axis_deg = 8;
  od.cornea_q_x = -0.21;
  od.cornea_q_y = -0.17;
  od.axial_length_mm = 24.1;
  od.globe_semi_x_mm = 11.62;
  od.globe_semi_y_mm = 11.48;
  od.lens_decentre_x_mm = 0.10;
  od.lens_decentre_y_mm = 0.05;
  od.lens_tilt_x_deg = 1.0;
  od.lens_tilt_y_deg = -3.0;
  od.gaze_horizontal_deg = -3;
  od.gaze_vertical_deg = -11;

  EyeGeometry& os = head.os;
  os.cornea_radius_x_mm = 7.80;
  os.cornea_radius_y_mm = 7.74;
  os.cornea_axis_deg = 172;
  os.cornea_q_x = -0.22;
  os.cornea_q_y = -0.20;
  os.axial_length_mm = 23.55;
  os.globe_semi_x_mm = 11.50;
  os.globe_semi_y_mm = 11.40;
  os.lens_decentre_x_mm = -0.08;
  os.lens_decentre_y_mm = 0.06;
  os.lens_tilt_x_deg = 0.8;
  os.lens_tilt_y_deg = 3.2;
  os.gaze_horizontal_deg = 2;
  os.gaze_vertical_deg = -12;

  for (EyeGeometry* eye : {&od, &os}) eye->globe_semi_z_mm = matching_globe_semi_z_mm(*eye);
  return head;
}

}  // namespace emmetrope::phantom
