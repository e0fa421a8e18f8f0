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

struct RoundedMaximum {
  double value;
  Vector3d share;  ///< d log value / d log of each
};

/// The largest of three numbers that are not negative, 12 % more where two are alike, 20 % where all are. Towards a corner of the
/// scanner's box in k-space a plane edge would be sharpest; a curved one has directions on both sides
/// of the corner and is blurred by their mean.
RoundedMaximum rounded_maximum(const Vector3d& numbers) {
  const Vector3d sixth = numbers.array().square().cube();
  const double sum = sixth.sum();
  return {std::sqrt(std::cbrt(sum)), sixth / sum};
}

/// Columns x, y, z of the eye in LPS for a gaze (rad), and the derivatives by each of its angles.
Matrix3d eye_axes(double h, double v) {
  const double sh = std::sin(h), ch = std::cos(h), sv = std::sin(v), cv = std::cos(v);
  Matrix3d r;
  r.col(0) = Vector3d(ch, sh, 0);
  r.col(1) = Vector3d(-sh * sv, ch * sv, cv);
  r.col(2) = Vector3d(sh * cv, -ch * cv, sv);
  return r;
}
Matrix3d d_eye_axes_d_horizontal(double h, double v) {
  const double sh = std::sin(h), ch = std::cos(h), sv = std::sin(v), cv = std::cos(v);
  Matrix3d r;
  r.col(0) = Vector3d(-sh, ch, 0);
  r.col(1) = Vector3d(-ch * sv, -sh * sv, 0);
  r.col(2) = Vector3d(ch * cv, sh * cv, 0);
  return r;
}
Matrix3d d_eye_axes_d_vertical(double h, double v) {
  const double sh = std::sin(h), ch = std::cos(h), sv = std::sin(v), cv = std::cos(v);
  Matrix3d r;
  r.col(0) = Vector3d::Zero();
  r.col(1) = Vector3d(-sh * cv, ch * cv, -sv);
  r.col(2) = Vector3d(-sh * sv, ch * sv, cv);
  return r;
}

}  // namespace

