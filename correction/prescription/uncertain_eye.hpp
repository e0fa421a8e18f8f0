#pragma once
#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/base/json.hpp"
#include "pipeline/eye/model/eye_model.hpp"
#include "pipeline/eye/instruments/instruments.hpp"
#include "pipeline/eye/uncertainty/normal_distribution.hpp"

namespace emmetrope::correction {

/// A measured eye as formulas, with numbers that are uncertain: meshing/<eye>/optics.json.
struct UncertainEye {
  EyeModel eye;                         ///< at the mean
  std::vector<std::string> parameters;  ///< names as in docs/stage-files.md, lens_index among them
  NormalDistribution numbers;
  std::vector<std::string> sources;      ///< "mri", "prior", "keratometry", ...
  std::optional<Topography> topography;  ///< departure of the cornea from the parameters' toric conicoid

  /// What was learnt since the images, in order.
  struct Step {
    std::string source;
    Eigen::MatrixXd covariance_before;
  };
  std::vector<Step> learnt;

  /// Place of a parameter. \throw Error (input_invalid) when it is not there
  Eigen::Index index_of(const std::string& parameter) const;
};

/// \param folder              what relative paths in the eye are relative to
/// \param lens_index_sigma    prior of the lens index where optics.json has none; 0: known
/// \throw Error (input_invalid) naming the key: sizes that do not fit, a covariance that is none, or an eye
/// that is not the
///        one that its parameters describe (paraxial refraction differs by more than 0.05 D)
UncertainEye uncertain_eye_from_json(const Json& optics, const std::filesystem::path& folder,
                                     double lens_index_sigma);

/// The eye with other values of its parameters: cornea and lens as the parameters say, the retina's shape as
/// it is.
EyeModel eye_at(const UncertainEye& uncertain, const Eigen::VectorXd& values);

/// The same as the fitted eye whose own length ends at the photoreceptors.
ParametricEye parametric_eye_at(const UncertainEye& uncertain, const Eigen::VectorXd& values);

/// Updates the eye with the knowledge that `function` of its parameters was measured.
/// \return the measurement's distance from what was expected, in standard deviations
double learn(UncertainEye& uncertain, const std::string& source, const VectorFunction& function,
             const Eigen::VectorXd& measured, const Eigen::MatrixXd& noise_covariance);

/// The same with all that other instruments found. \return a warning for each that hardly fits the images
std::vector<std::string> learn(UncertainEye& uncertain, const InstrumentReadings& readings);

/// Where a number comes from whose derivatives by the parameters are `row`: the images, or the last that took
/// away more than half of the variance there was.
std::string source_of(const UncertainEye& uncertain, const Eigen::RowVectorXd& row);

}  // namespace emmetrope::correction
