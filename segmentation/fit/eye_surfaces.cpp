#include "segmentation/fit/eye_surfaces.hpp"

#include <algorithm>
#include <cmath>

#include "pipeline/base/frames.hpp"
#include "pipeline/eye/parametric/parametric_eye.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

/// Radius at which the iris lies `iris_offset` behind the front vertex of the lens, on which it rests.
constexpr double iris_reference_radius_mm = 3;

/// Depth of a rotationally symmetric conic at squared radius s, with derivatives by s, curvature and Q.
struct ConicSag {
  double value, d_s, d_c, d_q;
};
ConicSag conic_sag(double s, double c, double q) {
  // Beyond the conic's reach (a far voxel) its slope is kept finite.
  const double inside = std::max(1 - (1 + q) * c * c * s, 0.05);
  const double root = std::sqrt(inside), d = 1 + root;
  const double d_root = -c * s / (d * d);  // d value / d root
  return {c * s / d, c / d + d_root * (-(1 + q) * c * c) / (2 * root),
          s / d + d_root * (-2 * (1 + q) * c * s) / (2 * root), d_root * (-c * c * s) / (2 * root)};
}

Bump exact_bump(double cosine) {
  const double angle = std::acos(std::clamp(cosine, -1.0, 1.0)), sine = std::sin(angle);
  const double value = std::exp(-angle * angle / (2 * bump_width_rad * bump_width_rad));
  return {value, value / (bump_width_rad * bump_width_rad) * (sine > 1e-6 ? angle / sine : 1)};
}

/// Cubic interpolation on a grid of cosines, right to 1e-8, which the Gaussian has fallen to at its end: acos
/// and exp would take a quarter of a fit.
class BumpTable {
 public:
  BumpTable() {
    for (int i = 0; i <= intervals; ++i)
      nodes_[i] = exact_bump(1 - (1 - first_) * (1 - double(i) / intervals));
  }
  Bump operator()(double cosine) const {
    if (cosine < first_) return {0, 0};
    const double step = (1 - first_) / intervals, x = std::min(cosine - first_, 1 - first_) / step;
    const int i = std::min(static_cast<int>(x), intervals - 1);
    const double t = x - i, s = 1 - t;
    const Bump &a = nodes_[i], &b = nodes_[i + 1];
    const double rise = (b.value - a.value) / step;
    return {s * s * (1 + 2 * t) * a.value + t * t * (1 + 2 * s) * b.value +
                step * s * t * (s * a.d_cosine - t * b.d_cosine),
            6 * s * t * rise + s * (1 - 3 * t) * a.d_cosine + t * (1 - 3 * s) * b.d_cosine};
  }

 private:
  static constexpr int intervals = 1024;
  const double first_ = std::cos(6.1 * bump_width_rad);
  std::array<Bump, intervals + 1> nodes_;
};

}  // namespace

Bump bump_at(double cosine) {
  static const BumpTable table;
  return table(cosine);
}

