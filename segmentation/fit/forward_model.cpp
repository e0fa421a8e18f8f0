#include "segmentation/fit/forward_model.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "pipeline/base/frames.hpp"
#include "raytrace/eye/parametric_eye.hpp"
#include "segmentation/fit/edge_response.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

/// Radius of the sphere on which the wall's displacement is meant in mm.
constexpr double displacement_sphere_mm = 11;
constexpr double coil_length_mm = 12;
/// Radius at which the iris lies `iris_offset` behind the front vertex of the lens, on which it rests.
constexpr double iris_reference_radius_mm = 3;

/// Columns x, y, z of the eye in LPS for a gaze (rad), or its derivative by one of them.
Matrix3d eye_axes(double h, double v) {
  const double sh = std::sin(h), ch = std::cos(h), sv = std::sin(v), cv = std::cos(v);
  Matrix3d r;
  r.col(0) = Vector3d(ch, sh, 0);
  r.col(1) = Vector3d(-sh * sv, ch * sv, cv);
  r.col(2) = Vector3d(sh * cv, -ch * cv, sv);
  return r;
}
Matrix3d eye_axes_by_h(double h, double v) {
  const double sh = std::sin(h), ch = std::cos(h), sv = std::sin(v), cv = std::cos(v);
  Matrix3d r;
  r.col(0) = Vector3d(-sh, ch, 0);
  r.col(1) = Vector3d(-ch * sv, -sh * sv, 0);
  r.col(2) = Vector3d(ch * cv, sh * cv, 0);
  return r;
}
Matrix3d eye_axes_by_v(double h, double v) {
  const double sh = std::sin(h), ch = std::cos(h), sv = std::sin(v), cv = std::cos(v);
  Matrix3d r;
  r.col(0) = Vector3d::Zero();
  r.col(1) = Vector3d(-sh * cv, ch * cv, -sv);
  r.col(2) = Vector3d(-sh * sv, ch * sv, cv);
  return r;
}

/// Depth of a rotationally symmetric conic at squared radius s, with derivatives by s, curvature and Q.
struct ConicSag {
  double value, by_s, by_c, by_q;
};
ConicSag conic_sag(double s, double c, double q) {
  // Beyond the conic's reach (a far voxel) its slope is kept finite.
  const double inside = std::max(1 - (1 + q) * c * c * s, 0.05);
  const double root = std::sqrt(inside), d = 1 + root;
  const double by_root = -c * s / (d * d);  // d value / d root
  return {c * s / d, c / d + by_root * (-(1 + q) * c * c) / (2 * root),
          s / d + by_root * (-2 * (1 + q) * c * s) / (2 * root), by_root * (-c * c * s) / (2 * root)};
}

/// A bump's Gaussian of the angle from its direction, as a function of the angle's cosine.
struct Bump {
  double value, by_cosine;
};
Bump exact_bump(double cosine) {
  const double angle = std::acos(std::clamp(cosine, -1.0, 1.0)), sine = std::sin(angle);
  const double value = std::exp(-angle * angle / (2 * bump_width_rad * bump_width_rad));
  return {value, value / (bump_width_rad * bump_width_rad) * (sine > 1e-6 ? angle / sine : 1)};
}

/// Cubic interpolation on a grid of cosines, right to 1e-8: acos and exp would take a quarter of a fit.
class BumpTable {
 public:
  BumpTable() {
    for (int i = 0; i <= intervals; ++i)
      nodes_[i] = exact_bump(1 - (1 - first_) * (1 - double(i) / intervals));
  }
  Bump operator()(double cosine) const {
    if (cosine < first_) return exact_bump(cosine);
    const double step = (1 - first_) / intervals, x = std::min(cosine - first_, 1 - first_) / step;
    const int i = std::min(static_cast<int>(x), intervals - 1);
    const double t = x - i, s = 1 - t;
    const Bump &a = nodes_[i], &b = nodes_[i + 1];
    const double rise = (b.value - a.value) / step;
    return {s * s * (1 + 2 * t) * a.value + t * t * (1 + 2 * s) * b.value +
                step * s * t * (s * a.by_cosine - t * b.by_cosine),
            6 * s * t * rise + s * (1 - 3 * t) * a.by_cosine + t * (1 - 3 * s) * b.by_cosine};
  }

