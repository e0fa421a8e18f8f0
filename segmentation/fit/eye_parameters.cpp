#include "segmentation/fit/eye_parameters.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

#include "pipeline/base/frames.hpp"
#include "pipeline/eye/parametric/parametric_eye.hpp"
#include "segmentation/fit/corneal_form_prior.hpp"

namespace emmetrope::segmentation {
namespace {

constexpr double no_belief = 1e6;

/// Name, population mean and standard deviation. Sources are given in docs/segmentation.md, "Priors".
struct Belief {
  const char* name;
  double mean, sigma;
};

constexpr double per_dioptre = 1 / 337.5;  ///< keratometric power to curvature, 1/mm

/// A length in adults (Dubbelman and van der Heijde 2001): at_age_0_mm + per_year_mm age, between the ages
/// that were measured. The spread is that of adults of any age.
struct AgeingLength {
  double at_age_0_mm, per_year_mm, sigma_mm;

  constexpr double mean_mm(double age_years) const { return at_age_0_mm + per_year_mm * age_years; }
  /// What is left of the spread once the age is known, which varies by 15 years among them.
  double sigma_at_known_age_mm() const {
    return std::sqrt(sigma_mm * sigma_mm - std::pow(15 * per_year_mm, 2));
  }
};
constexpr AgeingLength lens_front{12.9, -0.057, 1.5}, lens_back{6.2, -0.012, 0.6};
constexpr AgeingLength chamber{3.87, -0.010, 0.35}, thickness_of_lens{2.93, 0.0236, 0.47};
constexpr double usual_age_years = 40, youngest_years = 18, oldest_years = 70;

const std::array<Belief, eye_parameter_count>& beliefs() {
  static const std::array<Belief, eye_parameter_count> table{{
      {"apex_x_mm", 0, no_belief},
      {"apex_y_mm", 0, no_belief},
      {"apex_z_mm", 0, no_belief},
      {"gaze_horizontal_deg", 0, no_belief},
      {"gaze_vertical_deg", 0, no_belief},
      {"cornea_c_per_mm", 1 / 7.8, 1.5 * per_dioptre},
      {"cornea_j0_per_mm", -0.3 * per_dioptre, 0.6 * per_dioptre},  // steeper vertically
      {"cornea_j45_per_mm", 0, 0.4 * per_dioptre},
      {"cornea_q", -0.2, 0.12},
      {"cornea_q_split", 0, 0.05},
      {"cornea_thickness_mm", 0.55, 0.035},
      {"cornea_back_ratio", 0.83, 0.015},
      {"anterior_chamber_depth_mm", 3.5, 0.6},
      {"lens_thickness_mm", 3.9, 0.6},
      {"lens_anterior_radius_mm", lens_front.mean_mm(usual_age_years), lens_front.sigma_mm},
      {"lens_posterior_radius_mm", lens_back.mean_mm(usual_age_years), lens_back.sigma_mm},
      {"lens_anterior_q", -3, 1.5},
      {"lens_posterior_q", -1, 1},
      {"lens_decentre_x_mm", 0, 0.25},
      {"lens_decentre_y_mm", 0, 0.25},
      {"lens_tilt_x_deg", 0, 3},
      {"lens_tilt_y_deg", 0, 3},
      {"lens_equator_radius_mm", 4.6, 0.3},
      {"axial_length_mm", 23.8, 2.5},
      {"globe_semi_axis_x_mm", 11.5, 1.2},
      {"globe_semi_axis_y_mm", 11.4, 1.2},
      {"globe_semi_axis_z_mm", 11.2, 1.2},
      {"wall_lateral_mm", 0.85, 0.2},
      {"wall_axial_mm", 1.2, 0.4},
      {"iris_offset_mm", -0.1, 0.15},
      {"iris_slope", 0, 0.1},
      {"iris_half_thickness_mm", 0.2, 0.03},
      {"pupil_radius_mm", 2.0, 0.8},
      {"lid_thickness_mm", 2.5, 1.0},
      {"lid_tilt_x", 0, 0.3},
      {"lid_tilt_y", 0, 0.3},
      {"lid_xx_per_mm", 0.05, 0.03},
      {"lid_yy_per_mm", 0.05, 0.03},
      {"lid_xy_per_mm", 0, 0.03},
      {"intensity_vitreous", 0, 0.5},
      {"intensity_aqueous", 0, 0.5},
      {"intensity_wall", 0, 0.5},
      {"intensity_cornea", 0, 0.15},
      {"intensity_lens", 0, 0.5},
      {"intensity_iris", 0, 0.2},
      {"intensity_lid", 0, 0.5},
      {"intensity_air", 0, 0.1},
      {"intensity_surround", 0, 0.5},
  }};
  return table;
}

bool is_intensity(int index) { return index >= vitreous && index <= surround; }

constexpr double cornea_like_wall = 0.08;  ///< relative
constexpr double curvature_per_axial_length = -0.4 * per_dioptre;
constexpr double coil_sigma = 0.3, gain_sigma = 0.3;
constexpr double shift_sigma_mm = 3;     ///< the head moves 1 to 3 mm between series
constexpr double sharpness_sigma = 0.3;  ///< zero filling and filters that the header does not tell
constexpr double turn_sigma_deg = 0.7;   ///< it turns with them
constexpr double displacement_sigma_mm = 0.06;
/// Within 40 degrees of the pole, where eyes bulge.
constexpr double bulge_sigma_mm = 0.12, posterior_cosine = -0.77;
// An ectatic cornea; the widening is the spread of its biconic in units of the regular one's.
constexpr double back_form_ratio_mean = 2.0, back_form_ratio_sigma = 0.5;
constexpr double ectatic_widening = 2.5;
constexpr double ectatic_astigmatism_sigma = 2.5 * per_dioptre;
constexpr double background_sigma_t2 = 0.25, background_sigma_t1 = 0.5;  ///< fat beside muscle

}  // namespace

std::string ParameterLayout::name(int index) const {
  if (index < eye_parameter_count) return beliefs()[index].name;
  const auto digits = [](int number) {
    const std::string text = std::to_string(number);
    return std::string(text.size() < 3 ? 3 - text.size() : 0, '0') + text;
  };
  if (index == back_form_ratio()) return "cornea_back_form_ratio";
  if (index >= corneal_form()) return corneal_form_name(index - corneal_form());
  if (index >= background()) return "background_" + digits(index - background());
  if (index >= displacement()) return displacement_name(index - displacement());
  const int at = index - eye_parameter_count;
  const std::string of_stack = "stack" + std::to_string(at / stack_parameter_count + 1) + "_";
  const int which = at % stack_parameter_count;
  if (which < coil_count) return of_stack + "coil_" + std::to_string(which);
  if (which == log_gain) return of_stack + "log_gain";
  if (which == log_sharpness) return of_stack + "log_sharpness";
  if (which >= fat_shift_first)
    return of_stack + "fat_shift_along_" + (which == fat_shift_first ? "row" : "column") + "_mm";
  if (which >= turn_first) return of_stack + "turn_" + "xyz"[which - turn_first] + "_deg";
  return of_stack + "shift_" + "xyz"[which - shift_first] + "_mm";
}

Eigen::VectorXd population_mean(const ParameterLayout& layout) {
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(layout.size());
  for (int i = 0; i < eye_parameter_count; ++i) mean[i] = beliefs()[i].mean;
  if (layout.irregular_cornea) mean[layout.back_form_ratio()] = back_form_ratio_mean;
  return mean;
}

Priors population_priors(const ParameterLayout& layout, const Eigen::VectorXd& start, Contrast contrast,
                         std::optional<double> age_years) {
  Priors priors{population_mean(layout), Eigen::VectorXd::Constant(layout.size(), no_belief)};
  for (int i = 0; i < eye_parameter_count; ++i) priors.sigma[i] = beliefs()[i].sigma;
  for (int i = 0; i < eye_parameter_count; ++i) {
    if (is_intensity(i) || i <= gaze_vertical) priors.mean[i] = start[i];
  }
  if (age_years) {
    const double age = std::clamp(*age_years, youngest_years, oldest_years);
    std::vector<std::pair<Parameter, AgeingLength>> known{{lens_anterior_radius, lens_front},
                                                          {lens_posterior_radius, lens_back}};
    // A child's chamber and lens are not those of a young adult.
    if (*age_years >= youngest_years) {
      known.emplace_back(anterior_chamber_depth, chamber);
      known.emplace_back(lens_thickness, thickness_of_lens);
    }
    for (const auto& [at, length] : known) {
      priors.mean[at] = length.mean_mm(age);
      priors.sigma[at] = length.sigma_at_known_age_mm();
    }
  }
  priors.curvature_per_axial_length = curvature_per_axial_length;
  // In T1 the vitreous is dark and the tissues around it spread over a wider range of it.
  if (contrast == Contrast::t1) {
    priors.sigma[cornea] = 0.25;
    priors.cornea_like_wall_sigma = cornea_like_wall * start[wall];
  }
  for (int s = 0; s < layout.stacks; ++s) {
    const int at = layout.stack(s);
    priors.sigma.segment(at + coil_first, coil_count).setConstant(coil_sigma);
    priors.sigma[at + log_gain] = gain_sigma;
    priors.mean[at + log_gain] = start[at + log_gain];
    priors.sigma.segment<3>(at + shift_first).setConstant(shift_sigma_mm);
    priors.sigma[at + log_sharpness] = sharpness_sigma;
    priors.sigma.segment<3>(at + turn_first).setConstant(turn_sigma_deg);
  }
  priors.sigma.segment(layout.displacement(), layout.bumps).setConstant(displacement_sigma_mm);
  if (layout.bumps > 0) {
    const std::vector<Eigen::Vector3d> directions = bump_directions();
    for (int i = 0; i < layout.bumps; ++i)
      if (directions[i].z() < posterior_cosine) priors.sigma[layout.displacement() + i] = bulge_sigma_mm;
  }
  priors.sigma.segment(layout.background(), layout.bumps)
      .setConstant(contrast == Contrast::t1 ? background_sigma_t1 : background_sigma_t2);
  return priors;
}

Priors irregular_cornea_priors(const Priors& of_regular, const ParameterLayout& layout) {
  Priors priors = of_regular;
  priors.mean.conservativeResize(layout.size());
  priors.mean.tail(corneal_form_terms + 1) = population_mean(layout).tail(corneal_form_terms + 1);
  priors.sigma.conservativeResize(layout.size());
  const Eigen::MatrixXd covariance = corneal_form_covariance_um2();
  const Eigen::VectorXd sigma = covariance.diagonal().cwiseSqrt();
  priors.sigma.segment(layout.corneal_form(), corneal_form_terms) = sigma;
  priors.corneal_form_information = sigma.asDiagonal() * covariance.inverse() * sigma.asDiagonal();
  priors.sigma[layout.back_form_ratio()] = back_form_ratio_sigma;
  for (const int parameter : {cornea_c, cornea_q, cornea_thickness})
    priors.sigma[parameter] *= ectatic_widening;
  for (const int parameter : {cornea_j0, cornea_j45}) priors.sigma[parameter] = ectatic_astigmatism_sigma;
  return priors;
}

double expected_curvature(const Priors& priors, double axial_length_mm) {
  return priors.mean[cornea_c] +
         priors.curvature_per_axial_length * (axial_length_mm - priors.mean[axial_length]);
}

Eigen::Vector3d gaze_axis(double horizontal_deg, double vertical_deg) {
  const double h = horizontal_deg * degree, v = vertical_deg * degree;
  return {std::sin(h) * std::cos(v), -std::cos(h) * std::cos(v), std::sin(v)};
}

Eigen::Vector2d gaze_deg(const Eigen::Vector3d& axis) {
  return {std::atan2(axis.x(), -axis.y()) / degree, std::asin(axis.z() / axis.norm()) / degree};
}

std::vector<Eigen::Vector3d> bump_directions() {
  constexpr int lattice = 124;            // spacing 0.32 rad, one width
  constexpr double cornea_cosine = 0.78;  // about 39 degrees around the axis, where the cornea is
  const double golden_angle = pi * (3 - std::sqrt(5.0));
  std::vector<Eigen::Vector3d> directions;
  for (int i = 0; i < lattice; ++i) {
    const double z = 1 - (2.0 * i + 1) / lattice;
    if (z > cornea_cosine) continue;
    const double r = std::sqrt(1 - z * z), angle = golden_angle * i;
    directions.push_back({r * std::cos(angle), r * std::sin(angle), z});
  }
  return directions;
}

}  // namespace emmetrope::segmentation
