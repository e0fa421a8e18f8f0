#include "meshing/biometry.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "meshing/retinal_shape.hpp"
#include "pipeline/base/astigmatism.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/instruments/topography.hpp"
#include "pipeline/eye/parametric/analytic_eye.hpp"
#include "pipeline/eye/parametric/retinal_metrics.hpp"
#include "pipeline/eye/surfaces/zernike.hpp"

namespace emmetrope::meshing {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double section_depth_mm = 2.3;

Measured measured(const Propagated& p, Eigen::Index i) {
  return Measured::from_sigma(p.value[i], p.sigma(i), p.origin[static_cast<std::size_t>(i)], "fit");
}

VectorXd lengths(const ParametricEye& eye) {
  const LensOnAxis lens = lens_on_axis(eye);
  VectorXd v(6);
  v << eye.pole_depth_mm(), eye.cornea_thickness_mm, lens.front_mm, lens.back_mm - lens.front_mm,
      eye.lens_anterior_radius_mm, eye.lens_posterior_radius_mm;
  return v;
}

VectorXd globe_extents(const ParametricEye& eye) {
  const InterfaceDistance interface = vitreoretinal_interface(eye);
  return Vector2d(globe_extent_mm(interface, Vector3d::UnitX()),
                  globe_extent_mm(interface, Vector3d::UnitY()));
}

/// Everything that keratometry and topography would see, in one vector: M, J0, J45, Q, the section's height
/// and width, then Zernike coefficients.
VectorXd corneal_numbers(const CornealDepth& cornea, const BiometryOptions& options) {
  const CornealPower power = corneal_power(cornea);
  const VectorXd zernike = corneal_zernike_um(cornea, options.zernike_zone_mm, options.zernike_order);
  VectorXd v(6 + zernike.size());
  v << power.M_D, power.J0_D, power.J45_D, asphericity(cornea),
      section_width_mm(cornea, section_depth_mm, pi / 2), section_width_mm(cornea, section_depth_mm, 0),
      zernike;
  return v;
}

VectorXd globe_centre_lps_mm(const ParametricEye& eye) { return eye.lps_from_eye * eye.globe_centre_mm(); }

/// What the images show of an irregular cornea's departure from its best toric conicoid.
Measured fitted_irregularity_um(const UncertainEye& estimate) {
  return root_sum_square(estimate.propagate(
      [](const ParametricEye& eye) { return corneal_departure_um(anterior_cornea(eye)); }));
}

/// A healthy cornea's departure from its best toric conicoid over 6 mm. Wang, Dai, Koch and Nehrawi (2003),
/// 228 eyes: anterior corneal higher-order wavefront 0.479 +- 0.124 um rms, of which spherical aberration,
/// that a conicoid has too, 0.280 um; the rest over the index step of 0.376 is a height of 1.0 um. One-sided
/// interval.
Measured usual_irregularity_um() { return {1.0, {0, 1.8}, "prior"}; }

/// What a Zernike coefficient of the corneal height (um over 6 mm) may have beside the shape that was
/// measured. Of a biconic: a healthy cornea's departure, 1.0 um rms in all, of which coma is 0.66 (0.248 um
/// of wavefront; Wang et al. 2003 as above) and trefoil taken to be alike; the rest falls with the order. Of
/// a topographer's map: coma by its centring; else its repeatability (chosen); and the noise of its points.
double departure_sigma_um(int term, double zone_mm, const Topography* topography) {
  const auto [order, frequency] = zernike_index(term);
  if (order < 3 || (order == 4 && frequency == 0)) return 0;
  constexpr double repeatability_um = 0.1;
  const bool is_coma = order == 3 && std::abs(frequency) == 1;
  const double over_6_mm = topography ? std::hypot(is_coma ? topography->coma_sigma_um : repeatability_um,
                                                   topography->term_noise_um)
                           : order == 3 ? 0.47
                           : order == 4 ? 0.2
                                        : 0.055;
  return over_6_mm * std::pow(zone_mm / 6, order);
}

Measured with_departure(const Measured& fitted, double sigma_um, const char* source) {
  if (sigma_um == 0) return fitted;
  return Measured::from_sigma(fitted.value, std::hypot(fitted.sigma(), sigma_um),
                              sigma_um > fitted.sigma() ? source : fitted.source);
}

/// A number that is told when it is implausible, and where its limits are.
struct Gate {
  const char* name;
  const char* quantity;  ///< path in biometry.json
};
constexpr Gate gates[] = {{"axial_length_mm", "axial_length_mm"},
                          {"keratometry_flat_D", "keratometry/flat/power_D"},
                          {"keratometry_steep_D", "keratometry/steep/power_D"},
                          {"cylinder_D", "keratometry/cylinder_D"},
                          {"asphericity_q", "keratometry/asphericity_q"},
                          {"corneal_thickness_mm", "corneal_thickness_mm"},
                          {"anterior_chamber_depth_mm", "anterior_chamber_depth_mm"},
                          {"lens_thickness_mm", "lens_thickness_mm"},
                          {"lens_anterior_radius_mm", "lens_anterior_radius_mm"},
                          {"lens_posterior_radius_mm", "lens_posterior_radius_mm"},
                          {"globe_width_mm", "globe_width_mm"},
                          {"globe_height_mm", "globe_height_mm"},
                          {"globe_depth_mm", "globe_depth_mm"},
                          {"interpupillary_distance_mm", "interpupillary_distance_mm"}};

}  // namespace

