// The forward model's intensity of one voxel, with its derivatives.
#include <algorithm>
#include <array>
#include <optional>

#include "pipeline/base/frames.hpp"
#include "segmentation/fit/eye_surfaces.hpp"
#include "segmentation/fit/forward_model.hpp"

namespace emmetrope::segmentation {

using Eigen::Vector3d;

/// A sample's signal without the coil, summed over its sub-slices. Derivatives by parameters of one surface
/// or tissue go into the Jacobian's row as they arise; those that surfaces and sub-slices share (pose, wall
/// fields, chemical shift, sharpness) are summed until the end.
class ForwardModel::AtParameters::SignalSum {
 public:
  /// \param row  null: no derivatives
  SignalSum(const AtParameters& eye, const Sample& sample, SparseRow* row)
      : eye_(eye),
        a_(eye.a_),
        sample_(sample),
        sampling_(eye.model_.stacks_[sample.stack]),
        axes_(eye.stack_in_eye_[sample.stack]),
        row_(row),
        is_front_(sample.zone == Zone::front),
        weight_(1.0 / sampling_.subslices),
        fluid_(a_[is_front_ ? aqueous : vitreous]) {
    if (sample.near_wall && !sample.bumps.empty())
      wall_ = eye.wall_fields(sample.bumps, eye.to_eye(sample.position, sample.stack));
  }

  void add_subslice(int k) {
    const double offset = ((k + 0.5) * weight_ - 0.5) * sampling_.thickness_mm;
    const Vector3d in_lps = sample_.position + offset * sampling_.normal;
    const Vector3d p = eye_.to_eye(in_lps, sample_.stack);
    d_point_.setZero();
    fluid_share_ = 0;
    if (is_front_)
      add_front_of_eye(p);
    else
      add_wall(p);
    if (sample_.near_lens) add_lens_and_iris(p);
    if (!row_) return;
    row_->add(is_front_ ? aqueous : vitreous, weight_ * fluid_share_);
    add_pose(in_lps);
  }

  /// What the planar edges do not have.
  void add_curved_edges() { signal_ += sample_.curved; }

  /// The signal times the coil's profile; the row becomes that of the product.
  double through_coil() const {
    const double coil_factor = eye_.coil(sample_);
    if (row_) {
      add_shared_derivatives();
      row_->scale(coil_factor);
    }
    return signal_ * coil_factor;
  }

 private:
  /// The derivatives of a surface whose edge enters the intensity with this coefficient.
  /// \return that by the surface's F
  double enter(const EyeSurface& surface, const Edge& edge, double coefficient) {
    d_log_sharpness_ += weight_ * coefficient * edge.d_log_sharpness;
    d_log_sharpness_ratio_ += weight_ * coefficient * edge.d_log_sharpness_ratio;
    d_log_sharpness_through_ += weight_ * coefficient * edge.d_log_sharpness_through;
    d_filter_ += weight_ * coefficient * edge.d_filter;
    const double d_f = weight_ * coefficient * edge.d_f;
    d_point_ += d_f * surface.gradient;
    for (int i = 0; i < surface.count; ++i) row_->add(surface.parameter[i], d_f * surface.derivative[i]);
    return d_f;
  }

  /// Air, lid, cornea and aqueous, nested.
  void add_front_of_eye(const Vector3d& p) {
    Edge lid_edge, front_edge, back_edge;
    if (sample_.near_cornea) {
      const std::optional<CorneaField> field = eye_.cornea_field(p);
      const CorneaField* form = field ? &*field : nullptr;
      const EyeSurface lid_front = lid_surface(a_, p), cornea_front = cornea_surface(a_, p, false, form),
                       cornea_back = cornea_surface(a_, p, true, form);
      lid_edge = edge(lid_front);
      front_edge = edge(cornea_front);
      back_edge = edge(cornea_back);
      if (row_) {
        enter(lid_front, lid_edge, a_[lid] - a_[air]);
        enter(cornea_front, front_edge, a_[cornea] - a_[lid]);
        enter(cornea_back, back_edge, fluid_ - a_[cornea]);
        row_->add(air, weight_ * (1 - lid_edge.value));
        row_->add(lid, weight_ * (lid_edge.value - front_edge.value));
        row_->add(cornea, weight_ * (front_edge.value - back_edge.value));
      }
    }
    signal_ +=
        weight_ * (a_[air] + (a_[lid] - a_[air]) * lid_edge.value +
                   (a_[cornea] - a_[lid]) * front_edge.value + (fluid_ - a_[cornea]) * back_edge.value);
    fluid_share_ += back_edge.value;
  }

