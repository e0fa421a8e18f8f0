#include "pipeline/eye/parametric/parametric_eye.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <numeric>
#include <optional>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"

namespace emmetrope {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::Vector3d;

/// Radius of the sphere on which the displacement's millimetres are meant.
constexpr double displacement_sphere_mm = 11;

struct Field {
  const char* name;
  double& (*of)(ParametricEye&);
};

/// Parameters that are plain fields, by their names in fit.json.
constexpr std::array<Field, 25> fields{{
    {"cornea_c_per_mm", [](ParametricEye& e) -> double& { return e.cornea_c_per_mm; }},
    {"cornea_j0_per_mm", [](ParametricEye& e) -> double& { return e.cornea_j0_per_mm; }},
    {"cornea_j45_per_mm", [](ParametricEye& e) -> double& { return e.cornea_j45_per_mm; }},
    {"cornea_q", [](ParametricEye& e) -> double& { return e.cornea_q; }},
    {"cornea_q_split", [](ParametricEye& e) -> double& { return e.cornea_q_split; }},
    {"cornea_thickness_mm", [](ParametricEye& e) -> double& { return e.cornea_thickness_mm; }},
    {"cornea_back_ratio", [](ParametricEye& e) -> double& { return e.cornea_back_ratio; }},
    {"cornea_back_form_ratio", [](ParametricEye& e) -> double& { return e.cornea_back_form_ratio; }},
    {"anterior_chamber_depth_mm", [](ParametricEye& e) -> double& { return e.anterior_chamber_depth_mm; }},
    {"lens_thickness_mm", [](ParametricEye& e) -> double& { return e.lens_thickness_mm; }},
    {"lens_anterior_radius_mm", [](ParametricEye& e) -> double& { return e.lens_anterior_radius_mm; }},
    {"lens_posterior_radius_mm", [](ParametricEye& e) -> double& { return e.lens_posterior_radius_mm; }},
    {"lens_anterior_q", [](ParametricEye& e) -> double& { return e.lens_anterior_q; }},
    {"lens_posterior_q", [](ParametricEye& e) -> double& { return e.lens_posterior_q; }},
    {"lens_decentre_x_mm", [](ParametricEye& e) -> double& { return e.lens_decentre_mm.x(); }},
    {"lens_decentre_y_mm", [](ParametricEye& e) -> double& { return e.lens_decentre_mm.y(); }},
    {"lens_tilt_x_deg", [](ParametricEye& e) -> double& { return e.lens_tilt_deg.x(); }},
    {"lens_tilt_y_deg", [](ParametricEye& e) -> double& { return e.lens_tilt_deg.y(); }},
    {"lens_equator_radius_mm", [](ParametricEye& e) -> double& { return e.lens_equator_radius_mm; }},
    {"axial_length_mm", [](ParametricEye& e) -> double& { return e.axial_length_mm; }},
    {"globe_semi_axis_x_mm", [](ParametricEye& e) -> double& { return e.globe_semi_axes_mm.x(); }},
    {"globe_semi_axis_y_mm", [](ParametricEye& e) -> double& { return e.globe_semi_axes_mm.y(); }},
    {"globe_semi_axis_z_mm", [](ParametricEye& e) -> double& { return e.globe_semi_axes_mm.z(); }},
    {"iris_diameter_mm", [](ParametricEye& e) -> double& { return e.iris_diameter_mm; }},
    {"lens_index", [](ParametricEye& e) -> double& { return e.lens_index; }},
}};

/// The field or coefficient of that name; null for a pose parameter or an unknown name.
double* find_number(ParametricEye& eye, const std::string& name) {
  for (const Field& field : fields) {
    if (name == field.name) return &field.of(eye);
  }
  for (std::size_t i = 0; i < eye.displacement_mm.size(); ++i) {
    if (name == displacement_name(i)) return &eye.displacement_mm[i];
  }
  for (int i = 0; i < corneal_form_terms; ++i) {
    if (name == corneal_form_name(i)) return &eye.cornea_zernike_um[i];
  }
  return nullptr;
}

constexpr std::array<const char*, 3> apex_names{"apex_x_mm", "apex_y_mm", "apex_z_mm"};

std::optional<int> apex_coordinate(const std::string& name) {
  const auto found = std::find(apex_names.begin(), apex_names.end(), name);
  return found == apex_names.end() ? std::nullopt
                                   : std::optional<int>(static_cast<int>(found - apex_names.begin()));
}

Vector2d gaze_deg_of(const ParametricEye& eye) { return gaze_deg(eye.lps_from_eye.linear().col(2)); }

double conic_depth(const Matrix2d& curvature, const Matrix2d& q, double x_mm, double y_mm) {
  const Vector2d p(x_mm, y_mm);
  const Vector2d cp = curvature * p;
  return p.dot(cp) / (1 + std::sqrt(1 - cp.squaredNorm() - cp.dot(q * cp)));
}

const Json& at(const Json& json, const char* key) {
  const auto found = json.find(key);
  if (found == json.end()) throw input_error(fmt::format("fitted eye: key '{}' is missing", key));
  return *found;
}

double number_at(const Json& json, const char* key) {
  const Json& value = at(json, key);
  if (!value.is_number()) throw input_error(fmt::format("fitted eye: '{}' is no number", key));
  return value.get<double>();
}

template <int n>
Eigen::Matrix<double, n, 1> vector_from(const Json& json, const std::string& key) {
  Eigen::Matrix<double, n, 1> vector;
  const bool fits = json.is_array() && json.size() == n &&
                    std::all_of(json.begin(), json.end(), [](const Json& v) { return v.is_number(); });
  if (!fits)
    throw input_error("fitted eye: '" + key + "' is not an array of " + std::to_string(n) + " numbers");
  for (int i = 0; i < n; ++i) vector[i] = json[i].get<double>();
  return vector;
}

template <typename Vector>
Json to_array(const Vector& vector) {
  Json json = Json::array();
  for (const double v : vector) json.push_back(v);
  return json;
}

void read_displacement(const Json& json, ParametricEye& eye) {
  const Json& directions = at(json, "displacement_directions");
  const Json& coefficients = at(json, "displacement_mm");
  if (!directions.is_array() || !coefficients.is_array() || directions.size() != coefficients.size()) {
    throw input_error(
        "fitted eye: 'displacement_directions' and 'displacement_mm' are not arrays of one length");
  }
  for (std::size_t i = 0; i < directions.size(); ++i) {
    eye.displacement_directions.push_back(vector_from<3>(directions[i], "displacement_directions"));
    if (!coefficients[i].is_number())
      throw input_error("fitted eye: 'displacement_mm' holds something else than numbers");
    eye.displacement_mm.push_back(coefficients[i].get<double>());
  }
  eye.displacement_width_rad = number_at(json, "displacement_width_rad");
  if (!(eye.displacement_width_rad > 0))
    throw input_error("fitted eye: 'displacement_width_rad' is not positive");
}

void read_parameters(const Json& json, ParametricEye& eye) {
  const Json& parameters = at(json, "parameters");
  const Json& covariance = at(json, "covariance");
  const std::size_t n = parameters.size();
  if (!parameters.is_array() || !covariance.is_array() || covariance.size() != n) {
    throw input_error("fitted eye: 'covariance' has not as many rows as 'parameters' has entries");
  }
  eye.covariance.resize(n, n);
  for (std::size_t i = 0; i < n; ++i) {
    const Json& name = at(parameters[i], "name");
    const Json& source = at(parameters[i], "source");
    if (!name.is_string() || !source.is_string()) {
      throw input_error("fitted eye: 'parameters' entry " + std::to_string(i) + " has no name or source");
    }
    if (eye.source.count(name.get<std::string>()) > 0)
      throw input_error("fitted eye: 'parameters' names '" + name.get<std::string>() + "' twice");
    eye.parameter_names.push_back(name.get<std::string>());
    eye.source[eye.parameter_names.back()] = source.get<std::string>();
    if (const auto prior = parameters[i].find("prior_sigma");
        prior != parameters[i].end() && !prior->is_null()) {
      if (!prior->is_number() || !(prior->get<double>() > 0))
        throw input_error("fitted eye: 'prior_sigma' of '" + eye.parameter_names.back() +
                          "' is no positive number");
      eye.prior_sigma[eye.parameter_names.back()] = prior->get<double>();
    }
    if (!has_parameter(eye, eye.parameter_names.back())) {
      throw input_error("fitted eye: unknown parameter '" + eye.parameter_names.back() + "'");
    }
    if (!covariance[i].is_array() || covariance[i].size() != n) {
      throw input_error("fitted eye: row " + std::to_string(i) + " of 'covariance' has not " +
                        std::to_string(n) + " numbers");
    }
    for (std::size_t j = 0; j < n; ++j) {
      if (!covariance[i][j].is_number())
        throw input_error("fitted eye: 'covariance' holds something else than numbers");
      eye.covariance(i, j) = covariance[i][j].get<double>();
    }
  }
}

}  // namespace

