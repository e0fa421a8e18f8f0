#include "raytrace/wavefront/wavefront.hpp"

#include <Eigen/Dense>
#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/optics/exact_trace.hpp"
#include "pipeline/eye/optics/paraxial.hpp"
#include "pipeline/eye/optics/retina_point.hpp"
#include "pipeline/eye/surfaces/zernike.hpp"
#include "raytrace/retina/stop_crossing.hpp"

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

Eigen::Vector3d retinal_point(const EyeModel& eye, const Eigen::Vector2d& from_pole_mm) {
  const std::optional<RetinaPoint> point = meet_retina(eye, from_pole_mm);
  if (!point)
    throw input_error("the retina does not reach (" + std::to_string(from_pole_mm.x()) + ", " +
                      std::to_string(from_pole_mm.y()) + ") mm from its pole");
  return point->position_mm;
}

/// A ray where it crosses the reference plane, in that plane's axes.
struct Crossing {
  Eigen::Vector2d position_mm{0, 0};
  Eigen::Vector2d slope{0, 0};  ///< direction cosines
  double opl_mm = 0;            ///< from the retinal point to the plane
};

/// All rays of one retinal point through an eye without its stop, known by where they cross the entrance
/// pupil's plane.
class RetinalPencil {
 public:
  RetinalPencil(const EyeModel& eye, double wavelength_nm, const Eigen::Vector2d& fovea_mm)
      : tracer_(without_stop(eye), wavelength_nm),
        source_(retinal_point(eye, fovea_mm)),
        aim_depth_mm_(exit_pupil(eye, wavelength_nm).position_mm) {
    find_chief_ray(eye, wavelength_nm);
    find_line_of_sight(eye, wavelength_nm);
    // Plane coordinates against aim coordinates about the line of sight.
    constexpr double h = 0.05;
    for (int k = 0; k < 2; ++k) {
      const Eigen::Vector2d step = h * Eigen::Vector2d::Unit(k);
      const std::optional<Crossing> ahead = crossing(chief_aim_ + step), behind = crossing(chief_aim_ - step);
      if (!ahead || !behind) throw no_result_error("rays near the line of sight do not leave the eye");
      plane_from_aim_.col(k) = (ahead->position_mm - behind->position_mm) / (2 * h);
    }
  }

  /// The ray through a point of the reference plane; nothing where none leaves the eye.
  std::optional<Crossing> through(const Eigen::Vector2d& plane_mm) const {
    const Eigen::Matrix2d aim_from_plane = plane_from_aim_.inverse();
    Eigen::Vector2d aim = chief_aim_ + aim_from_plane * plane_mm;
    std::optional<Crossing> at = crossing(aim);
    for (int iteration = 0; iteration < 30 && at; ++iteration) {
      const Eigen::Vector2d error = plane_mm - at->position_mm;
      if (error.norm() < 1e-10) break;
      aim += aim_from_plane * error;
      at = crossing(aim);
    }
    if (at && (plane_mm - at->position_mm).norm() > 1e-6) return std::nullopt;
    return at;
  }

  const Eigen::Vector3d& line_of_sight() const { return line_of_sight_; }
  const Eigen::Vector3d& centre() const { return centre_; }  ///< of the entrance pupil

 private:
  Eigen::Vector3d target(const Eigen::Vector2d& aim) const { return {aim.x(), aim.y(), -aim_depth_mm_}; }
  Ray aimed(const Eigen::Vector2d& aim) const { return {source_, (target(aim) - source_).normalized()}; }

  /// The aim through the centre of the stop; straight ahead where there is none.
  void find_chief_ray(const EyeModel& eye, double wavelength_nm) {
    if (eye.stop() == nullptr) return;
    const StopCrossing at_stop(eye, wavelength_nm);
    for (int iteration = 0; iteration < 30; ++iteration) {
      const std::optional<Eigen::Vector2d> at = at_stop(source_, target(chief_aim_));
      if (!at) throw no_result_error("the ray through the centre of the stop does not leave the eye");
      if (at->norm() < 1e-10) break;
      chief_aim_ -= *at;  // the stop lies close to its image: converges by a factor of about ten a step
    }
  }

  void find_line_of_sight(const EyeModel& eye, double wavelength_nm) {
    const ExactTracer::End chief = tracer_.trace_end(aimed(chief_aim_));
    if (chief.state != RayState::reached || chief.direction.z() <= 0)
      throw no_result_error("the line of sight does not leave the eye");
    line_of_sight_ = chief.direction;
    const double depth = entrance_pupil(eye, wavelength_nm).position_mm;
    centre_ = chief.position_mm + (-depth - chief.position_mm.z()) / chief.direction.z() * chief.direction;
    x_axis_ = Eigen::Vector3d::UnitY().cross(line_of_sight_).normalized();
    y_axis_ = line_of_sight_.cross(x_axis_);
  }

