#pragma once
#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

#include "pipeline/base/json.hpp"
#include "raytrace/eye/eye_model.hpp"

namespace emmetrope::correction {

/// A measured eye as formulas, with numbers that are uncertain: meshing/<eye>/optics.json.
struct UncertainEye {
  EyeModel eye;  ///< at `values`
  std::vector<std::string>
      parameters;  ///< names as in docs/stage-files.md, and any of lens_anterior_q,
                   ///< lens_posterior_q, lens_decentre_x_mm, lens_decentre_y_mm; always lens_index
  Eigen::VectorXd values;
  Eigen::MatrixXd covariance;        ///< symmetric, positive semi-definite
  std::vector<std::string> sources;  ///< "mri", "prior", "keratometry", ...

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

/// The eye with other values of its parameters: cornea and lens as conics, the rest as it is.
EyeModel eye_at(const UncertainEye& uncertain, const Eigen::VectorXd& values);

}  // namespace emmetrope::correction