 private:
  static constexpr int intervals = 256;
  const double first_ = std::cos(3.3 * bump_width_rad);
  std::array<Bump, intervals + 1> nodes_;
};

Bump bump_at(double cosine) {
  static const BumpTable table;
  return table(cosine);
}

}  // namespace

ForwardModel::ForwardModel(ParameterLayout layout, std::vector<StackSampling> stacks, Vector3d coil_reference)
    : layout_(layout), stacks_(std::move(stacks)), coil_reference_(std::move(coil_reference)) {
  if (layout_.bumps > 0) bumps_ = bump_directions();
}

/// F > 0 inside, its gradient and second derivatives in the eye frame, and its derivatives by shape
/// parameters.
struct ForwardModel::AtParameters::Surface {
  double f = 0;
  Vector3d gradient = Vector3d::Zero();
  Matrix3d hessian = Matrix3d::Zero();  ///< near the surface, to a tenth: it corrects microns
  int count = 0;
  std::array<int, 9> index;
  std::array<double, 9> by;
  void depends(int parameter, double derivative) {
    index[count] = parameter;
    by[count++] = derivative;
  }
};

/// Fields on the wall at a voxel: the displacement with its gradient, and the background.
struct ForwardModel::AtParameters::Wall {
  double u = 0, background = 0;
  Vector3d gradient = Vector3d::Zero();
  std::array<double, 128> bump;  ///< at most all of bump_directions()
};

struct ForwardModel::AtParameters::Edge {
  double value, by_f, by_log_sharpness;
};

ForwardModel::AtParameters::AtParameters(const ForwardModel& model, const VectorXd& parameters)
    : model_(model), a_(parameters) {
  const double h = a_[gaze_horizontal] * degree, v = a_[gaze_vertical] * degree;
  eye_from_lps_ = eye_axes(h, v).transpose();
  by_horizontal_ = eye_axes_by_h(h, v).transpose() * degree;
  by_vertical_ = eye_axes_by_v(h, v).transpose() * degree;
  for (std::size_t s = 0; s < model.stacks_.size(); ++s) {
    const StackSampling& stack = model.stacks_[s];
    const double sharpness = std::exp(a_[model.layout_.stack(static_cast<int>(s)) + log_sharpness]);
    stack_in_eye_.push_back({eye_from_lps_ * stack.along_row, eye_from_lps_ * stack.along_column,
                             eye_from_lps_ * stack.normal, 1 / (stack.row_cutoff_per_mm * sharpness),
                             1 / (stack.column_cutoff_per_mm * sharpness)});
  }
}

Vector3d ForwardModel::AtParameters::to_eye(const Vector3d& position, int stack) const {
  const Vector3d shift = a_.segment<3>(model_.layout_.stack(stack) + shift_first);
  return eye_from_lps_ * (position + shift - a_.segment<3>(apex_x));
}

