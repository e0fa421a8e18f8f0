#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "correction/prescription/uncertainty.hpp"
#include "pipeline/base/json.hpp"
#include "pipeline/eye/model/eye_model.hpp"
#include "pipeline/eye/parametric/parametric_eye.hpp"

/// The refraction that a patient would be told of a fitted eye, against that of the eye that was imaged.
namespace emmetrope::correction {

/// An eye whose truth is known.
struct PhantomEye {
  ParametricEye fitted;  ///< with its covariance
  EyeModel truth;
  Eigen::Vector3d corneal_power_D;  ///< true M, J0, J45, which a keratometer reads with its noise
  double scale_sd = 0;              ///< relative, of the scanner's lengths
  std::uint64_t seed = 1;           ///< of what is drawn for this eye
};
/// From a record of the fit's accuracy study (tests/studies/study_eye.hpp).
/// \pre its "status" is "measured"
///
/// \param bound  take the covariance that noise and priors alone would leave for the one that the fit states
PhantomEye phantom_eye_from_record(const Json& record, bool bound = false);

/// What is known beside the images.
struct Knowledge {
  bool keratometry = false;  ///< a reading with a standard deviation of 0.25 D in each meridian
  bool lens_index = true;    ///< else the truth's is drawn from N(1.4225, 0.005), which the fit has as prior
};

/// Fitted less true M, J0, J45 (D), iris 3 mm, 12 mm before the cornea.
struct RefractionError {
  Eigen::Vector3d spot;      ///< by the smallest root mean square spot
  Eigen::Vector3d paraxial;  ///< by the pupil's centre
  /// stated of the smallest spot's, as for patients: linear in the eye's numbers
  Eigen::Matrix3d covariance;
  std::vector<BudgetLine> budget;    ///< of that covariance
  std::vector<BudgetLine> if_known;  ///< its standard deviations if a part of the eye were known exactly

  bool covered(int component) const;  ///< by the 95 % interval
};
RefractionError refraction_error(const PhantomEye& eye, const Knowledge& knowledge);

}  // namespace emmetrope::correction