std::string displacement_name(std::size_t index) {
  const std::string digits = std::to_string(index);
  return "displacement_" + std::string(digits.size() < 3 ? 3 - digits.size() : 0, '0') + digits + "_mm";
}

Matrix2d ParametricEye::cornea_curvature_per_mm() const {
  Matrix2d curvature;
  curvature << cornea_c_per_mm + cornea_j0_per_mm, cornea_j45_per_mm, cornea_j45_per_mm,
      cornea_c_per_mm - cornea_j0_per_mm;
  return curvature;
}

Matrix2d ParametricEye::cornea_conic_constants() const {
  const double scale = std::hypot(cornea_j0_per_mm, cornea_j45_per_mm, cornea_split_scale_per_mm);
  const double q0 = cornea_q_split * cornea_j0_per_mm / scale,
               q45 = cornea_q_split * cornea_j45_per_mm / scale;
  Matrix2d q;
  q << cornea_q + q0, q45, q45, cornea_q - q0;
  return q;
}

ParametricEye::Biconic ParametricEye::cornea_biconic() const {
  const double j = std::hypot(cornea_j0_per_mm, cornea_j45_per_mm);
  const double split = cornea_q_split * j / std::hypot(j, cornea_split_scale_per_mm);
  return {1 / (cornea_c_per_mm + j), 1 / (cornea_c_per_mm - j), cornea_q + split, cornea_q - split,
          normalise_axis_deg(std::atan2(cornea_j45_per_mm, cornea_j0_per_mm) / degree / 2)};
}