ForwardModel::AtParameters::Surface ForwardModel::AtParameters::cornea_surface(const Vector3d& p,
                                                                               bool back) const {
  const double ratio = back ? a_[cornea_back_ratio] : 1;
  const double c11 = (a_[cornea_c] + a_[cornea_j0]) / ratio, c22 = (a_[cornea_c] - a_[cornea_j0]) / ratio,
               c12 = a_[cornea_j45] / ratio;
  // I + Q, with the split of Q along the principal meridians.
  const double j0 = a_[cornea_j0], j45 = a_[cornea_j45], split = a_[cornea_q_split];
  const double j_scale = std::hypot(j0, j45, cornea_split_scale_per_mm);
  const double k11 = 1 + a_[cornea_q] + split * j0 / j_scale, k22 = 1 + a_[cornea_q] - split * j0 / j_scale,
               k12 = split * j45 / j_scale;
  const double x = p.x(), y = p.y();
  const double v1 = c11 * x + c12 * y, v2 = c12 * x + c22 * y;
  const double w1 = k11 * v1 + k12 * v2, w2 = k12 * v1 + k22 * v2;
  const double s = x * v1 + y * v2, t = v1 * w1 + v2 * w2;
  const double root = std::sqrt(std::max(1 - t, 0.05)), d = 1 + root;
  const double by_s = 1 / d, by_t = s / (2 * root * d * d);
  const double by_c11 = by_s * x * x + by_t * 2 * w1 * x;
  const double by_c22 = by_s * y * y + by_t * 2 * w2 * y;
  const double by_c12 = by_s * 2 * x * y + by_t * 2 * (w1 * y + w2 * x);
  // By the split's components along 0 and 45 degrees.
  const double by_q0 = by_t * (v1 * v1 - v2 * v2), by_q45 = by_t * 2 * v1 * v2;
  const double along = (by_q0 * j0 + by_q45 * j45) / (j_scale * j_scale);

  Surface surface;
  surface.f = -p.z() - s / d - (back ? a_[cornea_thickness] : 0);
  surface.gradient = {-(by_s * 2 * v1 + by_t * 2 * (c11 * w1 + c12 * w2)),
                      -(by_s * 2 * v2 + by_t * 2 * (c12 * w1 + c22 * w2)), -1};
  // Of S and T; the mixed terms are small within the cornea.
  surface.hessian(0, 0) =
      -2 * (by_s * c11 + by_t * (k11 * c11 * c11 + 2 * k12 * c11 * c12 + k22 * c12 * c12));
  surface.hessian(1, 1) =
      -2 * (by_s * c22 + by_t * (k11 * c12 * c12 + 2 * k12 * c12 * c22 + k22 * c22 * c22));
  surface.depends(cornea_c, -(by_c11 + by_c22) / ratio);
  surface.depends(cornea_j0, -(by_c11 - by_c22) / ratio - split / j_scale * (by_q0 - along * j0));
  surface.depends(cornea_j45, -by_c12 / ratio - split / j_scale * (by_q45 - along * j45));
  surface.depends(cornea_q, -by_t * (v1 * v1 + v2 * v2));
  surface.depends(cornea_q_split, -(by_q0 * j0 + by_q45 * j45) / j_scale);
  if (back) {
    surface.depends(cornea_thickness, -1);
    surface.depends(cornea_back_ratio, (by_c11 * c11 + by_c22 * c22 + by_c12 * c12) / ratio);
  }
  return surface;
}

ForwardModel::AtParameters::Surface ForwardModel::AtParameters::lid_surface(const Vector3d& p) const {
  const double x = p.x(), y = p.y();
  Surface surface;
  surface.f = -p.z() + a_[lid_thickness] - a_[lid_tilt_x] * x - a_[lid_tilt_y] * y - a_[lid_xx] * x * x -
              a_[lid_yy] * y * y - a_[lid_xy] * x * y;
  surface.gradient = {-a_[lid_tilt_x] - 2 * a_[lid_xx] * x - a_[lid_xy] * y,
                      -a_[lid_tilt_y] - 2 * a_[lid_yy] * y - a_[lid_xy] * x, -1};
  surface.hessian(0, 0) = -2 * a_[lid_xx];
  surface.hessian(1, 1) = -2 * a_[lid_yy];
  surface.depends(lid_thickness, 1);
  surface.depends(lid_tilt_x, -x);
  surface.depends(lid_tilt_y, -y);
  surface.depends(lid_xx, -x * x);
  surface.depends(lid_yy, -y * y);
  surface.depends(lid_xy, -x * y);
  return surface;
}

