#include "correction/prescription/uncertain_eye.hpp"

#include <fmt/core.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/eye/optics/paraxial.hpp"
#include "pipeline/eye/parametric/analytic_eye.hpp"

namespace emmetrope::correction {
namespace {

constexpr const char* length_name = "optical_axial_length_mm";
constexpr const char* index_name = "lens_index";

/// Parameters without which the eye cannot be rebuilt.
constexpr const char* needed[] = {"cornea_c_per_mm",
                                  "cornea_j0_per_mm",
                                  "cornea_j45_per_mm",
                                  "cornea_q",
                                  "cornea_back_ratio",
                                  "cornea_thickness_mm",
                                  "anterior_chamber_depth_mm",
                                  "lens_thickness_mm",
                                  "lens_anterior_radius_mm",
                                  "lens_posterior_radius_mm",
                                  "lens_anterior_q",
                                  "lens_posterior_q",
                                  "lens_decentre_x_mm",
                                  "lens_decentre_y_mm",
                                  "lens_tilt_x_deg",
                                  "lens_tilt_y_deg",
                                  length_name,
                                  index_name};

Error invalid(const std::string& what) {
  return input_error("optics.json: " + what, "run \"emmetrope mesh --force\" on the case");
}

double distance_D(const PowerVector& a, const PowerVector& b) {
  return std::hypot(a.M_D - b.M_D, a.J0_D - b.J0_D, a.J45_D - b.J45_D);
}

void check(const UncertainEye& uncertain) {
  for (const char* parameter : needed) uncertain.index_of(parameter);
  for (const std::string& name : uncertain.parameters)
    if (name != length_name && name != index_name && !has_parameter({}, name))
      throw invalid("parameter \"" + name + "\" is not known");
  const Eigen::MatrixXd& covariance = uncertain.numbers.covariance;
  if (!uncertain.numbers.mean.allFinite() || !covariance.allFinite()) throw invalid("a number is not finite");

  const Eigen::VectorXd sigma = covariance.diagonal().cwiseMax(0).cwiseSqrt();
  const Eigen::VectorXd scale = sigma.unaryExpr([](double s) { return s > 0 ? 1 / s : 0; });
  const Eigen::MatrixXd correlation = scale.asDiagonal() * covariance * scale.asDiagonal();
  if ((correlation - correlation.transpose()).cwiseAbs().maxCoeff() > 1e-6 ||
      Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(correlation).eigenvalues().minCoeff() < -1e-6)
    throw invalid("covariance is not symmetric and positive semi-definite");

  const double wavelength_nm = uncertain.eye.reference_wavelength_nm;
  const double off_D =
      distance_D(paraxial_refraction(uncertain.eye, wavelength_nm),
                 paraxial_refraction(eye_at(uncertain, uncertain.numbers.mean), wavelength_nm));
  if (off_D > 0.05) throw invalid(fmt::format("the eye and its parameters differ by {:.2f} D", off_D));
}

}  // namespace

Eigen::Index UncertainEye::index_of(const std::string& parameter) const {
  const auto found = std::find(parameters.begin(), parameters.end(), parameter);
  if (found == parameters.end()) throw invalid("parameter \"" + parameter + "\" is missing");
  return found - parameters.begin();
}

UncertainEye uncertain_eye_from_json(const Json& optics, const std::filesystem::path& folder,
                                     double lens_index_sigma) {
  UncertainEye uncertain;
  Eigen::VectorXd& mean = uncertain.numbers.mean;
  Eigen::MatrixXd& covariance = uncertain.numbers.covariance;
  try {
    uncertain.eye = eye_from_json(optics.at("eye"), folder);
    uncertain.parameters = optics.at("parameters").get<std::vector<std::string>>();
    const auto values = optics.at("values").get<std::vector<double>>();
    const auto rows = optics.at("covariance").get<std::vector<std::vector<double>>>();
    uncertain.sources = optics.at("sources").get<std::vector<std::string>>();
    const std::size_t n = uncertain.parameters.size();
    if (values.size() != n || rows.size() != n || uncertain.sources.size() != n)
      throw invalid("parameters, values, covariance and sources differ in size");
    mean = Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(n));
    covariance.resize(static_cast<Eigen::Index>(n), static_cast<Eigen::Index>(n));
    for (std::size_t i = 0; i < n; ++i) {
      if (rows[i].size() != n) throw invalid("covariance is not square");
      for (std::size_t k = 0; k < n; ++k)
        covariance(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k)) = rows[i][k];
    }
  } catch (const nlohmann::json::exception& fault) {
    throw invalid(fault.what());
  }
  if (std::find(uncertain.parameters.begin(), uncertain.parameters.end(), index_name) ==
      uncertain.parameters.end()) {
    const Eigen::Index n = mean.size();
    uncertain.parameters.emplace_back(index_name);
    mean.conservativeResize(n + 1);
    mean[n] = uncertain.eye.media.at("lens").index;
    covariance.conservativeResizeLike(Eigen::MatrixXd::Zero(n + 1, n + 1));
    covariance(n, n) = lens_index_sigma * lens_index_sigma;
    uncertain.sources.emplace_back("prior");
  }
  check(uncertain);
  return uncertain;
}