bool ParametricEye::has_irregular_cornea() const {
  return std::any_of(cornea_zernike_um.begin(), cornea_zernike_um.end(), [](double c) { return c != 0; });
}

double ParametricEye::cornea_form_mm(double x_mm, double y_mm) const {
  if (!has_irregular_cornea()) return 0;
  const CornealForm form = corneal_form(x_mm, y_mm);
  return 1e-3 *
         std::inner_product(cornea_zernike_um.begin(), cornea_zernike_um.end(), form.value.begin(), 0.0);
}

double ParametricEye::cornea_anterior_depth_mm(double x_mm, double y_mm) const {
  return conic_depth(cornea_curvature_per_mm(), cornea_conic_constants(), x_mm, y_mm) +
         cornea_form_mm(x_mm, y_mm);
}

double ParametricEye::cornea_posterior_depth_mm(double x_mm, double y_mm) const {
  return cornea_thickness_mm +
         conic_depth(cornea_curvature_per_mm() / cornea_back_ratio, cornea_conic_constants(), x_mm, y_mm) +
         cornea_back_form_ratio * cornea_form_mm(x_mm, y_mm);
}

double ParametricEye::displacement_at(const Vector3d& scaled_direction) const {
  const double scale = -0.5 / (displacement_width_rad * displacement_width_rad);
  double sum = 0;
  for (std::size_t i = 0; i < displacement_mm.size(); ++i) {
    const double angle = std::acos(std::clamp(scaled_direction.dot(displacement_directions[i]), -1.0, 1.0));
    sum += displacement_mm[i] * std::exp(scale * angle * angle);
  }
  return sum;
}

