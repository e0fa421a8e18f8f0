#pragma once
#include <Eigen/Core>
#include <array>
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
  std::vector<Origin> origin;
  Eigen::VectorXd prior_sigma = {};  ///< before any image was seen; infinite where nothing was known

  double sigma(Eigen::Index i) const;
  /// 4000 draws of the numbers, one a column, the same ones every time: for what follows from them by no straight
  /// line (JCGM 101:2008).
  Eigen::MatrixXd draws() const;
};

/// 2.5 % and 97.5 % quantile.
std::array<double, 2> ci95_of(std::vector<double> draws);

/// Root of the sum of squares of numbers that are known jointly: median, 2.5 % and 97.5 % quantile of 4000
/// draws, since where it is uncertain the root's value at the mean is too low and its slope tells too little.
Measured root_sum_square(const Propagated& terms);

/// What another instrument measured.
struct ExternalMeasurement {
  std::string source;  ///< "keratometry", "biometry", "topography"
  Functional of_eye;   ///< what it would measure on an eye
  Eigen::VectorXd value;
  Eigen::MatrixXd covariance;
  std::string quantity = source;  ///< "keratometry", "axial_length", "anterior_chamber_depth", ...
};

/// An eye whose parameters (ParametricEye::parameter_names) are known with a joint normal distribution, and
/// what has been learnt of it since.
class UncertainEye {
 public:
  /// \throw Error (input_invalid) for a covariance that is none, or a parameter that no eye has
  explicit UncertainEye(ParametricEye eye);

  /// The eye at the mean, with its covariance.
  const ParametricEye& eye() const { return eye_; }
  NormalDistribution parameters() const;
  /// Place of a parameter.
  /// \throw Error (input_invalid) when it is not there
  Eigen::Index index_of(const std::string& parameter) const;
  double sigma(const std::string& parameter) const;

  /// The eye with other values of its parameters.
  ParametricEye at(const Eigen::VectorXd& values) const;

  /// The scanner's scale is known to a relative standard deviation only: every length is stretched by it and
  /// every curvature shrunk, all together. Position in the scanner is left alone. To be called before other
  /// instruments' data.
  void add_scale_prior(double relative_sd);

  /// Linear propagation: value at the mean, covariance J P J' with J by central differences over 0.2 sigma.
  Propagated propagate(const Functional& functional) const;

  /// Where a number comes from whose derivatives by the parameters are `row`: images or priors by how much the
  /// images narrowed it; where an instrument told of it too, the parameters with the largest part of its variance,
  /// or the last measurement that took away more than half of the variance there was.
  Origin origin_of(const Eigen::RowVectorXd& row) const;

  /// Learns that `function` of the parameters was measured, as `condition` does.
  ///
  /// \return how far it was from what was expected, in standard deviations. Parameters of which a prior alone
  ///   tells count as tail_of() times as uncertain here: it is no image that contradicts the measurement
  ///   then, and few tails are as short as a normal distribution's.
  double learn(const std::string& source, const VectorFunction& function, const Eigen::VectorXd& measured,
               const Eigen::MatrixXd& noise_covariance);
  double learn(const ExternalMeasurement& measurement);
  /// Sources of what has been learnt, in order.
  std::vector<std::string> learnt_from() const;

 private:
  const std::string& source(Eigen::Index parameter) const;
  const Eigen::MatrixXd& covariance_by_images() const;
  double prior_sigma_of(const Eigen::RowVectorXd& row) const;
  VectorFunction of_parameters(const Functional& functional) const;

  struct Step {
    std::string source;
    Eigen::MatrixXd covariance_before;
  };
  ParametricEye eye_;
  std::vector<Step> steps_;
};

/// The eye that images were fitted with. Parameters that the fit left out of its covariance enter with the
/// population's spread (population_values()).
/// \throw Error (input_invalid) when the covariance has not what MRI must have measured, or is no covariance
UncertainEye fitted_eye(ParametricEye fitted);

/// A reading further than this from what was expected hardly fits the eye: it is learnt, with a warning.
inline constexpr double doubtful_innovation_sigma = 3;
/// Beyond this both cannot be of one eye, and no mean of them would be near either: it is refused, wherever
/// it is given.
inline constexpr double irreconcilable_innovation_sigma = 5;

/// A reading that may contradict what is known.
struct Surprise {
  std::string reading;          ///< such as "keratometry"
  double innovation_sigma = 0;  ///< how far the reading lies from what else is known
  std::string values = "";      ///< what is put behind it: its value and that of the others, with units
  /// True: of the images alone; else other readings are among what it is compared with.
  bool is_of_images = true;
};

/// "the images", or with what was read before.
std::string others_of(bool is_of_images);

/// The one rule for a reading that contradicts what is known.
/// \return a warning, or an empty text
/// \throw Error (input_invalid) beyond irreconcilable_innovation_sigma
std::string judge_innovation(const Surprise& surprise);

}  // namespace emmetrope
