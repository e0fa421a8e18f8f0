#pragma once
#include <Eigen/Core>
#include <string>
#include <vector>

#include "pipeline/eye/uncertainty/uncertain_eye.hpp"

namespace emmetrope::follow {

/// One eye at one visit.
struct EyeAtVisit {
  UncertainEye eye;
  double years = 0;  ///< since the first visit
};

/// How the parameters of an eye change, known jointly up to a normal distribution.
struct Growth {
  std::vector<std::string> parameters;
  NormalDistribution per_year;
  /// By how much each later visit's fit differs from the first's, with the covariance that the errors of both and the
  /// change of an eye give such a difference.
  std::vector<NormalDistribution> differences;
  /// The eye about which it is a linear change: the mean of the visits.
  ParametricEye eye;
};

/// What the visits say together of an eye that changes evenly: the change from the first visit is measured with the errors
/// of both fits, and is known beforehand to lie within the spread of change_sigma: what an eye does not change (cornea,
/// the lens's place) is one for all visits. Errors that all fits still share make it wider than need be.
/// \param visits  at least two, the first at 0 years
/// \param scale_sigma  relative standard deviation of the scanner's scale from visit to visit
/// \throw Error (input_invalid) where the fits have too few parameters in common
Growth growth_of(const std::vector<EyeAtVisit>& visits, double scale_sigma);

/// Standard deviation of what a parameter may change in a year: beforehand, as wide as leaves the globe's growth to the
/// images.
double change_sigma(const std::string& parameter);
/// The same of eyes that are followed: by more than a few of them two visits are of two eyes, or one is misread.
double plausible_change_sigma(const std::string& parameter);

}  // namespace emmetrope::follow
