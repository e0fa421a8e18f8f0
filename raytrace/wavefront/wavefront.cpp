#include "raytrace/wavefront/wavefront.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/optics/paraxial.hpp"
#include "pipeline/eye/surfaces/zernike.hpp"
#include "raytrace/wavefront/retinal_pencil.hpp"
#include "raytrace/wavefront/seen_pupil.hpp"

namespace emmetrope::raytrace {
namespace {

constexpr int largest_order = 12;
/// Fewer rays than this fraction of the pupil say nothing about the rest.
constexpr double least_fraction = 0.6;
/// How near to the axis the wavefront's curvature "at the centre" is taken, mm.
constexpr double centre_mm = 0.01;

/// Nodes and weights of Gauss and Legendre on [0, 1].
struct Quadrature {
  std::vector<double> nodes, weights;
};

Quadrature gauss_legendre(int n) {
  Quadrature q;
  for (int k = 0; k < n; ++k) {
    double x = std::cos(pi * (k + 0.75) / (n + 0.5)), slope = 1;
    for (int iteration = 0; iteration < 100; ++iteration) {
      double previous = 1, value = x;
      for (int m = 2; m <= n; ++m) {
        const double next = ((2 * m - 1) * x * value - (m - 1) * previous) / m;
        previous = value;
        value = next;
      }
      slope = n * (x * value - previous) / (x * x - 1);
      const double step = value / slope;
      x -= step;
      if (std::abs(step) < 1e-15) break;
    }
    q.nodes.push_back((1 - x) / 2);
    q.weights.push_back(1 / ((1 - x * x) * slope * slope));
  }
  return q;
}

PowerVector central_vergence(const RetinalPencil& pencil) {
  Eigen::Matrix2d vergence;
  for (int k = 0; k < 2; ++k) {
    const Eigen::Vector2d step = centre_mm * Eigen::Vector2d::Unit(k);
    const std::optional<PlaneCrossing> ahead = pencil.through(step), behind = pencil.through(-step);
    if (!ahead || !behind) throw no_result_error("rays near the line of sight do not leave the eye");
    vergence.col(k) = (ahead->slope - behind->slope) / (2 * centre_mm);
  }
  return power_from_vergence(vergence);
}

using PupilRay = Wavefront::PupilRay;

/// \param rim  of the pupil
/// \param chief_opl_mm  of the ray through its centre
std::vector<PupilRay> sample_pupil(const RetinalPencil& pencil, const PupilRim& rim, double chief_opl_mm,
                                   int order) {
  const Quadrature radial = gauss_legendre(order / 2 + 6);
  const int spokes = 4 * order + 5;  // an ellipse's rim has overtones of its own
  const double pupil_mm2 = rim.area_mm2();
  std::vector<PupilRay> rays;
  double found = 0;
  for (std::size_t i = 0; i < radial.nodes.size(); ++i)
    for (int k = 0; k < spokes; ++k) {
      const double angle = 2 * pi * (k + 0.5 * static_cast<double>(i % 2)) / spokes;
      const double rim_mm = rim.at(angle), radius_mm = rim_mm * std::sqrt(radial.nodes[i]);
      const double share = radial.weights[i] / spokes * pi * rim_mm * rim_mm / pupil_mm2;
      const Eigen::Vector2d place_mm = radius_mm * Eigen::Vector2d(std::cos(angle), std::sin(angle));
      if (const std::optional<PlaneCrossing> at = pencil.through(place_mm)) {
        rays.push_back({at->position_mm, at->slope, 1000 * (chief_opl_mm - at->opl_mm), share});
        found += share;
      }
    }
  if (found < least_fraction)
    throw no_result_error("only " + std::to_string(static_cast<int>(100 * found)) +
                              " % of the pupil's rays leave the eye: no wavefront",
                          "use a smaller pupil");
  return rays;
}

/// Least squares of the slopes over the pupil's light: u = u0 + F p with F symmetric.
PowerVector slope_vergence(const Wavefront& wavefront) {
  Eigen::Matrix<double, 5, 5> normal = Eigen::Matrix<double, 5, 5>::Zero();
  Eigen::Matrix<double, 5, 1> right = Eigen::Matrix<double, 5, 1>::Zero();
  for (const PupilRay& ray : wavefront.rays) {
    const Eigen::Vector2d& p = ray.place_mm;
    Eigen::Matrix<double, 2, 5> rows;
    rows << 1, 0, p.x(), p.y(), 0,  //
        0, 1, 0, p.x(), p.y();
    normal += wavefront.light_share(ray) * rows.transpose() * rows;
    right += wavefront.light_share(ray) * rows.transpose() * ray.slope;
  }
  const Eigen::Matrix<double, 5, 1> fit = normal.ldlt().solve(right);
  Eigen::Matrix2d vergence;
  vergence << fit[2], fit[3], fit[3], fit[4];
  return power_from_vergence(vergence);
}

/// Least squares of the wavefront over the pupil's area.
struct ZernikeFit {
  Eigen::VectorXd terms_um;  ///< all, piston too
  double residual_rms_um = 0;
};

ZernikeFit fit_zernike(const std::vector<PupilRay>& rays, double radius_mm, int order) {
  const auto rows = static_cast<Eigen::Index>(rays.size());
  Eigen::MatrixXd terms(rows, zernike_count(order));
  Eigen::VectorXd wavefront_um(rows), root_share(rows);
  for (Eigen::Index k = 0; k < rows; ++k) {
    const PupilRay& ray = rays[static_cast<std::size_t>(k)];
    const Eigen::Vector2d place = ray.place_mm / radius_mm;
    root_share[k] = std::sqrt(ray.area_share);
    terms.row(k) = zernike_values(order, place.x(), place.y()).transpose();
    wavefront_um[k] = ray.wavefront_um;
  }
  ZernikeFit fit;
  fit.terms_um =
      (root_share.asDiagonal() * terms).colPivHouseholderQr().solve(root_share.asDiagonal() * wavefront_um);
  const Eigen::VectorXd left = root_share.asDiagonal() * (terms * fit.terms_um - wavefront_um);
  fit.residual_rms_um = left.norm() / root_share.norm();
  return fit;
}

/// What a lens in the pupil corrects of it: the terms of second order of the best fit with no others.
PowerVector second_order_refraction(const std::vector<PupilRay>& rays, double radius_mm) {
  const Eigen::VectorXd c = fit_zernike(rays, radius_mm, 2).terms_um;
  const double square = radius_mm * radius_mm;
  return {-4 * std::sqrt(3.0) * c[4] / square, -2 * std::sqrt(6.0) * c[5] / square,
          -2 * std::sqrt(6.0) * c[3] / square};
}

/// The circle asked for, or what the eye's stop and surfaces let through.
PupilRim pupil_rim(const EyeModel& eye, const RetinalPencil& pencil, const WavefrontSettings& settings,
                   double stop_image_mm) {
  if (settings.entrance_pupil_mm) return {{*settings.entrance_pupil_mm / 2}};
  if (!(stop_image_mm > 0) && pencil.has_stop())
    throw input_error(
        fmt::format("eye '{}' has no entrance pupil: what is in front of its stop of {:g} mm images it "
                    "upside down, {:g} mm wide",
                    eye.name, eye.stop()->stop_diameter_mm, std::abs(stop_image_mm)),
        "check the radii and positions of the surfaces in front of the stop: all lengths are mm");
  if (!(stop_image_mm > 0))
    throw input_error("eye '" + eye.name + "' has no stop: its pupil is not known",
                      "add a surface of type \"stop\" or give the entrance pupil's diameter");
  if (!pencil.has_stop()) return {{stop_image_mm / 2}};
  return pencil.rim();
}

}  // namespace

constexpr double largest_pupil_mm = 100;

double Wavefront::rms_beyond_order_um(int order) const {
  return fit_zernike(rays, pupil_mm / 2, order).residual_rms_um;
}

Eigen::Vector2d Wavefront::tilt_mrad() const {
  // Z1 = 2 y / r, Z2 = 2 x / r; um per mm are mrad.
  const Eigen::VectorXd c = fit_zernike(rays, pupil_mm / 2, 1).terms_um;
  return 4 / pupil_mm * Eigen::Vector2d(c[2], c[1]);
}

double Wavefront::receptor_weight(const Eigen::Vector2d& place_mm) const {
  return std::pow(10, -stiles_crawford_per_mm2 * (place_mm / pupil_magnification).squaredNorm());
}

double Wavefront::light_share(const PupilRay& ray) const {
  return ray.area_share * receptor_weight(ray.place_mm);
}

Eigen::Vector2d Wavefront::mean_slope() const {
  Eigen::Vector2d sum(0, 0);
  double light = 0;
  for (const PupilRay& ray : rays) {
    sum += light_share(ray) * ray.slope;
    light += light_share(ray);
  }
  return sum / light;
}

double Wavefront::spot_rms_arcmin() const {
  const Eigen::Vector2d mean = mean_slope();
  double light = 0, square = 0;
  for (const PupilRay& ray : rays) {
    light += light_share(ray);
    square += light_share(ray) * (ray.slope - mean).squaredNorm();
  }
  return std::sqrt(square / light) / degree * 60;
}

Wavefront measure_wavefront(const EyeModel& eye, const WavefrontSettings& settings) {
  if (settings.order < 2 || settings.order > largest_order)
    throw usage_error("the order of the Zernike terms must lie between 2 and " +
                      std::to_string(largest_order));
  if (!(settings.stiles_crawford_per_mm2 >= 0 && settings.stiles_crawford_per_mm2 <= 1))
    throw usage_error("the Stiles-Crawford weight must lie between 0 and 1 per mm^2");
  if (settings.entrance_pupil_mm && !(*settings.entrance_pupil_mm > 0))
    throw usage_error(
        fmt::format("the entrance pupil is {:g} mm wide: it must be above 0", *settings.entrance_pupil_mm));
  Wavefront result;
  result.wavelength_nm = settings.wavelength_nm.value_or(eye.reference_wavelength_nm);
  if (!(result.wavelength_nm >= 200 && result.wavelength_nm <= 2500))
    throw usage_error("the wavelength must lie between 200 and 2500 nm");
  result.stiles_crawford_per_mm2 = settings.stiles_crawford_per_mm2;
  const Pupil pupil = entrance_pupil(eye, result.wavelength_nm);
  result.pupil_position_mm = pupil.position_mm;
  result.pupil_magnification = pupil_magnification_of_spectacle(eye, result.wavelength_nm);
  const RetinalPencil pencil(eye, result.wavelength_nm, settings.fovea_mm);
  result.rim = pupil_rim(eye, pencil, settings, pupil.diameter_mm);
  const double radius_mm = result.rim.largest_mm();
  result.pupil_mm = 2 * radius_mm;
  if (result.pupil_mm > largest_pupil_mm)
    throw no_result_error(
        fmt::format("through what it wears the eye's pupil is seen {:.0f} mm wide: its focus lies nearby",
                    result.pupil_mm));
  result.pupil_centre_mm = pencil.centre().head<2>();
  result.tangential = pencil.tangential();
  const std::optional<PlaneCrossing> chief = pencil.through({0, 0});
  if (!chief) throw no_result_error("the line of sight does not leave the eye");
  result.rays = sample_pupil(pencil, result.rim, chief->opl_mm, settings.order);
  const ZernikeFit fit = fit_zernike(result.rays, radius_mm, settings.order);
  result.zernike_um.assign(fit.terms_um.data(), fit.terms_um.data() + fit.terms_um.size());
  result.zernike_um[0] = 0;
  result.fit_residual_rms_um = fit.residual_rms_um;
  result.line_of_sight_deg = {std::atan2(pencil.line_of_sight().x(), pencil.line_of_sight().z()) / degree,
                              std::atan2(pencil.line_of_sight().y(), pencil.line_of_sight().z()) / degree};
  result.paraxial = central_vergence(pencil);
  result.minimum_rms_wavefront = second_order_refraction(result.rays, radius_mm);
  result.minimum_rms_spot = slope_vergence(result);
  return result;
}

PowerVector at_vertex(const Wavefront& wavefront, const PowerVector& in_pupil, double vertex_distance_mm) {
  return move_towards_eye(in_pupil, -(vertex_distance_mm + wavefront.pupil_position_mm));
}

PowerVector in_pupil(const Wavefront& wavefront, const PowerVector& at_vertex, double vertex_distance_mm) {
  return move_towards_eye(at_vertex, vertex_distance_mm + wavefront.pupil_position_mm);
}

}  // namespace emmetrope::raytrace