Vector3d ParametricEye::globe_centre_mm() const { return {0, 0, globe_semi_axes_mm.z() - axial_length_mm}; }

Vector3d ParametricEye::retina_point(const Vector3d& scaled_direction) const {
  const double radius = 1 + displacement_at(scaled_direction) / displacement_sphere_mm;
  return globe_centre_mm() + radius * globe_semi_axes_mm.cwiseProduct(scaled_direction);
}

Vector3d ParametricEye::retina_normal(const Vector3d& scaled_direction) const {
  // Gradient of F = 1 + u(n)/11 - rho, which grows into the globe; first in scaled coordinates q = rho n.
  const double scale = -0.5 / (displacement_width_rad * displacement_width_rad);
  Vector3d gradient_of_u = Vector3d::Zero();  // with respect to the unit direction, along the sphere
  for (std::size_t i = 0; i < displacement_mm.size(); ++i) {
    const Vector3d& to = displacement_directions[i];
    const double cosine = std::clamp(scaled_direction.dot(to), -1.0, 1.0);
    const double angle = std::acos(cosine);
    const double angle_over_sine = angle > 1e-6 ? angle / std::sin(angle) : 1;
    gradient_of_u += -2 * scale * displacement_mm[i] * std::exp(scale * angle * angle) * angle_over_sine *
                     (to - cosine * scaled_direction);
  }
  const double radius = 1 + displacement_at(scaled_direction) / displacement_sphere_mm;
  const Vector3d gradient = gradient_of_u / (displacement_sphere_mm * radius) - scaled_direction;
  return gradient.cwiseQuotient(globe_semi_axes_mm).normalized();
}

double ParametricEye::pole_depth_mm() const { return -retina_point(-Vector3d::UnitZ()).z(); }

bool has_parameter(const ParametricEye& eye, const std::string& name) {
  return find_number(const_cast<ParametricEye&>(eye), name) != nullptr || apex_coordinate(name) ||
         name == "gaze_horizontal_deg" || name == "gaze_vertical_deg";
}

double ParametricEye::get(const std::string& name) const {
  // find_number only hands out an address; nothing is written through it here.
  if (const double* number = find_number(const_cast<ParametricEye&>(*this), name)) return *number;
  if (const auto i = apex_coordinate(name)) return lps_from_eye.translation()[*i];
  if (name == "gaze_horizontal_deg") return gaze_deg_of(*this).x();
  if (name == "gaze_vertical_deg") return gaze_deg_of(*this).y();
  throw Error(ExitStatus::fault, "the fitted eye has no parameter '" + name + "'");
}

void ParametricEye::set(const std::string& name, double value) {
  if (double* number = find_number(*this, name)) {
    *number = value;
  } else if (const auto i = apex_coordinate(name)) {
    lps_from_eye.translation()[*i] = value;
  } else if (name == "gaze_horizontal_deg" || name == "gaze_vertical_deg") {
    Vector2d gaze = gaze_deg_of(*this);
    gaze[name == "gaze_horizontal_deg" ? 0 : 1] = value;
    lps_from_eye = emmetrope::lps_from_eye(lps_from_eye.translation(), gaze_axis(gaze.x(), gaze.y()));
  } else {
    throw Error(ExitStatus::fault, "the fitted eye has no parameter '" + name + "'");
  }
}

