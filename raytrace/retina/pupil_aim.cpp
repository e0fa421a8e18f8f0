#include "raytrace/retina/pupil_aim.hpp"

#include <Eigen/LU>
#include <array>
#include <cmath>
#include <optional>
#include <sstream>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/base/parallel.hpp"
#include "pipeline/eye/optics/exact_trace.hpp"

namespace emmetrope::raytrace {
namespace {

constexpr int nodes_a_side = 6;
constexpr int rim_points = 12;
/// What interpolation over the field and other wavelengths may add to an ellipse.
constexpr double allowance = 1.004;

/// Chebyshev nodes on [-1, 1].
std::array<double, nodes_a_side> chebyshev() {
  std::array<double, nodes_a_side> x{};
  for (int i = 0; i < nodes_a_side; ++i) x[i] = std::cos(pi * (i + 0.5) / nodes_a_side);
  return x;
}

std::array<double, nodes_a_side> lagrange(double x) {
  static const auto nodes = chebyshev();
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

/// Exact rays from the retina to the plane of the stop.
class ToStop {
 public:
  ToStop(const EyeModel& eye, double plane_z_mm, double wavelength_nm) : open_(eye), plane_z_mm_(plane_z_mm) {
    const auto stop =
        std::find_if(open_.surfaces.begin(), open_.surfaces.end(), [](const auto& s) { return s.is_stop(); });
    if (stop == open_.surfaces.end())
      throw input_error("eye \"" + eye.name + "\" has no stop",
                        "add a surface of type stop with diameter_mm");
    radius_mm_ = stop->stop_diameter_mm / 2;
    if (!(radius_mm_ > 0))
      throw input_error("eye \"" + eye.name + "\": the diameter of its stop is not positive");
    stop_from_eye_ = stop->eye_from_surface().inverse();
    stop->stop_diameter_mm = 1e3;  // where the stop would cut is what is asked for
    const auto behind = std::next(stop);
    behind_stop_ = std::next(behind) == open_.surfaces.end() ? "" : behind->name;
    exact_.emplace(open_, wavelength_nm);
  }

  double radius_mm() const { return radius_mm_; }

  /// Where a ray towards `aim` crosses the stop, in the stop's frame.
  std::optional<Eigen::Vector2d> operator()(const Eigen::Vector3d& retina, const Eigen::Vector2d& aim) const {
    const Ray ray{retina, (Eigen::Vector3d(aim.x(), aim.y(), plane_z_mm_) - retina).normalized()};
    Eigen::Vector3d position = ray.origin, direction = ray.direction;
    if (!behind_stop_.empty()) {
      const RayPath path = exact_->trace(ray);
      const auto hit = std::find_if(path.hits.begin(), path.hits.end(),
                                    [&](const auto& h) { return h.surface == behind_stop_; });
      if (hit == path.hits.end() || (path.state != RayState::reached && path.at == behind_stop_))
        return std::nullopt;
      position = hit->position_mm;
      direction = hit->direction;
    }
    const Eigen::Vector3d p = stop_from_eye_ * position, d = stop_from_eye_.linear() * direction;
    if (d.z() <= 0) return std::nullopt;
    return Eigen::Vector2d(p.head<2>() - p.z() / d.z() * d.head<2>());
  }

 private:
  EyeModel open_;
  std::optional<ExactTracer> exact_;
  double plane_z_mm_, radius_mm_ = 0;
  Eigen::Isometry3d stop_from_eye_;
  std::string behind_stop_;  ///< the surface between which and the stop the ray is straight
};

/// The smallest ellipse of its form about the stop's image as `retina` sees it.
std::optional<AimEllipse> ellipse_of(const ToStop& to_stop, const Eigen::Vector3d& retina) {
  // A first guess straight through, then chords with the Jacobian at the centre: the map is nearly affine.
  Eigen::Vector2d aim(0, 0);
  constexpr double step_mm = 0.2;
  Eigen::Matrix2d stop_from_aim = Eigen::Matrix2d::Identity();
  for (int round = 0; round < 3; ++round) {
    const auto centre = to_stop(retina, aim), right = to_stop(retina, aim + Eigen::Vector2d(step_mm, 0)),
               up = to_stop(retina, aim + Eigen::Vector2d(0, step_mm));
    if (!centre || !right || !up) return std::nullopt;
    stop_from_aim << (*right - *centre) / step_mm, (*up - *centre) / step_mm;
    aim -= stop_from_aim.inverse() * *centre;
  }
  const Eigen::Matrix2d aim_from_stop = stop_from_aim.inverse();
  std::array<Eigen::Vector2d, rim_points> rim;
  for (int k = 0; k < rim_points; ++k) {
    const double angle = 2 * pi * k / rim_points;
    const Eigen::Vector2d target = to_stop.radius_mm() * Eigen::Vector2d(std::cos(angle), std::sin(angle));
    rim[k] = aim + aim_from_stop * target;
    for (int round = 0; round < 5; ++round) {
      const auto reached = to_stop(retina, rim[k]);
      if (!reached) {  // the lens does not reach the rim there: as far as it does
        rim[k] = 0.5 * (rim[k] + aim);
        break;
      }
      rim[k] += aim_from_stop * (target - *reached);
    }
  }
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

}  // namespace

RetinaPoint retina_point(const EyeModel& eye, double x_mm, double y_mm) {
  const Surface& retina = eye.retina();
  const Eigen::Isometry3d eye_from_surface = retina.eye_from_surface();
  if (eye_from_surface.linear().isIdentity(1e-14)) {  // the common case without a search
    const double x = x_mm - eye_from_surface.translation().x(), y = y_mm - eye_from_surface.translation().y();
    const auto depth = retina.shape->depth_mm(x, y);
    const auto normal = depth ? retina.shape->normal(x, y) : std::nullopt;
    if (normal) return {{x_mm, y_mm, eye_from_surface.translation().z() - *depth}, *normal};
  } else {
    const Eigen::Isometry3d surface_from_eye = eye_from_surface.inverse();
    const Ray along{surface_from_eye * Eigen::Vector3d(x_mm, y_mm, 0),
                    surface_from_eye.linear() * -Eigen::Vector3d::UnitZ()};
    if (const auto hit = retina.shape->intersect(along))
      return {eye_from_surface * hit->position, eye_from_surface.linear() * hit->normal};
  }
  std::ostringstream where;
  where << "the retina does not reach eye x = " << x_mm << ", y = " << y_mm << " mm";
  throw input_error(where.str(), "use a smaller --field-mm");
}

PupilAim::PupilAim(const EyeModel& eye, const RetinalGrid& grid, double wavelength_nm, int threads)
    : centre_(grid.centre_mm),
      half_(0.5 * grid.field_x_mm, 0.5 * grid.field_y_mm),
      nodes_(static_cast<std::size_t>(nodes_a_side) * nodes_a_side) {
  const std::size_t count = eye.surfaces.size();
  if (count < 3) throw input_error("eye \"" + eye.name + "\" has too few surfaces");
  plane_z_mm_ = -eye.surfaces[count - 2].position_mm;
  const ToStop to_stop(eye, plane_z_mm_, wavelength_nm);
  const auto nodes = chebyshev();
  on_threads(threads, nodes_.size(), [&](std::size_t k) {
    const Eigen::Vector2d at =
        centre_ + half_.cwiseProduct(Eigen::Vector2d(nodes[k % nodes_a_side], nodes[k / nodes_a_side]));
    const auto ellipse = ellipse_of(to_stop, retina_point(eye, at.x(), at.y()).position_mm);
    if (!ellipse)
      throw input_error(
          "eye \"" + eye.name + "\": no ray from the retina at x = " + std::to_string(at.x()) +
              ", y = " + std::to_string(at.y()) + " mm reaches the stop",
          "check the surfaces' depths and radii with emmetrope ray, or use a smaller --field-mm");
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