ForwardModel::AtParameters::Surface ForwardModel::AtParameters::globe_surface(const Vector3d& p, bool outer,
                                                                              const Wall* wall_at) const {
  const double lateral = outer ? a_[wall_lateral] : 0, axial = outer ? a_[wall_axial] : 0;
  const double rx = a_[globe_x] + lateral, ry = a_[globe_y] + lateral, rz = a_[globe_z] + axial;
  const double depth = -p.z() - (a_[axial_length] - a_[globe_z]);
  const Vector3d q(p.x() / rx, p.y() / ry, depth / rz);
  const double rho = std::max(q.norm(), 0.05);
  const Vector3d by_q = -displacement_sphere_mm / rho * q;

  Surface surface;
  surface.f = displacement_sphere_mm * (1 - rho);
  surface.gradient = {by_q.x() / rx, by_q.y() / ry, -by_q.z() / rz};
  const Vector3d r(rx, ry, -rz), n = q.cwiseQuotient(r) / rho;
  surface.hessian = displacement_sphere_mm / rho * (n * n.transpose());
  surface.hessian.diagonal() -= displacement_sphere_mm / rho * r.cwiseAbs2().cwiseInverse();
  surface.depends(globe_x, -by_q.x() * q.x() / rx);
  surface.depends(globe_y, -by_q.y() * q.y() / ry);
  surface.depends(globe_z, by_q.z() * (1 - q.z()) / rz);
  surface.depends(axial_length, -by_q.z() / rz);
  if (outer) {
    surface.depends(wall_lateral, -by_q.x() * q.x() / rx - by_q.y() * q.y() / ry);
    surface.depends(wall_axial, -by_q.z() * q.z() / rz);
  }
  if (wall_at) {
    surface.f += wall_at->u;
    surface.gradient += wall_at->gradient;
  }
  return surface;
}

void ForwardModel::AtParameters::lens_surfaces(const Vector3d& p, Surface& front, Surface& back,
                                               Surface& equator) const {
  const double acd = a_[anterior_chamber_depth], half = a_[lens_thickness] / 2;
  const double tx = a_[lens_tilt_x] * degree, ty = a_[lens_tilt_y] * degree;
  const Vector3d w(p.x() - a_[lens_decentre_x], p.y() - a_[lens_decentre_y], p.z() + acd + half);
  // About mid-lens, first about +x, then about the fixed +y: the rows of the rotation's inverse.
  const double sx = std::sin(tx), cx = std::cos(tx), sy = std::sin(ty), cy = std::cos(ty);
  const Vector3d grad_x(cy, 0, -sy), grad_y(sx * sy, cx, sx * cy), grad_delta(-cx * sy, sx, -cx * cy);
  const double x = grad_x.dot(w), y = grad_y.dot(w), delta = grad_delta.dot(w);
  const double s = x * x + y * y;

  for (const bool is_front : {true, false}) {
    Surface& surface = is_front ? front : back;
    const int radius = is_front ? lens_anterior_radius : lens_posterior_radius;
    const double c = 1 / a_[radius];
    const ConicSag sag = conic_sag(s, c, a_[is_front ? lens_anterior_q : lens_posterior_q]);
    const double sign = is_front ? 1 : -1;
    surface.f = sign * delta + half - sag.value;
    surface.gradient = sign * grad_delta - sag.by_s * 2 * (x * grad_x + y * grad_y);
    surface.hessian.diagonal() << -2 * sag.by_s, -2 * sag.by_s, 0;
    surface.count = 0;
    surface.depends(radius, sag.by_c * c * c);
    surface.depends(is_front ? lens_anterior_q : lens_posterior_q, -sag.by_q);
    // w.z grows with the depth of mid-lens.
    surface.depends(anterior_chamber_depth, surface.gradient.z());
    surface.depends(lens_thickness, 0.5 + surface.gradient.z() / 2);
    surface.depends(lens_decentre_x, -surface.gradient.x());
    surface.depends(lens_decentre_y, -surface.gradient.y());
    const double by_x = -sag.by_s * 2 * x, by_y = -sag.by_s * 2 * y;
    surface.depends(lens_tilt_x, degree * (by_y * w.z() + sign * w.y()));
    surface.depends(lens_tilt_y, degree * (-by_x * w.z() - sign * w.x()));
  }
  const double r = std::max(std::sqrt(s), 0.3);
  equator.f = a_[lens_equator_radius] - r;
  equator.gradient = -(x * grad_x + y * grad_y) / r;
  equator.count = 0;
  equator.depends(lens_equator_radius, 1);
  equator.depends(lens_decentre_x, x / r);
  equator.depends(lens_decentre_y, y / r);
}

