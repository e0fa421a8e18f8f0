#pragma once
#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/base/json.hpp"
#include "pipeline/eye/instruments/instruments.hpp"
#include "pipeline/eye/model/eye_model.hpp"
#include "pipeline/eye/uncertainty/uncertain_eye.hpp"

namespace emmetrope {

/// A measured eye as an optical system, with numbers that are uncertain: meshing/<eye>/optics.json.
struct UncertainOptics {
  EyeModel model;      ///< at the mean
  UncertainEye known;  ///< lens_index among its parameters; its axial length ends at the photoreceptors
  std::optional<Topography> topography;  ///< departure of the cornea from the parameters' toric conicoid
};

/// \param folder  what relative paths in the eye are relative to
/// \param lens_index_sigma  prior of the lens index where optics.json has none; 0: known
/// \throw Error (input_invalid) naming the key: sizes that do not fit, a covariance that is none, or an eye
///   that is not the one that its parameters describe (paraxial refraction differs by more than 0.05 D)
UncertainOptics uncertain_optics_from_json(const Json& optics, const std::filesystem::path& folder,
                                           double lens_index_sigma);

/// The same, the lens index known to be another, apart from all else.
UncertainOptics with_lens_index(const UncertainOptics& optics, double index, double sigma);

/// optics.json of an eye that was traced: the lens index that it was traced with is the one to be uncertain about.
UncertainOptics read_uncertain_optics(const std::filesystem::path& file, double lens_index_sigma,
                                      const EyeModel& traced);

/// The eye with other values of its parameters: cornea and lens as the parameters say, the retina's shape as
/// it is.
EyeModel eye_at(const UncertainOptics& optics, const Eigen::VectorXd& values);

/// Learns that `function` of the parameters was measured, and all that other instruments found; as
/// UncertainEye does.
double learn(UncertainOptics& optics, const std::string& source, const VectorFunction& function,
             const Eigen::VectorXd& measured, const Eigen::MatrixXd& noise_covariance);
std::vector<std::string> learn(UncertainOptics& optics, const InstrumentReadings& readings);

}  // namespace emmetrope