  /// Surroundings with displaced fat, the wall's two layers and vitreous, nested.
  void add_wall(const Vector3d& p) {
    Edge outer_edge, between_edge, inner_edge, fat_edge;
    const double layering = a_[wall_layering], share = a_[wall_inner_share];
    const double outside = a_[surround] + wall_.background;
    const double muscle = a_[wall] - sampling_.muscle_under_wall * layering;
    const double fat = fat_signal(outside, muscle, sampling_.fat);
    if (sample_.near_wall) {
      const EyeSurface outer = globe_surface(a_, p, WallSide::outer, &wall_),
                       inner = globe_surface(a_, p, WallSide::inner, &wall_);
      outer_edge = fat_edge = edge(outer);
      inner_edge = edge(inner);
      const EyeSurface between = globe_surface(a_, p, WallSide::between, &wall_);
      between_edge = edge(between);
      EyeSurface fat_begins = outer;
      if (axes_.has_fat_shift) {
        fat_begins = globe_surface(a_, p - axes_.fat_shift, WallSide::outer, &wall_);
        fat_edge = edge(fat_begins);
      }
      if (row_) {
        const double d_f = enter(fat_begins, fat_edge, -fat);
        d_fat_shift_ -= d_f * fat_begins.gradient;
        d_displacement_ += d_f + enter(outer, outer_edge, a_[wall] - share * layering - outside + fat);
        d_displacement_ += enter(between, between_edge, layering);
        d_displacement_ += enter(inner, inner_edge, fluid_ - a_[wall] - (1 - share) * layering);
        row_->add(wall_inner_share, weight_ * layering * (inner_edge.value - outer_edge.value));
        const double over_muscle = sampling_.fat - muscle;
        const double d_share = (outer_edge.value - fat_edge.value) * sampling_.fat /
                               std::max(over_muscle, least_fat_over_muscle);
        const double d_outside = 1 - outer_edge.value + d_share;
        row_->add(surround, weight_ * d_outside);
        d_background_ += weight_ * d_outside;
        const double d_muscle =
            -d_share * (over_muscle > least_fat_over_muscle ? 1 - fat / sampling_.fat : 1);
        row_->add(wall, weight_ * (outer_edge.value - inner_edge.value + d_muscle));
        row_->add(wall_layering,
                  weight_ * (between_edge.value - (1 - share) * inner_edge.value - share * outer_edge.value -
                             sampling_.muscle_under_wall * d_muscle));
      }
    }
    signal_ += weight_ *
               (outside * (1 - outer_edge.value) + fat * (outer_edge.value - fat_edge.value) +
                a_[wall] * (outer_edge.value - inner_edge.value) + fluid_ * inner_edge.value +
                layering * (between_edge.value - (1 - share) * inner_edge.value - share * outer_edge.value));
    fluid_share_ += inner_edge.value;
  }

  /// The lens in its fluid, and in front the iris before it.
  void add_lens_and_iris(const Vector3d& p) {
    EyeSurface front, back, equator;
    lens_surfaces(a_, p, front, back, equator);
    const EyeSurface nucleus = nucleus_surface(a_, p);
    const Edge f = edge(front), b = edge(back), e = edge(equator), n = edge(nucleus);
    const double share = f.value * b.value * e.value;
    const double contrast = a_[lens] - fluid_;
    signal_ += weight_ * (contrast * share + a_[lens_nucleus] * n.value);
    fluid_share_ -= share;
    if (is_front_) add_iris(p, front, f);
    if (!row_) return;
    enter(front, f, contrast * b.value * e.value);
    enter(back, b, contrast * f.value * e.value);
    enter(equator, e, contrast * f.value * b.value);
    enter(nucleus, n, a_[lens_nucleus]);
    row_->add(lens, weight_ * share);
    row_->add(lens_nucleus, weight_ * n.value);
  }

  /// The iris ends where its back or the lens begins, whichever comes first: a difference of nested regions,
  /// so that a gap between iris and lens thinner than the blur is right.
  void add_iris(const Vector3d& p, const EyeSurface& lens_front, const Edge& lens_edge) {
    EyeSurface top, bottom, pupil;
    iris_surfaces(a_, p, top, bottom, pupil);
    const double lens_depth = lens_front.f / lens_front.gradient.norm(),
                 bottom_depth = bottom.f / bottom.gradient.norm();
    // Where there is iris: its blurred slab rings, and is negative beside it.
    if (!(top.f / top.gradient.norm() > std::max(lens_depth, bottom_depth))) return;
    const bool lens_cuts = lens_depth > bottom_depth;
    const EyeSurface& end = lens_cuts ? lens_front : bottom;
    const Edge top_edge = edge(top), end_edge = lens_cuts ? lens_edge : edge(bottom),
               pupil_edge = edge(pupil);
    const double slab = (top_edge.value - end_edge.value) * pupil_edge.value;
    const double contrast = a_[iris] - fluid_;
    signal_ += weight_ * contrast * slab;
    fluid_share_ -= slab;
    if (!row_) return;
    enter(top, top_edge, contrast * pupil_edge.value);
    enter(end, end_edge, -contrast * pupil_edge.value);
    enter(pupil, pupil_edge, contrast * (top_edge.value - end_edge.value));
    row_->add(iris, weight_ * slab);
  }