  std::optional<Crossing> crossing(const Eigen::Vector2d& aim) const {
    const ExactTracer::End end = tracer_.trace_end(aimed(aim));
    if (end.state != RayState::reached || end.direction.z() <= 0) return std::nullopt;
    const double distance =
        (centre_ - end.position_mm).dot(line_of_sight_) / end.direction.dot(line_of_sight_);
    const Eigen::Vector3d offset = end.position_mm + distance * end.direction - centre_;
    return Crossing{{offset.dot(x_axis_), offset.dot(y_axis_)},
                    {end.direction.dot(x_axis_), end.direction.dot(y_axis_)},
                    end.opl_mm + distance};
  }

  ExactTracer tracer_;
  Eigen::Vector3d source_;
  double aim_depth_mm_;
  Eigen::Vector2d chief_aim_{0, 0};
  Eigen::Matrix2d plane_from_aim_ = Eigen::Matrix2d::Identity();
  Eigen::Vector3d line_of_sight_, centre_, x_axis_, y_axis_;
};

PowerVector central_vergence(const RetinalPencil& pencil) {
  Eigen::Matrix2d vergence;
  for (int k = 0; k < 2; ++k) {
    const Eigen::Vector2d step = centre_mm * Eigen::Vector2d::Unit(k);
    const std::optional<Crossing> ahead = pencil.through(step), behind = pencil.through(-step);
    if (!ahead || !behind) throw no_result_error("rays near the line of sight do not leave the eye");
    vergence.col(k) = (ahead->slope - behind->slope) / (2 * centre_mm);
  }
  return power_from_vergence(vergence);
}

/// One ray of the pupil with its share of the pupil's area.
struct Sample {
  Eigen::Vector2d place;  ///< in units of the pupil's radius
  Crossing at;
  double weight;
};

std::vector<Sample> sample_pupil(const RetinalPencil& pencil, double radius_mm, int order) {
  const Quadrature radial = gauss_legendre(order / 2 + 6);
  const int spokes = 2 * order + 5;
  std::vector<Sample> samples;
  double found = 0;
  for (std::size_t i = 0; i < radial.nodes.size(); ++i)
    for (int k = 0; k < spokes; ++k) {
      const double rho = std::sqrt(radial.nodes[i]),
                   angle = 2 * pi * (k + 0.5 * static_cast<double>(i % 2)) / spokes;
      const Eigen::Vector2d place = rho * Eigen::Vector2d(std::cos(angle), std::sin(angle));
      const double weight = radial.weights[i] / spokes;
      if (const std::optional<Crossing> at = pencil.through(radius_mm * place)) {
        samples.push_back({place, *at, weight});
        found += weight;
      }
    }
  if (found < least_fraction)
    throw no_result_error("only " + std::to_string(static_cast<int>(100 * found)) +
                              " % of the pupil's rays leave the eye: no wavefront",
                          "use a smaller pupil");
  return samples;
}

/// Least squares of the slopes over the pupil: u = u0 + F p with F symmetric.
PowerVector slope_vergence(const std::vector<Sample>& samples) {
  Eigen::Matrix<double, 5, 5> normal = Eigen::Matrix<double, 5, 5>::Zero();
  Eigen::Matrix<double, 5, 1> right = Eigen::Matrix<double, 5, 1>::Zero();
  for (const Sample& s : samples) {
    const Eigen::Vector2d& p = s.at.position_mm;
    Eigen::Matrix<double, 2, 5> rows;
    rows << 1, 0, p.x(), p.y(), 0,  //
        0, 1, 0, p.x(), p.y();
    normal += s.weight * rows.transpose() * rows;
    right += s.weight * rows.transpose() * s.at.slope;
  }
  const Eigen::Matrix<double, 5, 1> fit = normal.ldlt().solve(right);
  Eigen::Matrix2d vergence;
  vergence << fit[2], fit[3], fit[3], fit[4];
  return power_from_vergence(vergence);
}

