#include "raytrace/retina/pupil_aim.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <array>
#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/base/parallel.hpp"
#include "raytrace/retina/pupil_polynomial.hpp"

namespace emmetrope::raytrace {
namespace {

constexpr int nodes_a_side = 6;
constexpr int rim_points = 12;
/// What interpolation over the field and other wavelengths may add to an ellipse.
constexpr double allowance = 1.004;

std::array<double, nodes_a_side> lagrange(double x) {
  static const auto nodes = chebyshev_nodes(nodes_a_side);
  std::array<double, nodes_a_side> weights{};
  for (int i = 0; i < nodes_a_side; ++i) {
    double above = 1, below = 1;
    for (int j = 0; j < nodes_a_side; ++j)
      if (j != i) {
        above *= x - nodes[j];
        below *= nodes[i] - nodes[j];
      }
    weights[i] = above / below;
  }
  return weights;
}

/// Where rays towards a plane in front of the retina cross the stop.
struct PlaneToStop {
  const StopCrossing& crossing;
  const Eigen::Vector3d& retina;
  double plane_z_mm = 0;
  std::optional<Eigen::Vector2d> operator()(const Eigen::Vector2d& aim) const {
    return crossing(retina, {aim.x(), aim.y(), plane_z_mm});
  }
};

/// The aims whose rays run along the stop's rim.
std::array<Eigen::Vector2d, rim_points> find_rim(const PlaneToStop& to_stop, const StopCentreAim& centre) {
  std::array<Eigen::Vector2d, rim_points> rim;
  for (int k = 0; k < rim_points; ++k) {
    const double angle = 2 * pi * k / rim_points;
    const Eigen::Vector2d target =
        to_stop.crossing.stop_radius_mm() * Eigen::Vector2d(std::cos(angle), std::sin(angle));
    rim[k] = centre.aim_mm + centre.aim_from_stop * target;
    for (int round = 0; round < 5; ++round) {
      const auto reached = to_stop(rim[k]);
      if (!reached) {  // the lens does not reach the rim there: as far as it does
        rim[k] = 0.5 * (rim[k] + centre.aim_mm);
        break;
      }
      rim[k] += centre.aim_from_stop * (target - *reached);
    }
  }
  return rim;
}

}  // namespace

std::optional<AimEllipse> aim_ellipse(const StopCrossing& crossing, const Eigen::Vector3d& retina,
                                      double plane_z_mm) {
  if (!(retina.z() < plane_z_mm)) return std::nullopt;
  const PlaneToStop to_stop{crossing, retina, plane_z_mm};
  const std::optional<StopCentreAim> centre = aim_at_stop_centre(crossing, retina, plane_z_mm);
  if (!centre) return std::nullopt;
  const std::array<Eigen::Vector2d, rim_points> rim = find_rim(to_stop, *centre);
  AimEllipse ellipse;
  for (const auto& point : rim) ellipse.centre_mm += point / rim_points;
  for (int k = 0; k < rim_points; ++k) {
    const double angle = 2 * pi * k / rim_points;
    ellipse.from_disc.col(0) += 2.0 / rim_points * std::cos(angle) * rim[k];
    ellipse.from_disc.col(1) += 2.0 / rim_points * std::sin(angle) * rim[k];
  }
  const Eigen::Matrix2d disc = ellipse.from_disc.inverse();
  double largest = 0;
  for (const auto& point : rim) largest = std::max(largest, (disc * (point - ellipse.centre_mm)).norm());
  ellipse.from_disc *= largest * allowance;
  return ellipse;
}

RetinaPoint retina_point(const EyeModel& eye, double x_mm, double y_mm) {
  if (const std::optional<RetinaPoint> point = meet_retina(eye, {x_mm, y_mm})) return *point;
  throw input_error(
      fmt::format("the retina does not reach eye x = {:g}, y = {:g} mm from its pole", x_mm, y_mm),
      "use a smaller field, or a --fovea nearer the pole");
}

PupilAim::PupilAim(const EyeModel& eye, const RetinalGrid& grid, double wavelength_nm, int threads)
    : centre_(grid.centre_mm),
      half_(0.5 * grid.field_x_mm, 0.5 * grid.field_y_mm),
      nodes_(static_cast<std::size_t>(nodes_a_side) * nodes_a_side) {
  const std::size_t count = eye.surfaces.size();
  if (count < 3) throw input_error("eye \"" + eye.name + "\" has too few surfaces");
  plane_z_mm_ = -eye.surfaces[count - 2].position_mm;
  const StopCrossing crossing(eye, wavelength_nm);
  if (!(crossing.stop_radius_mm() > 0))
    throw input_error("eye \"" + eye.name + "\": the diameter of its stop is not positive");
  const auto nodes = chebyshev_nodes(nodes_a_side);
  on_threads(threads, nodes_.size(), [&](std::size_t k) {
    const Eigen::Vector2d at =
        centre_ + half_.cwiseProduct(Eigen::Vector2d(nodes[k % nodes_a_side], nodes[k / nodes_a_side]));
    const Eigen::Vector3d retina = retina_point(eye, at.x(), at.y()).position_mm;
    const auto ellipse = aim_ellipse(crossing, retina, plane_z_mm_);
    if (!ellipse)
      throw input_error("eye \"" + eye.name + "\": no ray from the retina at x = " + std::to_string(at.x()) +
                            ", y = " + std::to_string(at.y()) + " mm reaches the stop",
                        "check the surfaces' depths and radii with emmetrope ray, or use a smaller field");
    nodes_[k] = *ellipse;
  });
}

std::vector<AimEllipse> PupilAim::along_row(double y_mm, const std::vector<double>& x_mm) const {
  const auto add = [](AimEllipse& sum, double weight, const AimEllipse& ellipse) {
    sum.centre_mm += weight * ellipse.centre_mm;
    sum.from_disc += weight * ellipse.from_disc;
  };
  const auto wy = lagrange((y_mm - centre_.y()) / half_.y());
  std::array<AimEllipse, nodes_a_side> row;  // at the nodes' x
  for (int j = 0; j < nodes_a_side; ++j)
    for (int i = 0; i < nodes_a_side; ++i)
      add(row[i], wy[j], nodes_[static_cast<std::size_t>(j) * nodes_a_side + i]);
  std::vector<AimEllipse> result(x_mm.size());
  for (std::size_t k = 0; k < x_mm.size(); ++k) {
    const auto wx = lagrange((x_mm[k] - centre_.x()) / half_.x());
    for (int i = 0; i < nodes_a_side; ++i) add(result[k], wx[i], row[i]);
  }
  return result;
}

}  // namespace emmetrope::raytrace