Keratometry keratometry_from(const Propagated& power) {
  const double mean = power.value[0];
  const Vector2d j = power.value.segment<2>(1);
  const Astigmatism astigmatism = astigmatism_of(j, power.covariance.topLeftCorner<3, 3>());
  const double half = astigmatism.half_cylinder_D;  // (steep - flat)/2
  const double var_mean = power.covariance(0, 0), cov = astigmatism.covariance_with_M_D2;
  const double var_half = astigmatism.sigma_half_cylinder_D * astigmatism.sigma_half_cylinder_D;
  const auto sigma = [](double variance) { return std::sqrt(std::max(0.0, variance)); };

  const Origin& of_mean = power.origin[0];
  const Origin& of_cylinder = power.origin[std::abs(j.x()) > std::abs(j.y()) ? 1 : 2];
  const auto axis = [&](double axis_deg) {
    return Measured{axis_deg,
                    {axis_deg - astigmatism.axis_half_width_deg, axis_deg + astigmatism.axis_half_width_deg},
                    of_cylinder.source,
                    {},
                    of_cylinder.image_share};
  };

  Keratometry k;
  k.flat_power_D = Measured::from_sigma(mean - half, sigma(var_mean + var_half - 2 * cov), of_mean);
  k.steep_power_D = Measured::from_sigma(mean + half, sigma(var_mean + var_half + 2 * cov), of_mean);
  const auto radius = [&](const Measured& power_D) {
    const double r = keratometric_D_mm / power_D.value;
    return Measured::from_sigma(r, r / power_D.value * power_D.sigma(), of_mean);
  };
  k.flat_radius_mm = radius(k.flat_power_D);
  k.steep_radius_mm = radius(k.steep_power_D);
  k.flat_axis_deg = axis(astigmatism.axis_deg);
  k.steep_axis_deg = axis(normalise_axis_deg(astigmatism.axis_deg + 90));
  k.cylinder_D = Measured::from_sigma(2 * half, 2 * sigma(var_half), of_cylinder);
  k.cylinder_D.ci95[0] = std::max(0.0, k.cylinder_D.ci95[0]);
  return k;
}