EyeSurface cornea_surface(const VectorXd& a, const Vector3d& p, bool back, const CorneaField* field) {
  const double ratio = back ? a[cornea_back_ratio] : 1;
  const double c11 = (a[cornea_c] + a[cornea_j0]) / ratio, c22 = (a[cornea_c] - a[cornea_j0]) / ratio,
               c12 = a[cornea_j45] / ratio;
  // I + Q, with the split of Q along the principal meridians.
  const double j0 = a[cornea_j0], j45 = a[cornea_j45], split = a[cornea_q_split];
  const double j_scale = std::hypot(j0, j45, cornea_split_scale_per_mm);
  const double k11 = 1 + a[cornea_q] + split * j0 / j_scale, k22 = 1 + a[cornea_q] - split * j0 / j_scale,
               k12 = split * j45 / j_scale;
  const double x = p.x(), y = p.y();
  const double v1 = c11 * x + c12 * y, v2 = c12 * x + c22 * y;
  const double w1 = k11 * v1 + k12 * v2, w2 = k12 * v1 + k22 * v2;
  const double s = x * v1 + y * v2, t = v1 * w1 + v2 * w2;
  const double root = std::sqrt(std::max(1 - t, 0.05)), d = 1 + root;
  const double d_s = 1 / d, d_t = s / (2 * root * d * d);
  const double d_c11 = d_s * x * x + d_t * 2 * w1 * x;
  const double d_c22 = d_s * y * y + d_t * 2 * w2 * y;
  const double d_c12 = d_s * 2 * x * y + d_t * 2 * (w1 * y + w2 * x);
  // By the split's components along 0 and 45 degrees.
  const double d_q0 = d_t * (v1 * v1 - v2 * v2), d_q45 = d_t * 2 * v1 * v2;
  const double along = (d_q0 * j0 + d_q45 * j45) / (j_scale * j_scale);

  EyeSurface surface;
  surface.f = -p.z() - s / d - (back ? a[cornea_thickness] : 0);
  surface.gradient = {-(d_s * 2 * v1 + d_t * 2 * (c11 * w1 + c12 * w2)),
                      -(d_s * 2 * v2 + d_t * 2 * (c12 * w1 + c22 * w2)), -1};
  // Of S and T; the mixed terms are small within the cornea.
  surface.hessian(0, 0) = -2 * (d_s * c11 + d_t * (k11 * c11 * c11 + 2 * k12 * c11 * c12 + k22 * c12 * c12));
  surface.hessian(1, 1) = -2 * (d_s * c22 + d_t * (k11 * c12 * c12 + 2 * k12 * c12 * c22 + k22 * c22 * c22));
  surface.depends(cornea_c, -(d_c11 + d_c22) / ratio);
  surface.depends(cornea_j0, -(d_c11 - d_c22) / ratio - split / j_scale * (d_q0 - along * j0));
  surface.depends(cornea_j45, -d_c12 / ratio - split / j_scale * (d_q45 - along * j45));
  surface.depends(cornea_q, -d_t * (v1 * v1 + v2 * v2));
  surface.depends(cornea_q_split, -(d_q0 * j0 + d_q45 * j45) / j_scale);
  if (back) {
    surface.depends(cornea_thickness, -1);
    surface.depends(cornea_back_ratio, (d_c11 * c11 + d_c22 * c22 + d_c12 * c12) / ratio);
  }
  if (field) {
    const double times = back ? a[field->back_ratio] : 1;
    surface.f -= times * field->depth;
    surface.gradient.head<2>() -= times * field->gradient;
    for (int i = 0; i < corneal_form_terms; ++i)
      surface.depends(field->first + i, -times * field->d_depth[i]);
    if (back) surface.depends(field->back_ratio, -field->depth);
  }
  return surface;
}

EyeSurface lid_surface(const VectorXd& a, const Vector3d& p) {
  const double x = p.x(), y = p.y();
  EyeSurface surface;
  surface.f = -p.z() + a[lid_thickness] - a[lid_tilt_x] * x - a[lid_tilt_y] * y - a[lid_xx] * x * x -
              a[lid_yy] * y * y - a[lid_xy] * x * y;
  surface.gradient = {-a[lid_tilt_x] - 2 * a[lid_xx] * x - a[lid_xy] * y,
                      -a[lid_tilt_y] - 2 * a[lid_yy] * y - a[lid_xy] * x, -1};
  surface.hessian(0, 0) = -2 * a[lid_xx];
  surface.hessian(1, 1) = -2 * a[lid_yy];
  surface.depends(lid_thickness, 1);
  surface.depends(lid_tilt_x, -x);
  surface.depends(lid_tilt_y, -y);
  surface.depends(lid_xx, -x * x);
  surface.depends(lid_yy, -y * y);
  surface.depends(lid_xy, -x * y);
  return surface;
}