void ForwardModel::AtParameters::iris_surfaces(const Vector3d& p, Surface& top, Surface& bottom,
                                               Surface& pupil) const {
  const double r = std::max(std::hypot(p.x(), p.y()), 0.3);
  const double arm = r - iris_reference_radius_mm;
  const double depth = a_[anterior_chamber_depth] + a_[iris_offset] + a_[iris_slope] * arm;
  const Vector3d radial(p.x() / r, p.y() / r, 0);
  for (const bool is_top : {true, false}) {
    Surface& surface = is_top ? top : bottom;
    const double sign = is_top ? -1 : 1;
    surface.f = -p.z() - depth - sign * a_[iris_half_thickness];
    surface.gradient = -a_[iris_slope] * radial - Vector3d::UnitZ();
    surface.count = 0;
    surface.depends(anterior_chamber_depth, -1);
    surface.depends(iris_offset, -1);
    surface.depends(iris_slope, -arm);
    surface.depends(iris_half_thickness, -sign);
  }
  pupil.f = r - a_[pupil_radius];
  pupil.gradient = radial;
  pupil.count = 0;
  pupil.depends(pupil_radius, -1);
}

ForwardModel::AtParameters::Wall ForwardModel::AtParameters::wall_fields(const Sample& sample,
                                                                         const Vector3d& p) const {
  Wall wall_at;
  const double depth = -p.z() - (a_[axial_length] - a_[globe_z]);
  const Vector3d r(a_[globe_x], a_[globe_y], a_[globe_z]);
  const Vector3d q(p.x() / r.x(), p.y() / r.y(), -depth / r.z());
  const double rho = std::max(q.norm(), 0.05);
  const Vector3d n = q / rho;
  const int displacement_at = model_.layout_.displacement(), background_at = model_.layout_.background();
  Vector3d by_n = Vector3d::Zero();
  for (std::size_t k = 0; k < sample.bumps.size(); ++k) {
    const int i = sample.bumps[k];
    const Bump bump = bump_at(n.dot(model_.bumps_[i]));
    wall_at.bump[k] = bump.value;
    const double u = a_[displacement_at + i];
    wall_at.u += u * bump.value;
    wall_at.background += a_[background_at + i] * bump.value;
    by_n += u * bump.by_cosine * model_.bumps_[i];
  }
  const Vector3d by_q = (by_n - by_n.dot(n) * n) / rho;
  wall_at.gradient = by_q.cwiseQuotient(r);
  return wall_at;
}

ForwardModel::AtParameters::Edge ForwardModel::AtParameters::edge(const Surface& surface, int stack) const {
  const StackInEye& axes = stack_in_eye_[stack];
  const double a = std::abs(surface.gradient.dot(axes.row)), b = std::abs(surface.gradient.dot(axes.column));
  const double through = std::abs(surface.gradient.dot(axes.normal));
  const double exact_in_plane = std::sqrt(a * a + b * b);
  // Where a surface is parallel to the slice the slice alone blurs it; the floor keeps the ratio finite.
  const double in_plane = std::max(exact_in_plane, 0.01 * through) + 1e-12;
  const double inverse_cutoff = exact_in_plane > 1e-9
                                    ? std::max(a * axes.inverse_kx, b * axes.inverse_ky) / exact_in_plane
                                    : std::max(axes.inverse_kx, axes.inverse_ky);
  const double per_f = 2 / (inverse_cutoff * in_plane);
  const StackSampling& sampling = model_.stacks_[stack];
  const double half = sampling.thickness_mm / sampling.subslices / 2;
  // Within a sub-slice a curved surface lies on the average this far (in F) inside its tangent plane.
  const double bend = half * half / 6 * axes.normal.dot(surface.hessian * axes.normal);
  const EdgeValue e = averaged_edge(per_f * (surface.f + bend), per_f * half * through);
  return {e.value, e.derivative * per_f, e.scale_derivative};
}

