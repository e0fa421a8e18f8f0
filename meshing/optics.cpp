#include "meshing/optics.hpp"

#include <cmath>

namespace emmetrope::meshing {
namespace {

/// Parameters of the fitted eye that carry its refraction's uncertainty; the optical axial length comes on
/// top.
const std::vector<std::string>& optical_parameters() {
  static const std::vector<std::string> names{
      "cornea_c_per_mm",   "cornea_j0_per_mm",        "cornea_j45_per_mm",        "cornea_q",
      "cornea_q_split",    "cornea_back_ratio",       "cornea_thickness_mm",      "anterior_chamber_depth_mm",
      "lens_thickness_mm", "lens_anterior_radius_mm", "lens_posterior_radius_mm", "lens_anterior_q",
      "lens_posterior_q",  "lens_decentre_x_mm",      "lens_decentre_y_mm",       "lens_tilt_x_deg",
      "lens_tilt_y_deg"};
  return names;
}

}  // namespace

Json optics_json(const UncertainEye& estimate, const OpticalDefaults& defaults) {
  std::vector<std::string> names = optical_parameters();
  if (estimate.eye().has_irregular_cornea()) {
    for (int i = 0; i < corneal_form_terms; ++i) names.push_back(corneal_form_name(i));
    names.emplace_back("cornea_back_form_ratio");
  }
  const auto n = static_cast<Eigen::Index>(names.size());
  const Propagated p = estimate.propagate([&](const ParametricEye& eye) {
    Eigen::VectorXd values(n + 1);
    for (Eigen::Index i = 0; i < n; ++i) values[i] = eye.get(names[i]);
    values[n] = eye.pole_depth_mm() + defaults.retinal_depth_mm;
    return values;
  });

  Json json;
  json["eye"] = to_json(analytic_eye(estimate.eye(), nullptr, defaults));
  json["parameters"] = names;
  json["parameters"].push_back("optical_axial_length_mm");
  json["parameters"].push_back("lens_index");
  json["values"] = Json::array();
  for (const double value : p.value) json["values"].push_back(value);
  json["values"].push_back(defaults.lens_index);
  json["covariance"] = Json::array();
  for (Eigen::Index row = 0; row <= n; ++row) {
    Json numbers = Json::array();
    for (Eigen::Index column = 0; column <= n; ++column) numbers.push_back(p.covariance(row, column));
    numbers.push_back(0.0);
    json["covariance"].push_back(numbers);
  }
  // The lens' index is not in the images at all.
  Json last = Json::array();
  for (Eigen::Index column = 0; column <= n; ++column) last.push_back(0.0);
  last.push_back(defaults.lens_index_sigma * defaults.lens_index_sigma);
  json["covariance"].push_back(last);
  json["sources"] = Json::array();
  for (const Origin& origin : p.origin) json["sources"].push_back(origin.source);
  json["sources"].push_back("prior");
  json["prior_sigmas"] = Json::array();
  for (const double sigma : p.prior_sigma)
    json["prior_sigmas"].push_back(std::isfinite(sigma) ? Json(sigma) : Json(nullptr));
  json["prior_sigmas"].push_back(defaults.lens_index_sigma > 0 ? Json(defaults.lens_index_sigma)
                                                               : Json(nullptr));
  return json;
}

}  // namespace emmetrope::meshing
