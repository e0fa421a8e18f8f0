#pragma once
#include <algorithm>
#include <random>
#include <string>

#include "pipeline/base/frames.hpp"
#include "pipeline/eye/parametric/parametric_eye.hpp"

namespace emmetrope {

/// An eye within what people have, with a bulging retina and a covariance like a surface coil's.
inline ParametricEye random_eye(unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  const auto about = [&](double mean, double sigma) { return mean + sigma * normal(random); };
  ParametricEye eye;
  eye.laterality = seed % 2 == 0 ? Laterality::od : Laterality::os;
  const double h = about(0, 0.2), v = about(0, 0.15);
  eye.lps_from_eye = lps_from_eye({about(0, 30), -60, 20}, {std::sin(h), -std::cos(h), std::tan(v)});
  eye.cornea_c_per_mm = 1 / about(7.8, 0.25);
  eye.cornea_j0_per_mm = about(0, 0.003);
  eye.cornea_j45_per_mm = about(0, 0.002);
  eye.cornea_q = about(-0.2, 0.12);
  eye.anterior_chamber_depth_mm = about(3.5, 0.3);
  eye.lens_thickness_mm = about(3.9, 0.3);
  eye.lens_anterior_radius_mm = about(10.5, 1);
  eye.lens_posterior_radius_mm = about(6, 0.5);
  eye.lens_decentre_mm = {about(0, 0.15), about(0, 0.15)};
  eye.lens_tilt_deg = {about(0, 2), about(0, 2)};
  eye.axial_length_mm = about(24, 1.2);
  eye.globe_semi_axes_mm = {about(11.6, 0.4), about(11.5, 0.4), eye.axial_length_mm / 2 - 0.6};
  for (int i = 0; i < 60; ++i) {  // Fibonacci points, none over the cornea
    const double z = -1 + 1.6 * (i + 0.5) / 60, a = i * 2.399963;
    const double r = std::sqrt(1 - z * z);
    eye.displacement_directions.emplace_back(r * std::cos(a), r * std::sin(a), z);
    eye.displacement_mm.push_back(about(0, 0.05));
  }
  eye.cornea_q_split = about(0, 0.05);

  const auto knows = [&](const std::string& name, double sigma, const char* source) {
    eye.parameter_names.push_back(name);
    eye.source[name] = source;
    const Eigen::Index n = eye.covariance.rows();
    eye.covariance.conservativeResizeLike(Eigen::MatrixXd::Zero(n + 1, n + 1));
    eye.covariance(n, n) = sigma * sigma;
  };
  for (const char* name : {"apex_x_mm", "apex_y_mm", "apex_z_mm"}) knows(name, 0.03, "mri");
  for (const char* name : {"gaze_horizontal_deg", "gaze_vertical_deg"}) knows(name, 0.2, "mri");
  knows("cornea_c_per_mm", 0.0018, "mri");
  knows("cornea_j0_per_mm", 0.0008, "mri");
  knows("cornea_j45_per_mm", 0.0008, "mri");
  knows("cornea_q", 0.1, "prior");
  knows("cornea_q_split", 0.04, "prior");
  knows("anterior_chamber_depth_mm", 0.015, "mri");
  knows("lens_thickness_mm", 0.015, "mri");
  knows("lens_anterior_radius_mm", 0.3, "mri");
  knows("lens_posterior_radius_mm", 0.2, "mri");
  for (const char* name : {"lens_decentre_x_mm", "lens_decentre_y_mm"}) knows(name, 0.03, "mri");
  for (const char* name : {"lens_tilt_x_deg", "lens_tilt_y_deg"}) knows(name, 0.5, "mri");
  knows("axial_length_mm", 0.04, "mri");
  knows("globe_semi_axis_x_mm", 0.02, "mri");
  knows("globe_semi_axis_y_mm", 0.02, "mri");
  knows("globe_semi_axis_z_mm", 0.02, "mri");
  for (std::size_t i = 0; i < eye.displacement_mm.size(); ++i) knows(displacement_name(i), 0.03, "mri");
  for (const PopulationValue& known : population_values()) eye.prior_sigma[known.parameter] = known.sigma;
  // The front surface of the cornea and the length trade against each other, as in a fit.
  const auto correlate = [&](const char* a, const char* b, double r) {
    const auto index = [&](const char* name) {
      return std::find(eye.parameter_names.begin(), eye.parameter_names.end(), name) -
             eye.parameter_names.begin();
    };
    const auto i = index(a), j = index(b);
    eye.covariance(i, j) = eye.covariance(j, i) = r * std::sqrt(eye.covariance(i, i) * eye.covariance(j, j));
  };
  correlate("cornea_c_per_mm", "axial_length_mm", 0.4);
  correlate("cornea_j0_per_mm", "cornea_j45_per_mm", -0.3);
  return eye;
}

}  // namespace emmetrope