double ForwardModel::AtParameters::intensity(const Sample& sample, SparseRow* row) const {
  const ParameterLayout& layout = model_.layout_;
  const int stack = sample.stack;
  const StackSampling& sampling = model_.stacks_[stack];
  const int at_stack = layout.stack(stack);
  if (row) row->clear();

  const double weight = 1.0 / sampling.subslices;
  double sum = 0;
  Vector3d by_position = Vector3d::Zero();  // d sum / d(point in the eye frame)
  double by_sharpness = 0;

  Wall wall_at;
  if (sample.near_wall && !sample.bumps.empty())
    wall_at = wall_fields(sample, to_eye(sample.position, stack));
  double by_u = 0, by_background = 0;

  for (int k = 0; k < sampling.subslices; ++k) {
    const double offset = ((k + 0.5) * weight - 0.5) * sampling.thickness_mm;
    const Vector3d in_lps = sample.position + offset * sampling.normal;
    const Vector3d p = to_eye(in_lps, stack);
    Vector3d gradient = Vector3d::Zero();

    // A surface whose edge enters the intensity with this coefficient.
    const auto enter = [&](const Surface& surface, const Edge& e, double coefficient) {
      by_sharpness += weight * coefficient * e.by_log_sharpness;
      const double by_f = weight * coefficient * e.by_f;
      gradient += by_f * surface.gradient;
      for (int i = 0; i < surface.count; ++i) row->add(surface.index[i], by_f * surface.by[i]);
      return by_f;
    };

    const bool front = sample.zone == Zone::front;
    const double fluid = a_[front ? aqueous : vitreous];
    double of_fluid = 0;
    if (front) {
      Edge lid_edge{1, 0, 0}, front_edge{1, 0, 0}, back_edge{1, 0, 0};
      if (sample.near_cornea) {
        const Surface lid_front = lid_surface(p), cornea_front = cornea_surface(p, false),
                      cornea_back = cornea_surface(p, true);
        lid_edge = edge(lid_front, stack);
        front_edge = edge(cornea_front, stack);
        back_edge = edge(cornea_back, stack);
        if (row) {
          enter(lid_front, lid_edge, a_[lid] - a_[air]);
          enter(cornea_front, front_edge, a_[cornea] - a_[lid]);
          enter(cornea_back, back_edge, fluid - a_[cornea]);
          row->add(air, weight * (1 - lid_edge.value));
          row->add(lid, weight * (lid_edge.value - front_edge.value));
          row->add(cornea, weight * (front_edge.value - back_edge.value));
        }
      }
      sum += weight * (a_[air] + (a_[lid] - a_[air]) * lid_edge.value +
                       (a_[cornea] - a_[lid]) * front_edge.value + (fluid - a_[cornea]) * back_edge.value);
      of_fluid += back_edge.value;
    } else {
      Edge outer_edge{1, 0, 0}, inner_edge{1, 0, 0};
      const double outside = a_[surround] + wall_at.background;
      if (sample.near_wall) {
        const Surface outer = globe_surface(p, true, &wall_at), inner = globe_surface(p, false, &wall_at);
        outer_edge = edge(outer, stack);
        inner_edge = edge(inner, stack);
        if (row) {
          by_u += enter(outer, outer_edge, a_[wall] - outside);
          by_u += enter(inner, inner_edge, fluid - a_[wall]);
          row->add(surround, weight * (1 - outer_edge.value));
          by_background += weight * (1 - outer_edge.value);
          row->add(wall, weight * (outer_edge.value - inner_edge.value));
        }
      }
      sum += weight *
             (outside + (a_[wall] - outside) * outer_edge.value + (fluid - a_[wall]) * inner_edge.value);
      of_fluid += inner_edge.value;
    }

    if (sample.near_lens) {
      Surface lens_front, lens_back, equator;
      lens_surfaces(p, lens_front, lens_back, equator);
      const Edge f = edge(lens_front, stack), b = edge(lens_back, stack), e = edge(equator, stack);
      const double share = f.value * b.value * e.value;
      const double contrast = a_[lens] - fluid;
      sum += weight * contrast * share;
      of_fluid -= share;
      if (front) {
        Surface top, bottom, pupil;
        iris_surfaces(p, top, bottom, pupil);
        // The iris ends where its back or the lens begins, whichever comes first: a difference of nested
        // regions, so that a gap between iris and lens thinner than the blur is right.
        const double lens_depth = lens_front.f / lens_front.gradient.norm(),
                     bottom_depth = bottom.f / bottom.gradient.norm();
        const bool lens_cuts = lens_depth > bottom_depth;
        const Surface& end = lens_cuts ? lens_front : bottom;
        const Edge t = edge(top, stack), m = lens_cuts ? f : edge(bottom, stack), o = edge(pupil, stack);
        // Where there is iris: its blurred slab rings, and is negative beside it.
        if (top.f / top.gradient.norm() > std::max(lens_depth, bottom_depth)) {
          const double slab = (t.value - m.value) * o.value;
          const double iris_contrast = a_[iris] - fluid;
          sum += weight * iris_contrast * slab;
          of_fluid -= slab;
          if (row) {
            enter(top, t, iris_contrast * o.value);
            enter(end, m, -iris_contrast * o.value);
            enter(pupil, o, iris_contrast * (t.value - m.value));
            row->add(iris, weight * slab);
          }
        }
      }
      if (row) {
        enter(lens_front, f, contrast * b.value * e.value);
        enter(lens_back, b, contrast * f.value * e.value);
        enter(equator, e, contrast * f.value * b.value);
        row->add(lens, weight * share);
      }
    }

    if (row) {
      row->add(front ? aqueous : vitreous, weight * of_fluid);
      const Vector3d arm = in_lps + a_.segment<3>(at_stack + shift_first) - a_.segment<3>(apex_x);
      row->add(gaze_horizontal, gradient.dot(by_horizontal_ * arm));
      row->add(gaze_vertical, gradient.dot(by_vertical_ * arm));
      by_position += gradient;
    }
  }

  // Coil: exp of a polynomial in LPS about the reference.
  const Vector3d x = (sample.position - model_.coil_reference_) / coil_length_mm;
  const std::array<double, coil_count> terms{x.x(),         x.y(),         x.z(),
                                             x.x() * x.x(), x.y() * x.y(), x.z() * x.z(),
                                             x.x() * x.y(), x.y() * x.z(), x.z() * x.x()};
  double log_coil = a_[at_stack + log_gain];
  for (int i = 0; i < coil_count; ++i) log_coil += a_[at_stack + coil_first + i] * terms[i];
  const double coil = std::exp(log_coil);

  if (row) {
    const Vector3d in_lps = eye_from_lps_.transpose() * by_position;
    for (int i = 0; i < 3; ++i) {
      row->add(apex_x + i, -in_lps[i]);
      row->add(at_stack + shift_first + i, in_lps[i]);
    }
    for (std::size_t k = 0; k < sample.bumps.size() && sample.near_wall; ++k) {
      row->add(layout.displacement() + sample.bumps[k], by_u * wall_at.bump[k]);
      row->add(layout.background() + sample.bumps[k], by_background * wall_at.bump[k]);
    }
    row->add(at_stack + log_sharpness, by_sharpness);
    for (int i = 0; i < coil_count; ++i) row->add(at_stack + coil_first + i, sum * terms[i]);
    row->add(at_stack + log_gain, sum);
    row->scale(coil);
  }
  return sum * coil;
}