Json biometry_json(const UncertainEye& estimate, const BiometryOptions& options,
                   const Topography* topography) {
  const ParametricEye& eye = estimate.eye();
  const Propagated length = estimate.propagate(lengths);
  const Propagated globe = estimate.propagate(globe_extents);
  const Propagated cornea = estimate.propagate([&](const ParametricEye& e) {
    return corneal_numbers(topography ? anterior_cornea(e, *topography) : anterior_cornea(e), options);
  });
  const Keratometry k = keratometry_from(cornea);

  Measured optical = measured(length, 0);
  optical.value += options.retinal_depth_mm;
  for (double& bound : optical.ci95) bound += options.retinal_depth_mm;

  Json json;
  json["laterality"] = to_string(eye.laterality);
  json["lps_from_eye"] = to_json_matrix(eye.lps_from_eye);
  json["axial_length_mm"] = measured(length, 0);
  json["optical_axial_length_mm"] = optical;
  json["corneal_thickness_mm"] = measured(length, 1);
  json["anterior_chamber_depth_mm"] = measured(length, 2);
  json["lens_thickness_mm"] = measured(length, 3);
  json["lens_anterior_radius_mm"] = measured(length, 4);
  json["lens_posterior_radius_mm"] = measured(length, 5);
  json["globe_width_mm"] = measured(globe, 0);
  json["globe_height_mm"] = measured(globe, 1);
  json.update(retinal_shape_json(estimate));
  json["keratometry"] = {
      {"flat", {{"radius_mm", k.flat_radius_mm}, {"power_D", k.flat_power_D}, {"axis_deg", k.flat_axis_deg}}},
      {"steep",
       {{"radius_mm", k.steep_radius_mm}, {"power_D", k.steep_power_D}, {"axis_deg", k.steep_axis_deg}}},
      {"cylinder_D", k.cylinder_D},
      {"asphericity_q", measured(cornea, 3)}};
  json["astigmatism"] = {
      {"M_D", measured(cornea, 0)},
      {"J0_D", measured(cornea, 1)},
      {"J45_D", measured(cornea, 2)},
      {"type", astigmatism_type(k.steep_axis_deg.value)},
      {"irregularity_um", topography                   ? topography->irregularity_um
                          : eye.has_irregular_cornea() ? fitted_irregularity_um(estimate)
                                                       : usual_irregularity_um()},
      {"section_2p3mm", {{"vertical_mm", measured(cornea, 4)}, {"horizontal_mm", measured(cornea, 5)}}}};
  json["cornea_zernike_um"] = Json::array();
  const bool free_form = eye.has_irregular_cornea() && !topography;
  for (Eigen::Index i = 6; i < cornea.value.size(); ++i) {
    const double departure_um =
        free_form ? 0 : departure_sigma_um(static_cast<int>(i) - 6, options.zernike_zone_mm, topography);
    json["cornea_zernike_um"].push_back(
        with_departure(measured(cornea, i), departure_um, topography ? "topography" : "prior"));
  }
  json["zone_mm"] = options.zernike_zone_mm;
  return json;
}

Measured interpupillary_distance_mm(const UncertainEye& od, const UncertainEye& os, double scale_sd,
                                    double head_motion_sd_mm) {
  const Propagated right = od.propagate(globe_centre_lps_mm), left = os.propagate(globe_centre_lps_mm);
  const Vector3d between = left.value - right.value;
  const Vector3d along = between.normalized();
  const Eigen::Matrix3d covariance = right.covariance + left.covariance;
  const double sigma_mm =
      std::hypot(std::sqrt(along.dot(covariance * along)), scale_sd * between.norm(), head_motion_sd_mm);
  return Measured::from_sigma(between.norm(), sigma_mm, right.origin[0]);
}

std::string PlausibilityFlag::describe() const {
  return fmt::format("{} is {:.4g}, outside the plausible {:g} to {:g}", name, value, plausible.low,
                     plausible.high);
}

std::vector<PlausibilityFlag> plausibility(const Json& biometry) {
  std::vector<PlausibilityFlag> flags;
  for (const Gate& gate : gates) {
    const Json::json_pointer place(std::string("/") + gate.quantity);
    // An interpupillary distance of one eye is not there.
    if (!biometry.contains(place) || is_withheld(biometry.at(place))) continue;
    PlausibilityFlag& flag = flags.emplace_back();
    flag.name = gate.name;
    flag.value = biometry.at(place).get<Measured>().value;
    flag.plausible = limits_of(gate.quantity).plausible;
  }
  return flags;
}

Json to_json(const std::vector<PlausibilityFlag>& flags) {
  Json json = Json::array();
  for (const PlausibilityFlag& flag : flags) {
    json.push_back({{"name", flag.name},
                    {"value", flag.value},
                    {"low", flag.plausible.low},
                    {"high", flag.plausible.high},
                    {"passed", flag.passed()}});
  }
  return json;
}

}  // namespace emmetrope::meshing