Json to_json(const ParametricEye& eye) {
  Json json;
  json["laterality"] = to_string(eye.laterality);
  json["lps_from_eye"] = to_json_matrix(eye.lps_from_eye);
  json["cornea_c_per_mm"] = eye.cornea_c_per_mm;
  json["cornea_j0_per_mm"] = eye.cornea_j0_per_mm;
  json["cornea_j45_per_mm"] = eye.cornea_j45_per_mm;
  json["cornea_q"] = eye.cornea_q;
  json["cornea_q_split"] = eye.cornea_q_split;
  json["cornea_thickness_mm"] = eye.cornea_thickness_mm;
  json["cornea_back_ratio"] = eye.cornea_back_ratio;
  json["cornea_zernike_um"] = to_array(eye.cornea_zernike_um);
  json["cornea_back_form_ratio"] = eye.cornea_back_form_ratio;
  json["anterior_chamber_depth_mm"] = eye.anterior_chamber_depth_mm;
  json["lens_thickness_mm"] = eye.lens_thickness_mm;
  json["lens_anterior_radius_mm"] = eye.lens_anterior_radius_mm;
  json["lens_posterior_radius_mm"] = eye.lens_posterior_radius_mm;
  json["lens_anterior_q"] = eye.lens_anterior_q;
  json["lens_posterior_q"] = eye.lens_posterior_q;
  json["lens_decentre_mm"] = to_array(eye.lens_decentre_mm);
  json["lens_tilt_deg"] = to_array(eye.lens_tilt_deg);
  json["lens_equator_radius_mm"] = eye.lens_equator_radius_mm;
  json["axial_length_mm"] = eye.axial_length_mm;
  json["globe_semi_axes_mm"] = to_array(eye.globe_semi_axes_mm);
  json["displacement_directions"] = Json::array();
  for (const Vector3d& direction : eye.displacement_directions) {
    json["displacement_directions"].push_back(to_array(direction));
  }
  json["displacement_mm"] = to_array(eye.displacement_mm);
  json["displacement_width_rad"] = eye.displacement_width_rad;
  json["iris_diameter_mm"] = eye.iris_diameter_mm;

  json["parameters"] = Json::array();
  json["covariance"] = Json::array();
  for (std::size_t i = 0; i < eye.parameter_names.size(); ++i) {
    const std::string& name = eye.parameter_names[i];
    const auto source = eye.source.find(name);
    const auto prior_sigma = eye.prior_sigma.find(name);
    json["parameters"].push_back(
        {{"name", name},
         {"value", eye.get(name)},
         {"sigma", std::sqrt(eye.covariance(i, i))},
         {"prior_sigma", prior_sigma == eye.prior_sigma.end() ? Json(nullptr) : Json(prior_sigma->second)},
         {"source", source == eye.source.end() ? "mri" : source->second}});
    json["covariance"].push_back(to_array(eye.covariance.row(i)));
  }
  return json;
}

ParametricEye parametric_eye_from_json(const Json& json) {
  if (!json.is_object()) throw input_error("fitted eye: no JSON object");
  ParametricEye eye;
  const Json& laterality = at(json, "laterality");
  if (laterality != "od" && laterality != "os")
    throw input_error("fitted eye: 'laterality' is neither od nor os");
  eye.laterality = laterality == "od" ? Laterality::od : Laterality::os;
  eye.lps_from_eye = isometry_from_json(at(json, "lps_from_eye"));
  for (const Field& field : fields) {
    const std::string name = field.name;
    const bool in_array = name.rfind("lens_decentre", 0) == 0 || name.rfind("lens_tilt", 0) == 0 ||
                          name.rfind("globe_semi_axis", 0) == 0;
    if (!in_array && name != "lens_index") field.of(eye) = number_at(json, name.c_str());
  }
  Eigen::Map<Eigen::Matrix<double, corneal_form_terms, 1>>(eye.cornea_zernike_um.data()) =
      vector_from<corneal_form_terms>(at(json, "cornea_zernike_um"), "cornea_zernike_um");
  eye.lens_decentre_mm = vector_from<2>(at(json, "lens_decentre_mm"), "lens_decentre_mm");
  eye.lens_tilt_deg = vector_from<2>(at(json, "lens_tilt_deg"), "lens_tilt_deg");
  eye.globe_semi_axes_mm = vector_from<3>(at(json, "globe_semi_axes_mm"), "globe_semi_axes_mm");
  read_displacement(json, eye);
  read_parameters(json, eye);
  return eye;
}

}  // namespace emmetrope
