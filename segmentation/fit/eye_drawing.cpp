#include "segmentation/fit/eye_drawing.hpp"

#include <algorithm>
#include <cmath>

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;

/// This far from the wall its background is drawn, fading over the farther half.
constexpr double background_reach_mm = 6;

double distance(const EyeSurface& s) { return s.f / s.gradient.norm(); }

}  // namespace

double smooth_step(double x, double from, double to) {
  const double t = std::clamp((x - from) / (to - from), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

EyeDrawing::EyeDrawing(const ForwardModel& model, const ForwardModel::AtParameters& at,
                       const Eigen::VectorXd& parameters, int stack, const Eigen::Matrix3d& cell,
                       double voxel_reach_mm)
    : at_(at), a_(parameters), cell_(cell), reach_(voxel_reach_mm) {
  const StackSampling& sampling = model.stacks()[static_cast<std::size_t>(stack)];
  fat_ = sampling.fat;
  muscle_ = a_[wall] - sampling.muscle_under_wall * a_[wall_layering];
  const int shift = model.layout().stack(stack) + fat_shift_first;
  fat_shift_ = at.to_eye(a_[shift] * sampling.along_row + a_[shift + 1] * sampling.along_column, stack) -
               at.to_eye(Vector3d::Zero(), stack);
  if (model.layout().bumps > 0) bumps_ = bump_directions();
}

bool EyeDrawing::enter(const Vector3d& middle) {
  middle_ = middle;
  fields_ = {};
  const double inside = distance(globe_surface(a_, middle, WallSide::inner, nullptr));
  if (std::abs(inside) < background_reach_mm) {
    const Vector3d semi_axes(a_[globe_x], a_[globe_y], a_[globe_z]);
    const Vector3d direction =
        (middle + Vector3d(0, 0, a_[axial_length] - a_[globe_z])).cwiseQuotient(semi_axes).normalized();
    near_.clear();
    for (std::size_t i = 0; i < bumps_.size(); ++i)
      if (bumps_[i].dot(direction) > std::cos(3.2 * bump_width_rad))
        near_.push_back(static_cast<std::uint8_t>(i));
    fields_ = at_.wall_fields(near_, middle);
    fields_.background *= 1 - smooth_step(-inside, background_reach_mm / 2, background_reach_mm);
  }
  for (int s = 0; s < lens_front; ++s) distance_[s] = distance(surface(static_cast<Surface>(s), middle));
  EyeSurface front, back, equator;
  lens_surfaces(a_, middle, front, back, equator);
  distance_[lens_front] = distance(front);
  distance_[lens_back] = distance(back);
  distance_[lens_equator] = distance(equator);
  distance_[nucleus] = distance(nucleus_surface(a_, middle));
  return std::any_of(distance_.begin(), distance_.end(), [&](double d) { return std::abs(d) < reach_; });
}

double EyeDrawing::operator()(const Vector3d& p) const {
  const double depth = -p.z(), off_axis = p.head<2>().norm();
  const double rear = std::max(smooth_step(off_axis, 5, 7), smooth_step(depth, 4, 6));
  const double eye = joined(rear, cornea_front, wall_outside, p),
               inside = joined(rear, cornea_back, wall_inside, p);
  // Lid and air before the eye give way to what surrounds the globe.
  const double behind_face = smooth_step(depth, 3, 9);
  double value = 0;
  if (behind_face < 1)
    value += (1 - behind_face) * (a_[air] + (a_[lid] - a_[air]) * coverage(lid_front, p)) * (1 - eye);
  if (behind_face > 0) {
    const double around = a_[surround] + fields_.background, fat = fat_signal(around, muscle_, fat_);
    const double without_fat = fat_shift_.isZero() ? eye : coverage(fat_begins, p);
    value += behind_face * ((around - fat) * (1 - eye) + fat * (1 - without_fat));
  }
  value += (a_[cornea] + (a_[wall] - a_[cornea]) * rear) * (eye - inside);
  if (rear > 0) {
    const double share = a_[wall_inner_share];
    value += rear * a_[wall_layering] *
             (coverage(wall_between, p) - (1 - share) * coverage(wall_inside, p) -
              share * coverage(wall_outside, p));
  }
  const double mid_lens = a_[anterior_chamber_depth] + a_[lens_thickness] / 2;
  const double fluid =
      a_[aqueous] + (a_[vitreous] - a_[aqueous]) * smooth_step(depth, mid_lens - 1, mid_lens + 1);
  value += fluid * inside;
  return value + (a_[lens] - fluid) * in_lens(p) + a_[lens_nucleus] * coverage(nucleus, p);
}

EyeSurface EyeDrawing::surface(Surface which, const Vector3d& p) const {
  WallFields fields = fields_;
  fields.displacement += fields.gradient.dot(p - middle_);
  switch (which) {
    case lid_front:
      return lid_surface(a_, p);
    case cornea_front:
      return at_.cornea_at(p, false);
    case cornea_back:
      return at_.cornea_at(p, true);
    case wall_outside:
      return globe_surface(a_, p, WallSide::outer, &fields);
    case wall_inside:
      return globe_surface(a_, p, WallSide::inner, &fields);
    case wall_between:
      return globe_surface(a_, p, WallSide::between, &fields);
    case fat_begins:
      return globe_surface(a_, p - fat_shift_, WallSide::outer, &fields);
    case nucleus:
    default:
      return nucleus_surface(a_, p);
  }
}

/// Share of the cell that lies inside a surface, by its form about the cell's middle.
double EyeDrawing::share_inside(const EyeSurface& s) const {
  // Of a ramp with the variance of the cell's points across the surface.
  const double width = (cell_.transpose() * s.gradient).norm();
  return std::clamp(0.5 + s.f / width, 0.0, 1.0);
}

/// Share of the cell about p that lies inside a surface.
double EyeDrawing::coverage(Surface which, const Vector3d& p) const {
  if (std::abs(distance_[which]) > reach_) return distance_[which] > 0 ? 1 : 0;
  return share_inside(surface(which, p));
}

double EyeDrawing::in_lens(const Vector3d& p) const {
  const double least = std::min({distance_[lens_front], distance_[lens_back], distance_[lens_equator]});
  if (least < -reach_) return 0;
  if (least > reach_) return 1;
  std::array<EyeSurface, 3> sides;
  lens_surfaces(a_, p, sides[0], sides[1], sides[2]);
  double share = 1;
  for (int i = 0; i < 3; ++i)
    if (distance_[lens_front + i] <= reach_) share *= share_inside(sides[i]);
  return share;
}

/// Inside of the cornea's surface before the limbus, of the globe's behind it.
double EyeDrawing::joined(double rear, Surface of_cornea, Surface of_globe, const Vector3d& p) const {
  const double front = rear < 1 ? coverage(of_cornea, p) : 0, back = rear > 0 ? coverage(of_globe, p) : 0;
  return (1 - rear) * front + rear * back;
}

}  // namespace emmetrope::segmentation