EyeSurface globe_surface(const VectorXd& a, const Vector3d& p, WallSide side, const WallFields* fields) {
  const double share = side == WallSide::inner ? 0 : side == WallSide::outer ? 1 : a[wall_inner_share];
  const double rx = a[globe_x] + share * a[wall_lateral], ry = a[globe_y] + share * a[wall_lateral],
               rz = a[globe_z] + share * a[wall_axial];
  const double depth = -p.z() - (a[axial_length] - a[globe_z]);
  const Vector3d q(p.x() / rx, p.y() / ry, depth / rz);
  const double rho = std::max(q.norm(), 0.05);
  const Vector3d d_q = -displacement_sphere_mm / rho * q;

  EyeSurface surface;
  surface.f = displacement_sphere_mm * (1 - rho);
  surface.gradient = {d_q.x() / rx, d_q.y() / ry, -d_q.z() / rz};
  const Vector3d r(rx, ry, -rz), n = q.cwiseQuotient(r) / rho;
  surface.hessian = displacement_sphere_mm / rho * (n * n.transpose());
  surface.hessian.diagonal() -= displacement_sphere_mm / rho * r.cwiseAbs2().cwiseInverse();
  surface.depends(globe_x, -d_q.x() * q.x() / rx);
  surface.depends(globe_y, -d_q.y() * q.y() / ry);
  surface.depends(globe_z, d_q.z() * (1 - q.z()) / rz);
  surface.depends(axial_length, -d_q.z() / rz);
  if (side != WallSide::inner) {
    const double by_lateral = -d_q.x() * q.x() / rx - d_q.y() * q.y() / ry, by_axial = -d_q.z() * q.z() / rz;
    surface.depends(wall_lateral, share * by_lateral);
    surface.depends(wall_axial, share * by_axial);
    if (side == WallSide::between)
      surface.depends(wall_inner_share, a[wall_lateral] * by_lateral + a[wall_axial] * by_axial);
  }
  if (fields) {
    surface.f += fields->displacement;
    surface.gradient += fields->gradient;
  }
  return surface;
}

namespace {

/// A point in the lens's frame, about mid-lens; tilts are about mid-lens, first about +x, then about the fixed +y.
struct InLens {
  InLens(const VectorXd& a, const Vector3d& p)
      : w(p.x() - a[lens_decentre_x], p.y() - a[lens_decentre_y],
          p.z() + a[anterior_chamber_depth] + a[lens_thickness] / 2) {
    const double tx = a[lens_tilt_x] * degree, ty = a[lens_tilt_y] * degree;
    // The rows of the rotation's inverse.
    const double sx = std::sin(tx), cx = std::cos(tx), sy = std::sin(ty), cy = std::cos(ty);
    grad_x = {cy, 0, -sy};
    grad_y = {sx * sy, cx, sx * cy};
    grad_delta = {-cx * sy, sx, -cx * cy};
    x = grad_x.dot(w);
    y = grad_y.dot(w);
    delta = grad_delta.dot(w);
  }
  Vector3d w;  ///< from mid-lens, in the eye frame
  Vector3d grad_x, grad_y, grad_delta;
  double x, y, delta;  ///< delta: along the lens's axis, into the eye
};

}  // namespace

