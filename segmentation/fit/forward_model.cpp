#include "segmentation/fit/forward_model.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "pipeline/base/frames.hpp"
#include "segmentation/fit/edge_response.hpp"
#include "segmentation/fit/eye_surfaces.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double coil_length_mm = 12;

/// Fat is brighter than the wall by this, where its share is asked for.
constexpr double least_over_wall = 0.2;

/// The larger of two positive numbers, up to 12 % more where both are alike. Towards a corner of the
/// scanner's rectangle in k-space a plane edge would be sharpest; a curved one has directions on both sides
/// of the corner and is blurred by their mean.
double rounded_maximum(double a, double b) {
  const double a2 = a * a, b2 = b * b;
  return std::sqrt(std::cbrt(a2 * a2 * a2 + b2 * b2 * b2));
}

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

}  // namespace

double fat_signal(double around, double wall, double fat) {
  return fat * (around - wall) / std::max(fat - wall, least_over_wall);
}

ForwardModel::ForwardModel(ParameterLayout layout, std::vector<StackSampling> stacks, Vector3d coil_reference)
    : layout_(layout), stacks_(std::move(stacks)), coil_reference_(std::move(coil_reference)) {
  if (layout_.bumps > 0) bumps_ = bump_directions();
}

ForwardModel ForwardModel::with_irregular_cornea() const {
  ForwardModel irregular = *this;
  irregular.layout_.irregular_cornea = true;
  return irregular;
}

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
    const int at = model.layout_.stack(static_cast<int>(s));
    const double sharpness = std::exp(a_[at + log_sharpness]);
    const Vector3d turn_deg = a_.segment<3>(at + turn_first);
    const double angle_deg = turn_deg.norm();
    const Matrix3d turn = angle_deg > 0
                              ? Eigen::AngleAxisd(angle_deg * degree, turn_deg / angle_deg).toRotationMatrix()
                              : Matrix3d(Matrix3d::Identity());
    const Matrix3d eye_from_stack = eye_from_lps_ * turn;
    StackInEye axes;
    axes.row = eye_from_stack * stack.along_row;
    axes.column = eye_from_stack * stack.along_column;
    axes.normal = eye_from_stack * stack.normal;
    axes.inverse_kx = 1 / (stack.row_cutoff_per_mm * sharpness);
    axes.inverse_ky = 1 / (stack.column_cutoff_per_mm * sharpness);
    axes.turn = turn;
    axes.place = model.coil_reference_ - turn * model.coil_reference_ + a_.segment<3>(at + shift_first);
    const Vector2d fat_shift = a_.segment<2>(at + fat_shift_first);
    axes.fat_shift = fat_shift.x() * axes.row + fat_shift.y() * axes.column;
    axes.has_fat_shift = !fat_shift.isZero() || !stack.fat_shift_sigma_mm.isZero();
    stack_in_eye_.push_back(axes);
  }
}

Vector3d ForwardModel::AtParameters::to_eye(const Vector3d& position, int stack) const {
  const StackInEye& axes = stack_in_eye_[stack];
  return eye_from_lps_ * (axes.turn * position + axes.place - a_.segment<3>(apex_x));
}

std::optional<CorneaField> ForwardModel::AtParameters::cornea_field(const Vector3d& p) const {
  const ParameterLayout& layout = model_.layout_;
  if (!layout.irregular_cornea) return std::nullopt;
  const CornealForm form = corneal_form(p.x(), p.y());
  CorneaField field;
  field.first = layout.corneal_form();
  field.back_ratio = layout.back_form_ratio();
  for (int i = 0; i < corneal_form_terms; ++i) {
    field.by[i] = 1e-3 * form.value[i];
    field.depth += a_[field.first + i] * field.by[i];
    field.gradient += 1e-3 * a_[field.first + i] * form.gradient_per_mm[i];
  }
  return field;
}

EyeSurface ForwardModel::AtParameters::cornea_at(const Vector3d& p, bool back) const {
  const std::optional<CorneaField> field = cornea_field(p);
  return cornea_surface(a_, p, back, field ? &*field : nullptr);
}

