#include "segmentation/fit/eye_parameters.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "pipeline/base/even_points.hpp"
#include "pipeline/eye/parametric/parametric_eye.hpp"
#include "pipeline/eye/population/population.hpp"
#include "segmentation/fit/corneal_form_prior.hpp"

namespace emmetrope::segmentation {
namespace {

constexpr double no_prior = 1e6;

/// A parameter's name in fit.json, mean and standard deviation before the image is seen. Sources are given in
/// docs/method/segmentation.md, "Priors".
struct Prior {
  std::string name;
  double mean, sigma;
};

/// In the order of `Parameter`: the pose, the population's shapes, and what only an image has.
std::vector<Prior> make_table() {
  std::vector<Prior> table{{"apex_x_mm", 0, no_prior},
                           {"apex_y_mm", 0, no_prior},
                           {"apex_z_mm", 0, no_prior},
                           {"gaze_horizontal_deg", 0, no_prior},
                           {"gaze_vertical_deg", 0, no_prior}};
  for (const PopulationValue& value : population_values())
    table.push_back({value.parameter, value.mean, value.sigma});
  table.insert(table.end(), {
                                {"wall_lateral_mm", 0.85, 0.2},
                                {"wall_axial_mm", 1.2, 0.4},
                                {"wall_inner_share", 0.45, 0.12},
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
                                {"intensity_wall_layering", 0, 0.2},
                                {"intensity_cornea", 0, 0.15},
                                {"intensity_lens", 0, 0.5},
                                {"intensity_lens_nucleus", 0, 0.08},
                                {"intensity_iris", 0, 0.2},
                                {"intensity_lid", 0, 0.5},
                                {"intensity_air", 0, 0.1},
                                {"intensity_surround", 0, 0.5},
                            });
  return table;
}

const std::vector<Prior>& prior_table() {
  static const std::vector<Prior> table = make_table();
  return table;
}

bool is_intensity(int index) { return index >= vitreous && index <= surround; }

constexpr double cornea_like_wall = 0.08;  ///< relative
/// Of the vitreous' brightness: two real eyes have 0.6 (docs/evidence/real-scans.md), phantoms 0 or 0.4; chosen.
constexpr double layering_mean_t2 = 0.2, layering_sigma_t2 = 0.15;
/// Retina and choroid lose their signal within a tenth of a second, the vitreous in more than one. Two real eyes have 0.7,
/// phantoms 0.6; chosen.
constexpr double brightest_inner_layer_t2 = 0.8;
constexpr double curvature_per_axial_length = -0.4 * per_mm_of_keratometric_D;
constexpr double coil_sigma = 0.3, gain_sigma = 0.3;
constexpr double shift_sigma_mm = 3;     ///< the head moves 1 to 3 mm between series
constexpr double sharpness_sigma = 0.3;  ///< zero filling and filters that the header does not tell
/// Decay along the echo train, partial sampling and zero filling act along one direction.
constexpr double sharpness_ratio_sigma = 0.2;
constexpr double filter_sigma = 0.4;    ///< a Hann window is 1; chosen
constexpr double turn_sigma_deg = 0.7;  ///< it turns with them
constexpr double displacement_sigma_mm = 0.06;
/// Within 40 degrees of the pole, where eyes bulge.
constexpr double bulge_sigma_mm = 0.12, posterior_cosine = -0.77;
// An ectatic cornea; the widening is the spread of its biconic in units of the regular one's.
constexpr double back_form_ratio_mean = 2.0, back_form_ratio_sigma = 0.5;
constexpr double ectatic_widening = 2.5;
constexpr double ectatic_astigmatism_sigma = 2.5 * per_mm_of_keratometric_D;
constexpr double background_sigma_t2 = 0.25, background_sigma_t1 = 0.5;  ///< fat beside muscle

}  // namespace

std::string ParameterLayout::name(int index) const {
  if (index < eye_parameter_count) return prior_table()[index].name;
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
  if (which == log_sharpness_ratio) return of_stack + "log_sharpness_ratio";
  if (which == k_space_filter) return of_stack + "k_space_filter";
  if (which == log_sharpness_through) return of_stack + "log_sharpness_through";
  if (which >= fat_shift_first)
    return of_stack + "fat_shift_along_" + (which == fat_shift_first ? "row" : "column") + "_mm";
  if (which >= turn_first) return of_stack + "turn_" + "xyz"[which - turn_first] + "_deg";
  return of_stack + "shift_" + "xyz"[which - shift_first] + "_mm";
}

Eigen::VectorXd population_mean(const ParameterLayout& layout) {
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(layout.size());
  for (int i = 0; i < eye_parameter_count; ++i) mean[i] = prior_table()[i].mean;
  if (layout.irregular_cornea) mean[layout.back_form_ratio()] = back_form_ratio_mean;
  return mean;
}

Priors population_priors(const ParameterLayout& layout, const Eigen::VectorXd& start, Weighting weighting,
                         std::optional<double> age_years) {
  Priors priors{population_mean(layout), Eigen::VectorXd::Constant(layout.size(), no_prior)};
  for (int i = 0; i < eye_parameter_count; ++i) priors.sigma[i] = prior_table()[i].sigma;
  for (int i = 0; i < eye_parameter_count; ++i) {
    if (is_intensity(i) || i <= gaze_vertical) priors.mean[i] = start[i];
  }
  if (age_years) {
    for (const PopulationValue& known : population_at_age(*age_years)) {
      const auto at = std::find_if(prior_table().begin(), prior_table().end(),
                                   [&](const Prior& prior) { return prior.name == known.parameter; }) -
                      prior_table().begin();
      priors.mean[at] = known.mean;
      priors.sigma[at] = known.sigma;
    }
  }
  priors.curvature_per_axial_length = curvature_per_axial_length;
  // In T1 the vitreous is dark and the tissues around it spread over a wider range of it.
  if (weighting == Weighting::t1) {
    priors.sigma[cornea] = 0.25;
    priors.cornea_like_wall_sigma = cornea_like_wall * start[wall];
  } else {
    priors.mean[wall_layering] = layering_mean_t2;
    priors.sigma[wall_layering] = layering_sigma_t2;
    priors.brightest_inner_layer = brightest_inner_layer_t2;
  }
  for (int s = 0; s < layout.stacks; ++s) {
    const int at = layout.stack(s);
    priors.sigma.segment(at + coil_first, coil_count).setConstant(coil_sigma);
    priors.sigma[at + log_gain] = gain_sigma;
    priors.mean[at + log_gain] = start[at + log_gain];
    priors.sigma.segment<3>(at + shift_first).setConstant(shift_sigma_mm);
    priors.sigma[at + log_sharpness] = priors.sigma[at + log_sharpness_through] = sharpness_sigma;
    priors.sigma[at + log_sharpness_ratio] = sharpness_ratio_sigma;
    priors.sigma[at + k_space_filter] = filter_sigma;
    priors.sigma.segment<3>(at + turn_first).setConstant(turn_sigma_deg);
  }
  priors.sigma.segment(layout.displacement(), layout.bumps).setConstant(displacement_sigma_mm);
  if (layout.bumps > 0) {
    const std::vector<Eigen::Vector3d> directions = bump_directions();
    for (int i = 0; i < layout.bumps; ++i)
      if (directions[i].z() < posterior_cosine) priors.sigma[layout.displacement() + i] = bulge_sigma_mm;
  }
  priors.sigma.segment(layout.background(), layout.bumps)
      .setConstant(weighting == Weighting::t1 ? background_sigma_t1 : background_sigma_t2);
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

std::vector<Eigen::Vector3d> bump_directions() {
  constexpr int lattice = 124;            // spacing 0.31 rad, one width
  constexpr double cornea_cosine = 0.78;  // it ends 39 degrees from the axis; the first ring lies at 54
  std::vector<Eigen::Vector3d> directions;
  for (const Eigen::Vector3d& direction : mirrored_directions(lattice))
    if (direction.z() <= cornea_cosine) directions.push_back(direction);
  return directions;
}

}  // namespace emmetrope::segmentation