ParametricEye parametric_eye_at(const UncertainEye& uncertain, const Eigen::VectorXd& values) {
  ParametricEye eye;
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    const std::string& name = uncertain.parameters[i];
    if (name == length_name)
      eye.set("axial_length_mm", values[i]);
    else if (name != index_name)
      eye.set(name, values[i]);
  }
  return eye;
}

EyeModel eye_at(const UncertainEye& uncertain, const Eigen::VectorXd& values) {
  const ParametricEye parametric = parametric_eye_at(uncertain, values);
  OpticalDefaults defaults;
  defaults.retinal_depth_mm = 0;
  const ShapePtr cornea =
      uncertain.topography ? anterior_cornea_shape(parametric, *uncertain.topography) : nullptr;
  EyeModel eye = uncertain.eye;
  for (const Surface& wanted : analytic_surfaces(parametric, cornea, defaults)) {
    Surface& surface = eye.surface(wanted.name);
    surface.position_mm = wanted.position_mm;
    if (wanted.is_stop() || wanted.name == "retina") continue;
    surface.shape = wanted.shape;
    surface.decentre_mm = wanted.decentre_mm;
    surface.tilt_deg = wanted.tilt_deg;
  }
  eye.media.at("lens").index = values[uncertain.index_of(index_name)];
  return eye;
}

double learn(UncertainEye& uncertain, const std::string& source, const VectorFunction& function,
             const Eigen::VectorXd& measured, const Eigen::MatrixXd& noise_covariance) {
  const Eigen::MatrixXd before = uncertain.numbers.covariance;
  const double surprise = condition(uncertain.numbers, function, measured, noise_covariance);
  for (Eigen::Index i = 0; i < before.rows(); ++i)
    if (uncertain.numbers.covariance(i, i) < before(i, i) / 2) uncertain.sources[i] = source;
  uncertain.learnt.push_back({source, before});
  uncertain.eye = eye_at(uncertain, uncertain.numbers.mean);
  return surprise;
}

std::vector<std::string> learn(UncertainEye& uncertain, const InstrumentReadings& readings) {
  std::vector<std::string> warnings;
  if (readings.topography) uncertain.topography = readings.topography;
  for (const ExternalMeasurement& measurement : readings.measurements) {
    const double surprise = learn(
        uncertain, measurement.source,
        [&](const Eigen::VectorXd& values) {
          return measurement.of_eye(parametric_eye_at(uncertain, values));
        },
        measurement.value, measurement.covariance);
    if (surprise > surprising_sigma)
      warnings.push_back(fmt::format("{} and the images differ by {:.1f} standard deviations",
                                     measurement.source, surprise));
  }
  return warnings;
}

std::string source_of(const UncertainEye& uncertain, const Eigen::RowVectorXd& row) {
  std::string source = "mri";
  const auto variance = [&](const Eigen::MatrixXd& covariance) {
    return row.dot(covariance * row.transpose());
  };
  for (std::size_t i = 0; i < uncertain.learnt.size(); ++i) {
    const Eigen::MatrixXd& after = i + 1 < uncertain.learnt.size() ? uncertain.learnt[i + 1].covariance_before
                                                                   : uncertain.numbers.covariance;
    if (variance(after) < variance(uncertain.learnt[i].covariance_before) / 2)
      source = uncertain.learnt[i].source;
  }
  return source;
}

}  // namespace emmetrope::correction