  /// Moves the sub-slice's derivative by its point on to gaze, place and the head's turn.
  void add_pose(const Vector3d& in_lps) {
    const Vector3d in_first = axes_.turn * in_lps + axes_.place, arm = in_first - a_.segment<3>(apex_x);
    row_->add(gaze_horizontal, d_point_.dot(eye_.d_eye_from_lps_d_horizontal_ * arm));
    row_->add(gaze_vertical, d_point_.dot(eye_.d_eye_from_lps_d_vertical_ * arm));
    d_position_ += d_point_;
    // A further small turn moves the turned point across to its arm about the reference.
    d_turn_ += (in_first - a_.segment<3>(at_stack() + shift_first) - eye_.model_.coil_reference_)
                   .cross(eye_.eye_from_lps_.transpose() * d_point_);
  }

  void add_shared_derivatives() const {
    const ParameterLayout& layout = eye_.model_.layout_;
    const Vector3d d_lps = eye_.eye_from_lps_.transpose() * d_position_;
    for (int i = 0; i < 3; ++i) {
      row_->add(apex_x + i, -d_lps[i]);
      row_->add(at_stack() + shift_first + i, d_lps[i]);
      row_->add(at_stack() + turn_first + i, degree * d_turn_[i]);
    }
    row_->add(at_stack() + fat_shift_first, d_fat_shift_.dot(axes_.row));
    row_->add(at_stack() + fat_shift_first + 1, d_fat_shift_.dot(axes_.column));
    for (std::size_t k = 0; k < sample_.bumps.size() && sample_.near_wall; ++k) {
      row_->add(layout.displacement() + sample_.bumps[k], d_displacement_ * wall_.bump[k]);
      row_->add(layout.background() + sample_.bumps[k], d_background_ * wall_.bump[k]);
    }
    row_->add(at_stack() + log_sharpness, d_log_sharpness_);
    row_->add(at_stack() + log_sharpness_ratio, d_log_sharpness_ratio_);
    row_->add(at_stack() + log_sharpness_through, d_log_sharpness_through_);
    row_->add(at_stack() + k_space_filter, d_filter_);
    const std::array<double, coil_count> terms = eye_.coil_terms(sample_);
    for (int i = 0; i < coil_count; ++i) row_->add(at_stack() + coil_first + i, signal_ * terms[i]);
    row_->add(at_stack() + log_gain, signal_);
  }

  Edge edge(const EyeSurface& surface) const { return eye_.edge(surface, sample_.stack); }
  int at_stack() const { return eye_.model_.layout_.stack(sample_.stack); }

  const AtParameters& eye_;
  const Eigen::VectorXd& a_;
  const Sample& sample_;
  const StackSampling& sampling_;
  const StackInEye& axes_;
  SparseRow* row_;
  bool is_front_;
  double weight_;  ///< of a sub-slice
  double fluid_;   ///< aqueous or vitreous
  WallFields wall_;

  double signal_ = 0;
  Vector3d d_position_ = Vector3d::Zero();   ///< by the voxel's point, in the eye frame
  Vector3d d_turn_ = Vector3d::Zero();       ///< in LPS, per rad
  Vector3d d_fat_shift_ = Vector3d::Zero();  ///< in the eye frame
  double d_log_sharpness_ = 0, d_log_sharpness_ratio_ = 0, d_log_sharpness_through_ = 0, d_filter_ = 0;
  double d_displacement_ = 0, d_background_ = 0;  ///< by the wall's fields

  // Of the sub-slice.
  Vector3d d_point_;
  double fluid_share_ = 0;
};

double ForwardModel::AtParameters::intensity(const Sample& sample, SparseRow* row) const {
  if (row) row->clear();
  SignalSum sum(*this, sample, row);
  for (int k = 0; k < model_.stacks_[sample.stack].subslices; ++k) sum.add_subslice(k);
  sum.add_curved_edges();
  return sum.through_coil();
}

}  // namespace emmetrope::segmentation