WallFields ForwardModel::AtParameters::wall_fields(const std::vector<std::uint8_t>& bumps,
                                                   const Vector3d& p) const {
  WallFields wall_at;
  const double depth = -p.z() - (a_[axial_length] - a_[globe_z]);
  const Vector3d r(a_[globe_x], a_[globe_y], a_[globe_z]);
  const Vector3d q(p.x() / r.x(), p.y() / r.y(), -depth / r.z());
  const double rho = std::max(q.norm(), 0.05);
  const Vector3d n = q / rho;
  const ParameterLayout& layout = model_.layout_;
  Vector3d by_n = Vector3d::Zero();
  for (std::size_t k = 0; k < bumps.size(); ++k) {
    const int i = bumps[k];
    const Bump bump = bump_at(n.dot(model_.bumps_[i]));
    wall_at.bump[k] = bump.value;
    const double u = a_[layout.displacement() + i];
    wall_at.u += u * bump.value;
    wall_at.background += a_[layout.background() + i] * bump.value;
    by_n += u * bump.by_cosine * model_.bumps_[i];
  }
  const Vector3d by_q = (by_n - by_n.dot(n) * n) / rho;
  wall_at.gradient = by_q.cwiseQuotient(r);
  return wall_at;
}

ForwardModel::AtParameters::Edge ForwardModel::AtParameters::edge(const EyeSurface& surface,
                                                                  int stack) const {
  const StackInEye& axes = stack_in_eye_[stack];
  const double a = std::abs(surface.gradient.dot(axes.row)), b = std::abs(surface.gradient.dot(axes.column));
  const double through = std::abs(surface.gradient.dot(axes.normal));
  const double exact_in_plane = std::sqrt(a * a + b * b);
  // Where a surface is parallel to the slice the slice alone blurs it; the floor keeps the ratio finite.
  const double in_plane = std::max(exact_in_plane, 0.01 * through) + 1e-12;
  const double inverse_cutoff =
      exact_in_plane > 1e-9 ? rounded_maximum(a * axes.inverse_kx, b * axes.inverse_ky) / exact_in_plane
                            : std::max(axes.inverse_kx, axes.inverse_ky);
  const double per_f = 2 / (inverse_cutoff * in_plane);
  const StackSampling& sampling = model_.stacks_[stack];
  const double half = sampling.thickness_mm / sampling.subslices / 2;
  // Within a sub-slice a curved surface lies on the average this far (in F) inside its tangent plane.
  const double bend = half * half / 6 * axes.normal.dot(surface.hessian * axes.normal);
  const EdgeValue e = averaged_edge(per_f * (surface.f + bend), per_f * half * through);
  return {e.value, e.derivative * per_f, e.scale_derivative};
}

std::array<double, coil_count> ForwardModel::AtParameters::coil_terms(const Vector3d& position) const {
  const Vector3d x = (position - model_.coil_reference_) / coil_length_mm;
  return {x.x(),         x.y(),         x.z(),         x.x() * x.x(), x.y() * x.y(),
          x.z() * x.z(), x.x() * x.y(), x.y() * x.z(), x.z() * x.x()};
}

double ForwardModel::AtParameters::coil(const Sample& sample) const {
  const int at = model_.layout_.stack(sample.stack);
  const std::array<double, coil_count> terms = coil_terms(sample.position);
  double log_coil = a_[at + log_gain];
  for (int i = 0; i < coil_count; ++i) log_coil += a_[at + coil_first + i] * terms[i];
  return std::exp(log_coil);
}