void lens_surfaces(const VectorXd& a, const Vector3d& p, EyeSurface& front, EyeSurface& back,
                   EyeSurface& equator) {
  const double half = a[lens_thickness] / 2;
  const InLens at(a, p);
  const auto& [w, grad_x, grad_y, grad_delta, x, y, delta] = at;
  const double s = x * x + y * y;

  for (const bool is_front : {true, false}) {
    EyeSurface& surface = is_front ? front : back;
    const int radius = is_front ? lens_anterior_radius : lens_posterior_radius;
    const double c = 1 / a[radius];
    const ConicSag sag = conic_sag(s, c, a[is_front ? lens_anterior_q : lens_posterior_q]);
    const double sign = is_front ? 1 : -1;
    surface.f = sign * delta + half - sag.value;
    surface.gradient = sign * grad_delta - sag.d_s * 2 * (x * grad_x + y * grad_y);
    surface.hessian.diagonal() << -2 * sag.d_s, -2 * sag.d_s, 0;
    surface.count = 0;
    surface.depends(radius, sag.d_c * c * c);
    surface.depends(is_front ? lens_anterior_q : lens_posterior_q, -sag.d_q);
    // w.z grows with the depth of mid-lens.
    surface.depends(anterior_chamber_depth, surface.gradient.z());
    surface.depends(lens_thickness, 0.5 + surface.gradient.z() / 2);
    surface.depends(lens_decentre_x, -surface.gradient.x());
    surface.depends(lens_decentre_y, -surface.gradient.y());
    const double d_x = -sag.d_s * 2 * x, d_y = -sag.d_s * 2 * y;
    surface.depends(lens_tilt_x, degree * (d_y * w.z() + sign * w.y()));
    surface.depends(lens_tilt_y, degree * (-d_x * w.z() - sign * w.x()));
  }
  const double r = std::max(std::sqrt(s), 0.3);
  equator.f = a[lens_equator_radius] - r;
  equator.gradient = -(x * grad_x + y * grad_y) / r;
  equator.count = 0;
  equator.depends(lens_equator_radius, 1);
  equator.depends(lens_decentre_x, x / r);
  equator.depends(lens_decentre_y, y / r);
}

EyeSurface nucleus_surface(const VectorXd& a, const Vector3d& p) {
  const InLens at(a, p);
  const double across = nucleus_share * a[lens_equator_radius], along = nucleus_share * a[lens_thickness] / 2;
  const double x = at.x / across, y = at.y / across, delta = at.delta / along;
  const double rho = std::max(std::sqrt(x * x + y * y + delta * delta), 0.1);
  // By the point's coordinates in the lens; F is a length along its axis.
  const double d_x = -along * x / (rho * across), d_y = -along * y / (rho * across), d_delta = -delta / rho;

  EyeSurface surface;
  surface.f = along * (1 - rho);
  surface.gradient = d_x * at.grad_x + d_y * at.grad_y + d_delta * at.grad_delta;
  surface.depends(anterior_chamber_depth, surface.gradient.z());
  surface.depends(lens_thickness,
                  surface.gradient.z() / 2 + nucleus_share / 2 * (1 - rho + delta * delta / rho));
  surface.depends(lens_equator_radius, nucleus_share * along * (x * x + y * y) / (rho * across));
  surface.depends(lens_decentre_x, -surface.gradient.x());
  surface.depends(lens_decentre_y, -surface.gradient.y());
  surface.depends(lens_tilt_x, degree * (d_y * at.w.z() + d_delta * at.w.y()));
  surface.depends(lens_tilt_y, degree * (-d_x * at.w.z() - d_delta * at.w.x()));
  return surface;
}

void iris_surfaces(const VectorXd& a, const Vector3d& p, EyeSurface& top, EyeSurface& bottom,
                   EyeSurface& pupil) {
  const double r = std::max(p.head<2>().norm(), 0.3);
  const double arm = r - iris_reference_radius_mm;
  const double depth = a[anterior_chamber_depth] + a[iris_offset] + a[iris_slope] * arm;
  const Vector3d radial(p.x() / r, p.y() / r, 0);
  for (const bool is_top : {true, false}) {
    EyeSurface& surface = is_top ? top : bottom;
    const double sign = is_top ? -1 : 1;
    surface.f = -p.z() - depth - sign * a[iris_half_thickness];
    surface.gradient = -a[iris_slope] * radial - Vector3d::UnitZ();
    surface.count = 0;
    surface.depends(anterior_chamber_depth, -1);
    surface.depends(iris_offset, -1);
    surface.depends(iris_slope, -arm);
    surface.depends(iris_half_thickness, -sign);
  }
  pupil.f = r - a[pupil_radius];
  pupil.gradient = radial;
  pupil.count = 0;
  pupil.depends(pupil_radius, -1);
}

}  // namespace emmetrope::segmentation
