#include "correction/ablation.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "raytrace/eye/mesh_shape.hpp"

namespace emmetrope::correction {
namespace {

/// Depth of a surface that is a sphere in each meridian: S / (1 + sqrt(1 - T)), S = x'Cx, T = |Cx|^2.
double toric_depth_mm(const Eigen::Matrix2d& curvature, const Eigen::Vector2d& at) {
  const double t = (curvature * at).squaredNorm();
  return at.dot(curvature * at) / (1 + std::sqrt(std::max(0.0, 1 - t)));
}

double mean_asphericity(const Shape& shape) {
  const Json json = shape.to_json();
  const Json q = json.value("q", Json(0.0));
  return q.is_array() ? (q[0].get<double>() + q[1].get<double>()) / 2 : q.get<double>();
}

/// z is out of the eye: the sheet sinks, and its slope changes by the profile's.
TriangleMesh ablated(TriangleMesh mesh, const MunnerlynProfile& profile) {
  constexpr double step_mm = 1e-3;
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    Eigen::Vector3d& vertex = mesh.vertices[i];
    const double x = vertex.x(), y = vertex.y();
    vertex.z() -= profile.depth_mm(x, y);
    if (mesh.normals.empty()) continue;
    Eigen::Vector3d& normal = mesh.normals[i];
    const Eigen::Vector2d slope(
        (profile.depth_mm(x + step_mm, y) - profile.depth_mm(x - step_mm, y)) / (2 * step_mm),
        (profile.depth_mm(x, y + step_mm) - profile.depth_mm(x, y - step_mm)) / (2 * step_mm));
    normal /= normal.z();
    normal.head<2>() += slope;
    normal.normalize();
  }
  return mesh;
}

}  // namespace

MunnerlynProfile::MunnerlynProfile(const Eigen::Matrix2d& curvature_per_mm, const PowerVector& correction,
                                   double index_step, double optical_zone_mm, double transition_mm)
    : before_(curvature_per_mm), radius_mm_(optical_zone_mm / 2), transition_mm_(transition_mm) {
  Eigen::Matrix2d change;
  change << correction.M_D + correction.J0_D, correction.J45_D, correction.J45_D,
      correction.M_D - correction.J0_D;
  after_ = before_ + 1e-3 / index_step * change;
  if (!(Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(after_).eigenvalues().minCoeff() > 0))
    throw no_result_error("an ablation by that much would leave no convex cornea");
  // The least of the zone is at its centre or on its rim.
  double least = 0;
  for (int k = 0; k < 180; ++k)
    least = std::min(
        least, unshifted_mm(radius_mm_ * std::cos(2 * k * degree), radius_mm_ * std::sin(2 * k * degree)));
  shift_mm_ = -least;
}

double MunnerlynProfile::unshifted_mm(double x_mm, double y_mm) const {
  return toric_depth_mm(after_, {x_mm, y_mm}) - toric_depth_mm(before_, {x_mm, y_mm});
}

double MunnerlynProfile::depth_mm(double x_mm, double y_mm) const {
  const double r_mm = std::hypot(x_mm, y_mm);
  if (r_mm <= radius_mm_) return shift_mm_ + unshifted_mm(x_mm, y_mm);
  const double t = (r_mm - radius_mm_) / transition_mm_;
  if (t >= 1) return 0;
  const double onto_rim = radius_mm_ / r_mm;
  const double falling = 1 - t * t * t * (10 - 15 * t + 6 * t * t);  // C2 at both ends
  return falling * (shift_mm_ + unshifted_mm(onto_rim * x_mm, onto_rim * y_mm));
}

double MunnerlynProfile::deepest_um() const {
  double deepest = depth_mm(0, 0);
  for (int k = 0; k < 180; ++k)
    deepest = std::max(
        deepest, depth_mm(radius_mm_ * std::cos(2 * k * degree), radius_mm_ * std::sin(2 * k * degree)));
  return 1e3 * deepest;
}

MunnerlynProfile munnerlyn_profile(const EyeModel& eye, const PowerVector& correction) {
  const Surface& front = eye.surface("cornea_anterior");
  return {front.shape->vertex_curvature(), correction, eye.media.at(front.medium_after).index - 1};
}

EyeModel with_ablation(EyeModel eye, const MunnerlynProfile& profile) {
  Surface& front = eye.surface("cornea_anterior");
  if (const auto* mesh = dynamic_cast<const MeshShape*>(front.shape.get())) {
    const double semi_diameter_mm = front.semi_diameter_mm;
    front =
        make_mesh_surface(front.name, transformed(front.eye_from_surface(), ablated(mesh->mesh(), profile)),
                          front.medium_after, mesh->interpolation());
    front.semi_diameter_mm = semi_diameter_mm;
    return eye;
  }
  front.position_mm += profile.depth_mm(0, 0);
  const double q = mean_asphericity(*front.shape);
  const Eigen::Matrix2d& c = profile.new_curvature_per_mm();
  const double mean = c.trace() / 2, j0 = (c(0, 0) - c(1, 1)) / 2, j45 = c(0, 1);
  const double cylinder = std::hypot(j0, j45);
  front.shape = make_biconic(1 / (mean + cylinder), 1 / (mean - cylinder), q, q,
                             normalise_axis_deg(std::atan2(j45, j0) / degree / 2));
  return eye;
}

}  // namespace emmetrope::correction
