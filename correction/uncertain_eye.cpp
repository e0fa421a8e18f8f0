#include "correction/uncertain_eye.hpp"

#include <fmt/core.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "raytrace/eye/paraxial.hpp"

namespace emmetrope::correction {
namespace {

/// Parameters without which the eye cannot be rebuilt.
constexpr const char* needed[] = {
    "cornea_c_per_mm",         "cornea_j0_per_mm",         "cornea_j45_per_mm",         "cornea_q",
    "cornea_back_ratio",       "cornea_thickness_mm",      "anterior_chamber_depth_mm", "lens_thickness_mm",
    "lens_anterior_radius_mm", "lens_posterior_radius_mm", "optical_axial_length_mm",   "lens_tilt_x_deg",
    "lens_tilt_y_deg"};

double asphericity(const Surface& surface) { return surface.shape->to_json().value("q", 0.0); }

ShapePtr biconic(double c, double j0, double j45, double q) {
  const double cylinder = std::hypot(j0, j45);
  return make_biconic(1 / (c + cylinder), 1 / (c - cylinder), q, q,
                      normalise_axis_deg(std::atan2(j45, j0) / degree / 2));
}

Error invalid(const std::string& what) {
  return input_error("optics.json: " + what, "run \"emmetrope mesh --force\" on the case");
}

double distance_D(const PowerVector& a, const PowerVector& b) {
  return std::hypot(a.M_D - b.M_D, a.J0_D - b.J0_D, a.J45_D - b.J45_D);
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
  try {
    uncertain.eye = eye_from_json(optics.at("eye"), folder);
    uncertain.parameters = optics.at("parameters").get<std::vector<std::string>>();
    const auto values = optics.at("values").get<std::vector<double>>();
    const auto rows = optics.at("covariance").get<std::vector<std::vector<double>>>();
    uncertain.sources = optics.at("sources").get<std::vector<std::string>>();
    const std::size_t n = uncertain.parameters.size();
    if (values.size() != n || rows.size() != n || uncertain.sources.size() != n)
      throw invalid("parameters, values, covariance and sources differ in size");
    uncertain.values = Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(n));
    uncertain.covariance.resize(static_cast<Eigen::Index>(n), static_cast<Eigen::Index>(n));
    for (std::size_t i = 0; i < n; ++i) {
      if (rows[i].size() != n) throw invalid("covariance is not square");
      for (std::size_t k = 0; k < n; ++k)
        uncertain.covariance(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k)) = rows[i][k];
    }
  } catch (const nlohmann::json::exception& fault) {
    throw invalid(fault.what());
  }
  if (std::find(uncertain.parameters.begin(), uncertain.parameters.end(), "lens_index") ==
      uncertain.parameters.end()) {
    const Eigen::Index n = uncertain.values.size();
    uncertain.parameters.emplace_back("lens_index");
    uncertain.values.conservativeResize(n + 1);
    uncertain.values[n] = uncertain.eye.media.at("lens").index;
    uncertain.covariance.conservativeResizeLike(Eigen::MatrixXd::Zero(n + 1, n + 1));
    uncertain.covariance(n, n) = lens_index_sigma * lens_index_sigma;
    uncertain.sources.emplace_back("prior");
  }
  for (const char* parameter : needed) uncertain.index_of(parameter);
  if (!uncertain.values.allFinite() || !uncertain.covariance.allFinite())
    throw invalid("a number is not finite");

  const Eigen::MatrixXd& covariance = uncertain.covariance;
  const Eigen::VectorXd sigma = covariance.diagonal().cwiseMax(0).cwiseSqrt();
  const Eigen::VectorXd scale = sigma.unaryExpr([](double s) { return s > 0 ? 1 / s : 0; });
  const Eigen::MatrixXd correlation = scale.asDiagonal() * covariance * scale.asDiagonal();
  if ((correlation - correlation.transpose()).cwiseAbs().maxCoeff() > 1e-6 ||
      Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(correlation).eigenvalues().minCoeff() < -1e-6)
    throw invalid("covariance is not symmetric and positive semi-definite");

