#include "data_samples/phantom/coil.hpp"

#include <cmath>

namespace emmetrope::phantom {
namespace {

using Eigen::Vector3d;

constexpr double loop_radius_mm = 35;
constexpr double loop_in_front_mm = 12;  // of the corneal apex
constexpr double head_radius_mm = 95;
constexpr double head_rise = 0.25;  // from the head's centre to its surface

}  // namespace

Sensitivity::Sensitivity(const StackPlan& plan, const Anatomy& anatomy) : coil_(plan.coil) {
  const PlacedEye& eye = anatomy.eye(plan.coil_eye);
  const Vector3d between = anatomy.between_globes();
  if (coil_ == Coil::surface) centre_ = eye.lps_from_eye * Vector3d(0, 0, loop_in_front_mm);
  if (coil_ == Coil::head) centre_ = between + Vector3d(0, 85, 20);
  at_reference_ = raw(coil_ == Coil::surface ? eye.globe_centre_lps() : between);
}

double Sensitivity::raw(const Vector3d& p) const {
  if (coil_ == Coil::uniform) return 1;
  const double d2 = (p - centre_).squaredNorm();
  if (coil_ == Coil::head) return 1 + head_rise * d2 / (head_radius_mm * head_radius_mm);
  // The field on a loop's axis, taken all round: (1 + d^2 / R^2)^(-3/2).
  const double t = 1 + d2 / (loop_radius_mm * loop_radius_mm);
  return 1 / (t * std::sqrt(t));
}

}  // namespace emmetrope::phantom