double fat_signal(double around, double muscle, double fat) {
  return fat * (around - muscle) / std::max(fat - muscle, least_fat_over_muscle);
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

ForwardModel ForwardModel::along(const Matrix3d& head_axes) const {
  ForwardModel model = *this;
  model.head_axes_ = head_axes;
  return model;
}

Vector3d ForwardModel::axis(const VectorXd& parameters) const {
  return head_axes_ * gaze_axis(parameters[gaze_horizontal], parameters[gaze_vertical]);
}

Vector2d ForwardModel::gaze_deg(const Vector3d& axis_in_lps) const {
  return emmetrope::gaze_deg(head_axes_.transpose() * axis_in_lps);
}

Vector3d ForwardModel::horizontal(const VectorXd& parameters) const {
  return head_axes_ *
         eye_axes(parameters[gaze_horizontal] * degree, parameters[gaze_vertical] * degree).col(0);
}

ForwardModel::AtParameters::AtParameters(const ForwardModel& model, const VectorXd& parameters)
    : model_(model), a_(parameters) {
  const double h = a_[gaze_horizontal] * degree, v = a_[gaze_vertical] * degree;
  const Matrix3d head_from_lps = model.head_axes_.transpose();
  eye_from_lps_ = eye_axes(h, v).transpose() * head_from_lps;
  d_eye_from_lps_d_horizontal_ = d_eye_axes_d_horizontal(h, v).transpose() * head_from_lps * degree;
  d_eye_from_lps_d_vertical_ = d_eye_axes_d_vertical(h, v).transpose() * head_from_lps * degree;
  for (std::size_t s = 0; s < model.stacks_.size(); ++s) {
    const StackSampling& stack = model.stacks_[s];
    const int at = model.layout_.stack(static_cast<int>(s));
    const double of_filter = log_cutoff_per_filter * a_[at + k_space_filter],
                 log_reach = a_[at + log_sharpness] + of_filter,
                 log_along_row = log_reach + a_[at + log_sharpness_ratio] / 2,
                 log_along_column = log_reach - a_[at + log_sharpness_ratio] / 2,
                 log_through = a_[at + log_sharpness_through] + of_filter;
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
    axes.inverse_kx = std::exp(-log_along_row) / stack.row_cutoff_per_mm;
    axes.inverse_ky = std::exp(-log_along_column) / stack.column_cutoff_per_mm;
    axes.inverse_kz = stack.slice_cutoff_per_mm > 0 ? std::exp(-log_through) / stack.slice_cutoff_per_mm : 0;
    axes.filter = a_[at + k_space_filter];
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
    field.d_depth[i] = 1e-3 * form.value[i];
    field.depth += a_[field.first + i] * field.d_depth[i];
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
  Vector3d d_n = Vector3d::Zero();
  for (std::size_t k = 0; k < bumps.size(); ++k) {
    const int i = bumps[k];
    const Bump bump = bump_at(n.dot(model_.bumps_[i]));
    wall_at.bump[k] = bump.value;
    const double height = a_[layout.displacement() + i];
    wall_at.displacement += height * bump.value;
    wall_at.background += a_[layout.background() + i] * bump.value;
    d_n += height * bump.d_cosine * model_.bumps_[i];
  }
  const Vector3d d_q = (d_n - d_n.dot(n) * n) / rho;
  wall_at.gradient = d_q.cwiseQuotient(r);
  return wall_at;
}

ForwardModel::AtParameters::Edge ForwardModel::AtParameters::edge(const EyeSurface& surface,
                                                                  int stack) const {
  const StackInEye& axes = stack_in_eye_[stack];
  const StackSampling& sampling = model_.stacks_[stack];
  const bool is_encoded = axes.inverse_kz > 0;
  const double a = std::abs(surface.gradient.dot(axes.row)), b = std::abs(surface.gradient.dot(axes.column)),
               c = std::abs(surface.gradient.dot(axes.normal));
  const double exact = std::sqrt(a * a + b * b + (is_encoded ? c * c : 0));
  // Where a surface is parallel to the slice the slice alone blurs it; the floor keeps the ratio finite.
  const double slope = std::max(exact, is_encoded ? 0 : 0.01 * c) + 1e-12;
  RoundedMaximum blur{std::max(axes.inverse_kx, axes.inverse_ky), {0.5, 0.5, 0}};
  Vector3d of_axes_squared = blur.share;  // (k_c n_i / k_i)^2; their sum is 1 where one axis filters
  if (exact > 1e-9) {
    const Vector3d by_axis(a * axes.inverse_kx, b * axes.inverse_ky, c * axes.inverse_kz);
    blur = rounded_maximum(by_axis);
    of_axes_squared = (by_axis / blur.value).cwiseAbs2();
    blur.value /= exact;
  }
  const double askew_squared = std::max(0.0, of_axes_squared.sum() - 1);
  const double per_f = 2 / (blur.value * slope);
  const double half = is_encoded ? 0 : sampling.thickness_mm / sampling.subslices / 2;
  // Within a sub-slice a curved surface lies on the average this far (in F) inside its tangent plane.
  const double bend = half * half / 6 * axes.normal.dot(surface.hessian * axes.normal);
  const EdgeValue e = averaged_edge(per_f * (surface.f + bend), per_f * half * c, axes.filter, askew_squared);
  const Vector3d d_log_k = blur.share * e.scale_derivative +
                           2 * e.askew_derivative * (blur.share * (1 + askew_squared) - of_axes_squared);
  return {e.value,
          e.derivative * per_f,
          d_log_k[0] + d_log_k[1],
          (d_log_k[0] - d_log_k[1]) / 2,
          d_log_k[2],
          e.filter_derivative + log_cutoff_per_filter * e.scale_derivative};
}

std::array<double, coil_count> ForwardModel::AtParameters::coil_terms(const Sample& sample) const {
  const StackSampling& stack = model_.stacks_[sample.stack];
  const Vector3d from_middle = (sample.position - model_.coil_reference_) / coil_length_mm;
  const Vector3d x(stack.along_row.dot(from_middle), stack.along_column.dot(from_middle),
                   stack.normal.dot(from_middle));
  return {x.x(),         x.y(),         x.z(),         x.x() * x.x(), x.y() * x.y(),
          x.z() * x.z(), x.x() * x.y(), x.y() * x.z(), x.z() * x.x()};
}

double ForwardModel::AtParameters::coil(const Sample& sample) const {
  const int at = model_.layout_.stack(sample.stack);
  const std::array<double, coil_count> terms = coil_terms(sample);
  double log_coil = a_[at + log_gain];
  for (int i = 0; i < coil_count; ++i) log_coil += a_[at + coil_first + i] * terms[i];
  return std::exp(log_coil);
}

}  // namespace emmetrope::segmentation