  const double wavelength_nm = uncertain.eye.reference_wavelength_nm;
  const double off_D = distance_D(paraxial_refraction(uncertain.eye, wavelength_nm),
                                  paraxial_refraction(eye_at(uncertain, uncertain.values), wavelength_nm));
  if (off_D > 0.05) throw invalid(fmt::format("the eye and its parameters differ by {:.2f} D", off_D));
  return uncertain;
}

EyeModel eye_at(const UncertainEye& uncertain, const Eigen::VectorXd& values) {
  const auto value = [&](const char* parameter) { return values[uncertain.index_of(parameter)]; };
  /// Against the eye as it is; 0 for a parameter that this eye does not have.
  const auto change = [&](const char* parameter) {
    const auto found = std::find(uncertain.parameters.begin(), uncertain.parameters.end(), parameter);
    const Eigen::Index i = found - uncertain.parameters.begin();
    return found == uncertain.parameters.end() ? 0.0 : values[i] - uncertain.values[i];
  };
  EyeModel eye = uncertain.eye;

  Surface& front = eye.surface("cornea_anterior");
  Surface& back = eye.surface("cornea_posterior");
  const double c = value("cornea_c_per_mm"), j0 = value("cornea_j0_per_mm"), j45 = value("cornea_j45_per_mm");
  const double ratio = value("cornea_back_ratio"), q = value("cornea_q");
  front.shape = biconic(c, j0, j45, q);
  back.shape = biconic(c / ratio, j0 / ratio, j45 / ratio, q);
  back.position_mm = front.position_mm + value("cornea_thickness_mm");

  // The lens moves with the chamber's depth and turns about its middle; each surface is placed by its own
  // vertex.
  const double chamber_mm = change("anterior_chamber_depth_mm"), thickness_mm = value("lens_thickness_mm");
  const double tilt_x_deg = change("lens_tilt_x_deg"), tilt_y_deg = change("lens_tilt_y_deg");
  for (Surface& surface : eye.surfaces)
    if (surface.is_stop()) surface.position_mm += chamber_mm;
  const Eigen::Vector2d decentre_mm(change("lens_decentre_x_mm"), change("lens_decentre_y_mm"));
  const auto place = [&](Surface& lens, ShapePtr shape, double old_height_mm, double height_mm) {
    const auto turned = [](const Eigen::Vector2d& tilt_deg, double h) -> Eigen::Vector3d {
      return Eigen::AngleAxisd(tilt_deg.y() * degree, Eigen::Vector3d::UnitY()) *
             (Eigen::AngleAxisd(tilt_deg.x() * degree, Eigen::Vector3d::UnitX()) * Eigen::Vector3d(0, 0, h));
    };
    const Eigen::Vector2d tilt_deg = lens.tilt_deg + Eigen::Vector2d(tilt_x_deg, tilt_y_deg);
    const Eigen::Vector3d shift = turned(tilt_deg, height_mm) - turned(lens.tilt_deg, old_height_mm);
    lens.shape = std::move(shape);
    lens.tilt_deg = tilt_deg;
    lens.decentre_mm += shift.head<2>() + decentre_mm;
    lens.position_mm += chamber_mm + (thickness_mm - 2 * std::abs(old_height_mm)) / 2 - shift.z();
  };
  const double old_half_mm = uncertain.values[uncertain.index_of("lens_thickness_mm")] / 2;
  Surface& lens_front = eye.surface("lens_anterior");
  Surface& lens_back = eye.surface("lens_posterior");
  place(lens_front,
        make_conic(value("lens_anterior_radius_mm"), asphericity(lens_front) + change("lens_anterior_q")),
        old_half_mm, thickness_mm / 2);
  place(lens_back,
        make_conic(-value("lens_posterior_radius_mm"), asphericity(lens_back) + change("lens_posterior_q")),
        -old_half_mm, -thickness_mm / 2);

  eye.media.at("lens").index = value("lens_index");
  eye.surfaces.back().position_mm += change("optical_axial_length_mm");
  return eye;
}

}  // namespace emmetrope::correction
