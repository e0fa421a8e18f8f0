#pragma once
#include <Eigen/Core>
#include <functional>
#include <string>
#include <vector>

#include "pipeline/base/measured.hpp"
#include "pipeline/eye/parametric/parametric_eye.hpp"
#include "pipeline/eye/uncertainty/normal_distribution.hpp"

namespace emmetrope {

/// Numbers that follow from an eye.
using Functional = std::function<Eigen::VectorXd(const ParametricEye&)>;

/// Numbers with their covariance and, for each, where it comes from.
struct Propagated {
  Eigen::VectorXd value;
  Eigen::MatrixXd covariance;
  std::vector<std::string> source;

  double sigma(Eigen::Index i) const;
};

/// Root of the sum of squares of numbers that are known jointly: median, 2.5 % and 97.5 % quantile of 4000
/// draws, since where it is uncertain the root's value at the mean is too low and its slope tells too little.
Measured root_sum_square(const Propagated& terms);

/// What another instrument measured.
struct ExternalMeasurement {
  std::string source;  ///< "keratometry", "biometry", "topography"
  Functional of_eye;   ///< what it would measure on an eye
  Eigen::VectorXd value;
  Eigen::MatrixXd covariance;
};

/// A fitted eye whose parameters are known with a joint normal distribution, and what has been learnt since
/// the fit.
class EyeEstimate {
 public:
  /// Parameters that the fit left out of its covariance enter with a population prior (population_priors()).
  ///
  /// \throw Error (input_invalid) when the covariance has not what MRI must have measured, or is no
  /// covariance
  explicit EyeEstimate(ParametricEye fitted);

  const ParametricEye& eye() const { return eye_; }

  /// The scanner's scale is known to a relative standard deviation only: every length is stretched by it and
  /// every curvature shrunk, all together. Position in the scanner is left alone. To be called before other
  /// instruments' data.
  void add_scale_prior(double relative_sd);

  /// Linear propagation: value at the estimate, covariance J P J' with J by central differences over 0.2
  /// sigma. The source of a number is that of the parameters with the largest share in its variance, or the
  /// last instrument that took away more than half of the variance there was.
  Propagated propagate(const Functional& functional) const;

  /// Updates all parameters with a measurement, as `condition` does.
  ///
  /// \return how far it was from what was expected, in standard deviations; above 3 the two hardly fit
  /// together. Parameters of which a prior alone tells count as twice as uncertain here: it is no image that
  /// contradicts the measurement then, and few tails are as short as a normal distribution's.
  double assimilate(const ExternalMeasurement& measurement);

 private:
  NormalDistribution parameters() const;
  double surprise(const ExternalMeasurement& measurement) const;
  VectorFunction of_parameters(const Functional& functional) const;

  struct Step {
    std::string source;
    Eigen::MatrixXd covariance_before;
  };
  ParametricEye eye_;
  std::vector<Step> steps_;
};

/// A parameter's spread in the population, for what an image did not show.
struct PopulationPrior {
  const char* parameter;
  double sigma;
  const char* reference;
};
const std::vector<PopulationPrior>& population_priors();

}  // namespace emmetrope
