#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "meshing/estimate.hpp"
#include "pipeline/base/laterality.hpp"

namespace emmetrope {

/// Measurements from other instruments as they are typed: "od:43.25@175/44.75@85+-0.25". What follows +- is
/// one standard deviation in the unit of the value.
struct InstrumentFlags {
  std::vector<std::string> keratometry, axial_length, anterior_chamber_depth, lens_thickness, topography;
};

/// A flag's eye and the rest.
struct EyeFlag {
  Laterality eye = Laterality::od;
  std::string value;  ///< between the colon and +-
  double sigma = 0;   ///< what was given, or the flag's default
};
/// \param flag           its name, for messages
/// \param default_sigma  where no +- is given
/// \throw Error (usage) saying what was expected
EyeFlag parse_eye_flag(const std::string& flag, const std::string& text, double default_sigma);

/// Two perpendicular meridians with their keratometric powers (index 1.3375).
///
/// \throw Error (usage)
ExternalMeasurement keratometry_measurement(const EyeFlag& flag);
/// Optical axial length: apex to the photoreceptors.
ExternalMeasurement axial_length_measurement(const EyeFlag& flag, double retinal_depth_mm);
ExternalMeasurement anterior_chamber_measurement(const EyeFlag& flag);
ExternalMeasurement lens_thickness_measurement(const EyeFlag& flag);

}  // namespace emmetrope
