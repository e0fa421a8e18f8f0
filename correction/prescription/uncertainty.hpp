#pragma once
#include <Eigen/Core>
#include <array>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/base/measured.hpp"
#include "pipeline/base/power_vector.hpp"
#include "pipeline/eye/measured/uncertain_optics.hpp"

namespace emmetrope::correction {

/// A refraction of an eye by some criterion.
using RefractionOf = std::function<PowerVector(const EyeModel& eye)>;

/// d(M, J0, J45) / d parameter, 3 rows, one column a parameter: central differences over half a standard
/// deviation, or over a small step for a parameter that is known exactly.
Eigen::MatrixXd refraction_sensitivity(const UncertainOptics& optics, const RefractionOf& refraction);

/// One line of an uncertainty budget: the standard deviations that a source alone brings.
struct BudgetLine {
  std::string source;
  double M_D = 0, J0_D = 0, J45_D = 0;
};
/// Lines for axial length, anterior cornea, posterior cornea, chamber depth, lens shape, lens tilt and
/// decentre, and lens index; then "correlations" (signed: its square is added or taken away) and "total". The
/// squares of all lines but the last sum to the last's.
std::vector<BudgetLine> uncertainty_budget(const UncertainOptics& optics, const Eigen::MatrixXd& sensitivity);

/// Something that could still be measured: a linear functional of the parameters with its accuracy.
struct PlannedObservation {
  std::string name;
  Eigen::MatrixXd sensitivity;  ///< rows: the measured numbers; columns: the eye's parameters
  Eigen::MatrixXd noise_covariance;
};
/// What a keratometer (mean power and both components of corneal astigmatism) or a biometer would add.
PlannedObservation keratometry(const UncertainOptics& optics, double sigma_D);
PlannedObservation optical_axial_length(const UncertainOptics& optics, double sigma_mm);
PlannedObservation known_refraction(const Eigen::MatrixXd& refraction_sensitivity, double sigma_D);

/// Covariance of the parameters after the measurement (Kalman).
Eigen::MatrixXd covariance_after(const Eigen::MatrixXd& covariance, const PlannedObservation& measurement);

/// Where a number comes from of which a given refraction has taken a part of the variance: its own source where that is
/// below a tenth, as an image's share that is not told; both between, "mri+refraction"; above half it is "refraction"
/// already (UncertainEye::origin_of).
Origin with_refraction(Origin origin, double variance_before, double variance_after);

/// 95 % intervals of a refraction in every notation.
struct RefractionIntervals {
  Measured M_D, J0_D, J45_D, sphere_D, cylinder_D, axis_deg;
};
/// Power-vector intervals are normal; sphere, cylinder and axis by linear propagation, as a cornea's
/// (astigmatism_of). A cylinder's interval ends at 0; where it does, its axis has the interval value -+ 90.
/// It is unwrapped about its value, so that it may pass 0 or 180.
///
/// \param origins  of M, J0 and J45; the notation takes sphere's from M, cylinder's and axis' from the larger
///   component of J
RefractionIntervals refraction_intervals(const PowerVector& refraction, const Eigen::Matrix3d& covariance,
                                         const std::array<Origin, 3>& origins);

}  // namespace emmetrope::correction
