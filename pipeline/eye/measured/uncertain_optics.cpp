#include "pipeline/eye/measured/uncertain_optics.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/power_vector.hpp"
#include "pipeline/eye/optics/paraxial.hpp"
#include "pipeline/eye/parametric/analytic_eye.hpp"

namespace emmetrope {
namespace {

constexpr const char* index_name = "lens_index";

/// Parameters without which the eye cannot be rebuilt.
constexpr const char* needed[] = {"cornea_c_per_mm",           "cornea_j0_per_mm",
                                  "cornea_j45_per_mm",         "cornea_q",
                                  "cornea_back_ratio",         "cornea_thickness_mm",
                                  "anterior_chamber_depth_mm", "lens_thickness_mm",
                                  "lens_anterior_radius_mm",   "lens_posterior_radius_mm",
                                  "lens_anterior_q",           "lens_posterior_q",
                                  "lens_decentre_x_mm",        "lens_decentre_y_mm",
                                  "lens_tilt_x_deg",           "lens_tilt_y_deg",
                                  "axial_length_mm",           index_name};

Error invalid(const std::string& what) {
  return input_error("optics.json: " + what, "run \"emmetrope mesh --force\" on the case");
}

/// The file's length is the optical one, which is that of an eye whose interface is the photoreceptors.
std::string parameter_name(const std::string& in_file) {
  return in_file == "optical_axial_length_mm" ? "axial_length_mm" : in_file;
}

/// The parameters, their values, covariance and sources.
ParametricEye parametric_eye(const Json& optics) {
  const auto names = optics.at("parameters").get<std::vector<std::string>>();
  const auto values = optics.at("values").get<std::vector<double>>();
  const auto rows = optics.at("covariance").get<std::vector<std::vector<double>>>();
  const auto sources = optics.at("sources").get<std::vector<std::string>>();
  const auto priors = optics.at("prior_sigmas").get<std::vector<Json>>();
  const std::size_t n = names.size();
  if (values.size() != n || rows.size() != n || sources.size() != n || priors.size() != n)
    throw invalid("parameters, values, covariance, sources and prior_sigmas differ in size");
  ParametricEye eye;
  eye.covariance.resize(static_cast<Eigen::Index>(n), static_cast<Eigen::Index>(n));
  for (std::size_t i = 0; i < n; ++i) {
    if (rows[i].size() != n) throw invalid("covariance is not square");
    for (std::size_t k = 0; k < n; ++k)
      eye.covariance(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k)) = rows[i][k];
    const std::string name = parameter_name(names[i]);
    if (!has_parameter(eye, name)) throw invalid("parameter \"" + names[i] + "\" is not known");
    if (!std::isfinite(values[i])) throw invalid("a number is not finite");
    eye.set(name, values[i]);
    eye.parameter_names.push_back(name);
    eye.source[name] = sources[i];
    if (!priors[i].is_null()) eye.prior_sigma[name] = priors[i].get<double>();
  }
  return eye;
}

bool has_index(const ParametricEye& eye) {
  return std::find(eye.parameter_names.begin(), eye.parameter_names.end(), index_name) !=
         eye.parameter_names.end();
}

/// The lens index as one more parameter, independent of the others.
void add_index(ParametricEye& eye, double index, double sigma) {
  const Eigen::Index n = eye.covariance.rows();
  eye.parameter_names.emplace_back(index_name);
  eye.lens_index = index;
  eye.covariance.conservativeResizeLike(Eigen::MatrixXd::Zero(n + 1, n + 1));
  eye.covariance(n, n) = sigma * sigma;
  eye.source[index_name] = "prior";
}

void check(const UncertainOptics& optics) {
  for (const char* parameter : needed) optics.known.index_of(parameter);
  const double wavelength_nm = optics.model.reference_wavelength_nm;
  const double off_D =
      distance_D(paraxial_refraction(optics.model, wavelength_nm),
                 paraxial_refraction(eye_at(optics, optics.known.parameters().mean), wavelength_nm));
  if (off_D > 0.05) throw invalid(fmt::format("the eye and its parameters differ by {:.2f} D", off_D));
}

}  // namespace

UncertainOptics uncertain_optics_from_json(const Json& json, const std::filesystem::path& folder,
                                           double lens_index_sigma) {
  try {
    EyeModel model = eye_from_json(json.at("eye"), folder);
    ParametricEye eye = parametric_eye(json);
    if (!has_index(eye)) add_index(eye, model.media.at("lens").index, lens_index_sigma);
    UncertainOptics optics{std::move(model), UncertainEye(std::move(eye)), {}};
    check(optics);
    return optics;
  } catch (const nlohmann::json::exception& fault) {
    throw invalid(fault.what());
  } catch (Error& error) {
    error.add_context("reading optics.json");
    throw;
  }
}

UncertainOptics with_lens_index(const UncertainOptics& optics, double index, double sigma) {
  ParametricEye eye = optics.known.eye();
  const Eigen::Index i = optics.known.index_of(index_name);
  eye.lens_index = index;
  eye.covariance.row(i).setZero();
  eye.covariance.col(i).setZero();
  eye.covariance(i, i) = sigma * sigma;
  eye.prior_sigma[index_name] = sigma;
  UncertainOptics result{optics.model, UncertainEye(std::move(eye)), optics.topography};
  result.model.media.at("lens").index = index;
  return result;
}

UncertainOptics read_uncertain_optics(const std::filesystem::path& file, double lens_index_sigma,
                                      const EyeModel& traced) {
  UncertainOptics optics = uncertain_optics_from_json(read_json(file), file.parent_path(), lens_index_sigma);
  const auto lens = traced.media.find("lens");
  if (lens == traced.media.end()) return optics;  // cortex and core: the equivalent index stays
  return with_lens_index(optics, lens->second.index, lens_index_sigma);
}

EyeModel eye_at(const UncertainOptics& optics, const Eigen::VectorXd& values) {
  const ParametricEye parametric = optics.known.at(values);
  OpticalDefaults defaults;
  defaults.retinal_depth_mm = 0;
  const ShapePtr cornea = optics.topography ? anterior_cornea_shape(parametric, *optics.topography) : nullptr;
  EyeModel eye = optics.model;
  for (const Surface& wanted : analytic_surfaces(parametric, cornea, defaults)) {
    Surface& surface = eye.surface(wanted.name);
    surface.position_mm = wanted.position_mm;
    if (wanted.is_stop() || wanted.name == "retina") continue;
    surface.shape = wanted.shape;
    surface.decentre_mm = wanted.decentre_mm;
    surface.tilt_deg = wanted.tilt_deg;
  }
  eye.media.at("lens").index = parametric.lens_index;
  return eye;
}

double learn(UncertainOptics& optics, const std::string& source, const VectorFunction& function,
             const Eigen::VectorXd& measured, const Eigen::MatrixXd& noise_covariance) {
  const double innovation_sigma = optics.known.learn(source, function, measured, noise_covariance);
  optics.model = eye_at(optics, optics.known.parameters().mean);
  return innovation_sigma;
}

std::vector<std::string> learn(UncertainOptics& optics, const InstrumentReadings& readings) {
  if (readings.topography) optics.topography = readings.topography;
  std::vector<std::string> warnings = learn(optics.known, readings);
  optics.model = eye_at(optics, optics.known.parameters().mean);
  return warnings;
}

}  // namespace emmetrope