double ForwardModel::AtParameters::intensity(const Sample& sample, SparseRow* row) const {
  const ParameterLayout& layout = model_.layout_;
  const int stack = sample.stack;
  const StackSampling& sampling = model_.stacks_[stack];
  const StackInEye& axes = stack_in_eye_[stack];
  const int at_stack = layout.stack(stack);
  if (row) row->clear();

  const double weight = 1.0 / sampling.subslices;
  double sum = 0;
  Vector3d by_position = Vector3d::Zero();  // d sum / d(point in the eye frame)
  Vector3d by_turn = Vector3d::Zero();      // in LPS, per rad
  double by_sharpness = 0;

  WallFields wall_at;
  if (sample.near_wall && !sample.bumps.empty())
    wall_at = wall_fields(sample.bumps, to_eye(sample.position, stack));
  double by_u = 0, by_background = 0;
  Vector3d by_fat_shift = Vector3d::Zero();  // in the eye frame

  for (int k = 0; k < sampling.subslices; ++k) {
    const double offset = ((k + 0.5) * weight - 0.5) * sampling.thickness_mm;
    const Vector3d in_lps = sample.position + offset * sampling.normal;
    const Vector3d p = to_eye(in_lps, stack);
    Vector3d gradient = Vector3d::Zero();

    // A surface whose edge enters the intensity with this coefficient.
    const auto enter = [&](const EyeSurface& surface, const Edge& e, double coefficient) {
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
        const std::optional<CorneaField> field = cornea_field(p);
        const CorneaField* form = field ? &*field : nullptr;
        const EyeSurface lid_front = lid_surface(a_, p), cornea_front = cornea_surface(a_, p, false, form),
                         cornea_back = cornea_surface(a_, p, true, form);
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
      Edge outer_edge{1, 0, 0}, inner_edge{1, 0, 0}, fat_edge{1, 0, 0};
      const double outside = a_[surround] + wall_at.background;
      const double fat = fat_signal(outside, a_[wall], sampling.fat);
      if (sample.near_wall) {
        const EyeSurface outer = globe_surface(a_, p, true, &wall_at),
                         inner = globe_surface(a_, p, false, &wall_at);
        outer_edge = fat_edge = edge(outer, stack);
        inner_edge = edge(inner, stack);
        EyeSurface fat_begins = outer;
        if (axes.has_fat_shift) {
          fat_begins = globe_surface(a_, p - axes.fat_shift, true, &wall_at);
          fat_edge = edge(fat_begins, stack);
        }
        if (row) {
          const double by_f = enter(fat_begins, fat_edge, -fat);
          by_fat_shift -= by_f * fat_begins.gradient;
          by_u += by_f + enter(outer, outer_edge, a_[wall] - outside + fat);
          by_u += enter(inner, inner_edge, fluid - a_[wall]);
          const double over_wall = sampling.fat - a_[wall];
          const double by_share =
              (outer_edge.value - fat_edge.value) * sampling.fat / std::max(over_wall, least_over_wall);
          const double by_outside = 1 - outer_edge.value + by_share;
          row->add(surround, weight * by_outside);
          by_background += weight * by_outside;
          const double share_by_wall = over_wall > least_over_wall ? 1 - fat / sampling.fat : 1;
          row->add(wall, weight * (outer_edge.value - inner_edge.value - by_share * share_by_wall));
        }
      }
      sum += weight * (outside * (1 - outer_edge.value) + fat * (outer_edge.value - fat_edge.value) +
                       a_[wall] * (outer_edge.value - inner_edge.value) + fluid * inner_edge.value);
      of_fluid += inner_edge.value;
    }

    if (sample.near_lens) {
      EyeSurface lens_front, lens_back, equator;
      lens_surfaces(a_, p, lens_front, lens_back, equator);
      const Edge f = edge(lens_front, stack), b = edge(lens_back, stack), e = edge(equator, stack);
      const double share = f.value * b.value * e.value;
      const double contrast = a_[lens] - fluid;
      sum += weight * contrast * share;
      of_fluid -= share;
      if (front) {
        EyeSurface top, bottom, pupil;
        iris_surfaces(a_, p, top, bottom, pupil);
        // The iris ends where its back or the lens begins, whichever comes first: a difference of nested
        // regions, so that a gap between iris and lens thinner than the blur is right.
        const double lens_depth = lens_front.f / lens_front.gradient.norm(),
                     bottom_depth = bottom.f / bottom.gradient.norm();
        const bool lens_cuts = lens_depth > bottom_depth;
        const EyeSurface& end = lens_cuts ? lens_front : bottom;
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
      const Vector3d in_first = axes.turn * in_lps + axes.place, arm = in_first - a_.segment<3>(apex_x);
      row->add(gaze_horizontal, gradient.dot(by_horizontal_ * arm));
      row->add(gaze_vertical, gradient.dot(by_vertical_ * arm));
      by_position += gradient;
      // A further small turn moves the turned point across to its arm about the reference.
      by_turn += (in_first - a_.segment<3>(at_stack + shift_first) - model_.coil_reference_)
                     .cross(eye_from_lps_.transpose() * gradient);
    }
  }

  sum += sample.curved;
  const double coil_factor = coil(sample);
  if (row) {
    const std::array<double, coil_count> terms = coil_terms(sample.position);
    const Vector3d in_lps = eye_from_lps_.transpose() * by_position;
    for (int i = 0; i < 3; ++i) {
      row->add(apex_x + i, -in_lps[i]);
      row->add(at_stack + shift_first + i, in_lps[i]);
      row->add(at_stack + turn_first + i, degree * by_turn[i]);
    }
    row->add(at_stack + fat_shift_first, by_fat_shift.dot(axes.row));
    row->add(at_stack + fat_shift_first + 1, by_fat_shift.dot(axes.column));
    for (std::size_t k = 0; k < sample.bumps.size() && sample.near_wall; ++k) {
      row->add(layout.displacement() + sample.bumps[k], by_u * wall_at.bump[k]);
      row->add(layout.background() + sample.bumps[k], by_background * wall_at.bump[k]);
    }
    row->add(at_stack + log_sharpness, by_sharpness);
    for (int i = 0; i < coil_count; ++i) row->add(at_stack + coil_first + i, sum * terms[i]);
    row->add(at_stack + log_gain, sum);
    row->scale(coil_factor);
  }
  return sum * coil_factor;
}

}  // namespace emmetrope::segmentation
