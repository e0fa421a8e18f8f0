#pragma once
#include <Eigen/Core>

#include "data_samples/phantom/acquisition.hpp"

namespace emmetrope::phantom {

/// Sensitivity of a stack's receive coil at a point of the scanner (LPS, mm), 1 at the reference point of
/// `Coil`.
class Sensitivity {
 public:
  Sensitivity(const StackPlan& plan, const Anatomy& anatomy);
  double operator()(const Eigen::Vector3d& p) const { return raw(p) / at_reference_; }

 private:
  double raw(const Eigen::Vector3d& p) const;

  Coil coil_;
  Eigen::Vector3d centre_ = Eigen::Vector3d::Zero();
  double at_reference_ = 1;
};

}  // namespace emmetrope::phantom