/// Weighted least squares of the optical paths over the pupil; writes the terms and what they leave.
/// \return all coefficients, piston too
Eigen::VectorXd fit_zernike(Wavefront& result, const std::vector<Sample>& samples, double chief_opl_mm,
                            int order) {
  const auto rows = static_cast<Eigen::Index>(samples.size());
  Eigen::MatrixXd terms(rows, zernike_count(order));
  Eigen::VectorXd wavefront_um(rows), root_weight(rows);
  for (Eigen::Index k = 0; k < rows; ++k) {
    const Sample& sample = samples[static_cast<std::size_t>(k)];
    root_weight[k] = std::sqrt(sample.weight);
    terms.row(k) = zernike_values(order, sample.place.x(), sample.place.y()).transpose();
    wavefront_um[k] = 1000 * (chief_opl_mm - sample.at.opl_mm);
  }
  Eigen::VectorXd fit =
      (root_weight.asDiagonal() * terms).colPivHouseholderQr().solve(root_weight.asDiagonal() * wavefront_um);
  const Eigen::VectorXd left = root_weight.asDiagonal() * (terms * fit - wavefront_um);
  result.fit_residual_rms_um = left.norm() / root_weight.norm();
  result.zernike_um.assign(fit.data(), fit.data() + fit.size());
  result.zernike_um[0] = 0;
  return fit;
}

}  // namespace

double Wavefront::rms_um() const {
  double sum = 0;
  for (std::size_t j = 3; j < zernike_um.size(); ++j) sum += zernike_um[j] * zernike_um[j];
  return std::sqrt(sum);
}

double Wavefront::spot_rms_arcmin() const {
  Eigen::Vector2d mean(0, 0);
  double weight = 0, square = 0;
  for (const PupilRay& ray : rays) {
    mean += ray.weight * ray.slope;
    weight += ray.weight;
  }
  mean /= weight;
  for (const PupilRay& ray : rays) square += ray.weight * (ray.slope - mean).squaredNorm();
  return std::sqrt(square / weight) / degree * 60;
}

double Wavefront::higher_order_rms_um() const {
  double sum = 0;
  for (std::size_t j = 6; j < zernike_um.size(); ++j) sum += zernike_um[j] * zernike_um[j];
  return std::sqrt(sum);
}

Wavefront measure_wavefront(const EyeModel& eye, const WavefrontSettings& settings) {
  if (settings.order < 2 || settings.order > largest_order)
    throw usage_error("the order of the Zernike terms must lie between 2 and " +
                      std::to_string(largest_order));
  Wavefront result;
  result.wavelength_nm = settings.wavelength_nm.value_or(eye.reference_wavelength_nm);
  const Pupil pupil = entrance_pupil(eye, result.wavelength_nm);
  result.pupil_mm = settings.entrance_pupil_mm.value_or(pupil.diameter_mm);
  result.pupil_position_mm = pupil.position_mm;
  if (!(result.pupil_mm > 0))
    throw input_error("eye '" + eye.name + "' has no stop: its pupil is not known",
                      "add a surface of type \"stop\" or give the entrance pupil's diameter");

  const RetinalPencil pencil(eye, result.wavelength_nm, settings.fovea_mm);
  result.pupil_centre_mm = pencil.centre().head<2>();
  const double radius_mm = result.pupil_mm / 2;
  const std::optional<Crossing> chief = pencil.through({0, 0});
  if (!chief) throw no_result_error("the line of sight does not leave the eye");
  const std::vector<Sample> samples = sample_pupil(pencil, radius_mm, settings.order);

  for (const Sample& sample : samples)
    result.rays.push_back({sample.at.position_mm, sample.at.slope, sample.weight});
  const Eigen::VectorXd fit = fit_zernike(result, samples, chief->opl_mm, settings.order);

  result.line_of_sight_deg = {std::atan2(pencil.line_of_sight().x(), pencil.line_of_sight().z()) / degree,
                              std::atan2(pencil.line_of_sight().y(), pencil.line_of_sight().z()) / degree};
  const double square = radius_mm * radius_mm;
  result.paraxial = central_vergence(pencil);
  result.minimum_rms_wavefront = {-4 * std::sqrt(3.0) * fit[4] / square,
                                  -2 * std::sqrt(6.0) * fit[5] / square,
                                  -2 * std::sqrt(6.0) * fit[3] / square};
  result.minimum_rms_spot = slope_vergence(samples);
  return result;
}

PowerVector at_vertex(const Wavefront& wavefront, const PowerVector& in_pupil, double vertex_distance_mm) {
  return move_towards_eye(in_pupil, -(vertex_distance_mm + wavefront.pupil_position_mm));
}

PowerVector in_pupil(const Wavefront& wavefront, const PowerVector& at_vertex, double vertex_distance_mm) {
  return move_towards_eye(at_vertex, vertex_distance_mm + wavefront.pupil_position_mm);
}

}  // namespace emmetrope::raytrace
