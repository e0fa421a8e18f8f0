#pragma once
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "pipeline/base/laterality.hpp"
#include "pipeline/eye/instruments/topography.hpp"
#include "pipeline/eye/uncertainty/uncertain_eye.hpp"

namespace CLI {
class App;
}

/// What other instruments measured of an eye, and how it is given on a command line.
namespace emmetrope {

/// As it is typed: "od:43.25@175/44.75@85+-0.25". What follows +- is one standard deviation in the unit of
/// the value; without it 0.25 D or 0.05 mm.
struct InstrumentFlags {
  std::vector<std::string> keratometry, axial_length, anterior_chamber_depth, lens_thickness, topography;
};
/// Declares --keratometry, --axial-length, --acd, --lens-thickness and --topography, all repeatable.
void declare(CLI::App& app, InstrumentFlags& flags);
/// A corneal elevation map that is to be read.
struct TopographyFlag {
  std::filesystem::path file;
  double sigma_D = 0;
};

/// What is known of one eye from other instruments.
struct EyeInstruments {
  std::vector<ExternalMeasurement> measurements;
  std::optional<TopographyFlag> topography = {};
};
/// \param retinal_depth_mm  photoreceptors, which an optical axial length reaches, behind the interface that
///   the eye's own axial length reaches
/// \throw Error (usage) naming the flag and what was expected
std::map<Laterality, EyeInstruments> parse_instruments(const InstrumentFlags& flags, double retinal_depth_mm);

/// For a stage's parameters in stage.json, by eye.
Json to_json(const std::map<Laterality, EyeInstruments>& instruments);
/// Names of what was given of an eye, {"keratometry", "topography"}, in what to_json() made.
std::set<std::string> given_of(const Json& instruments, Laterality eye);

/// With the elevation map read.
struct InstrumentReadings {
  std::vector<ExternalMeasurement> measurements;
  std::optional<Topography> topography;  ///< its toric part is among the measurements, its departure is not
};
/// \throw Error (input_invalid) for a map that cannot be used
InstrumentReadings read_instruments(const EyeInstruments& instruments);

/// Learns what other instruments found of an eye.
/// \return warnings; see judge_innovation
/// \throw Error (input_invalid) for a reading that cannot be of this eye
std::vector<std::string> learn(UncertainEye& eye, const InstrumentReadings& readings);

/// Two perpendicular meridians with their keratometric powers (index 1.3375): "43.25@175/44.75@85".
/// \throw Error (usage)
ExternalMeasurement keratometry_measurement(const std::string& text, double sigma_D);
/// Optical axial length: apex to the photoreceptors.
ExternalMeasurement axial_length_measurement(const std::string& text, double sigma_mm,
                                             double retinal_depth_mm);
ExternalMeasurement anterior_chamber_measurement(const std::string& text, double sigma_mm);
ExternalMeasurement lens_thickness_measurement(const std::string& text, double sigma_mm);

}  // namespace emmetrope