double ForwardModel::AtParameters::displacement(const Vector3d& direction) const {
  double u = 0;
  for (int i = 0; i < model_.layout_.bumps; ++i)
    u += a_[model_.layout_.displacement() + i] * bump_at(direction.dot(model_.bumps_[i])).value;
  return u;
}

ForwardModel::AtParameters::Distances ForwardModel::AtParameters::distances(const Vector3d& p) const {
  const auto distance = [](const Surface& s) { return s.f / s.gradient.norm(); };
  Distances d;
  d.lid = distance(lid_surface(p));
  d.cornea_front = distance(cornea_surface(p, false));
  d.cornea_back = distance(cornea_surface(p, true));
  Surface front, back, equator;
  lens_surfaces(p, front, back, equator);
  d.lens_front = distance(front);
  d.lens = std::min({distance(front), distance(back), distance(equator)});
  Surface top, bottom, pupil;
  iris_surfaces(p, top, bottom, pupil);
  d.iris = std::min({distance(top), -distance(bottom), distance(pupil)});
  const Vector3d r(a_[globe_x], a_[globe_y], a_[globe_z]);
  const Vector3d q = (p + Vector3d(0, 0, a_[axial_length] - a_[globe_z])).cwiseQuotient(r);
  d.direction = q.squaredNorm() > 1e-12 ? q.normalized() : Vector3d(-Vector3d::UnitZ());
  Wall wall_at;
  // Far from the wall a displacement of tenths of a millimetre decides nothing.
  if (std::abs(distance(globe_surface(p, false, nullptr))) < 5) wall_at.u = displacement(d.direction);
  d.globe = distance(globe_surface(p, false, &wall_at));
  d.outer = distance(globe_surface(p, true, &wall_at));
  return d;
}

double ForwardModel::AtParameters::limbus_misfit(int quadrant, SparseRow* row) const {
  constexpr double limbus_radius_mm = 5.85;  // half the white-to-white distance of adults
  const double angle = (quadrant + 0.5) * pi / 2;
  Vector3d p(limbus_radius_mm * std::cos(angle), limbus_radius_mm * std::sin(angle), 0);
  const Surface front = cornea_surface(p, false);
  p.z() = front.f;  // front.f is minus the sag here: on the cornea
  const Surface globe = globe_surface(p, true, nullptr);
  const double per_f = 1 / globe.gradient.norm();
  if (row) {
    row->clear();
    for (int i = 0; i < globe.count; ++i) row->add(globe.index[i], per_f * globe.by[i]);
    for (int i = 0; i < front.count; ++i) row->add(front.index[i], per_f * globe.gradient.z() * front.by[i]);
  }
  return per_f * globe.f;
}

ForwardModel::AtParameters::SurfacePoint ForwardModel::AtParameters::at_surface(OpticalSurface which,
                                                                                const Vector3d& p,
                                                                                SparseRow* row) const {
  Surface surface;
  Sample everywhere;
  Wall wall_at;
  if (which == OpticalSurface::cornea_anterior || which == OpticalSurface::cornea_posterior) {
    surface = cornea_surface(p, which == OpticalSurface::cornea_posterior);
  } else if (which == OpticalSurface::retina) {
    for (int i = 0; i < model_.layout_.bumps; ++i) everywhere.bumps.push_back(static_cast<std::uint8_t>(i));
    wall_at = wall_fields(everywhere, p);
    surface = globe_surface(p, false, &wall_at);
  } else {
    Surface front, back, equator;
    lens_surfaces(p, front, back, equator);
    surface = which == OpticalSurface::lens_anterior ? front : back;
  }
  const double per_f = 1 / surface.gradient.norm();
  if (row) {
    row->clear();
    for (int i = 0; i < surface.count; ++i) row->add(surface.index[i], per_f * surface.by[i]);
    for (std::size_t k = 0; k < everywhere.bumps.size(); ++k)
      row->add(model_.layout_.displacement() + everywhere.bumps[k], per_f * wall_at.bump[k]);
    const Vector3d arm = eye_from_lps_.transpose() * p;
    const Vector3d in_lps = eye_from_lps_.transpose() * surface.gradient * per_f;
    for (int i = 0; i < 3; ++i) row->add(apex_x + i, -in_lps[i]);
    row->add(gaze_horizontal, per_f * surface.gradient.dot(by_horizontal_ * arm));
    row->add(gaze_vertical, per_f * surface.gradient.dot(by_vertical_ * arm));
  }
  return {per_f * surface.f, -per_f * surface.gradient};
}

}  // namespace emmetrope::segmentation
