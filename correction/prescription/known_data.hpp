#pragma once
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "correction/prescription/prescription.hpp"
#include "pipeline/base/laterality.hpp"
#include "pipeline/base/notation.hpp"
#include "pipeline/eye/instruments/instruments.hpp"

/// What the clinic knows of an eye beside its images.
namespace emmetrope::correction {

/// As it is typed on a command line.
struct KnownDataFlags {
  InstrumentFlags instruments;
  std::vector<std::string> refractions;  ///< "od:-2.25/-1.00x180@12+-0.25"
};

/// Of one eye.
struct KnownData {
  EyeInstruments instruments;
  std::optional<StatedRefraction> refraction;
  bool has_instruments() const { return !instruments.measurements.empty() || instruments.topography; }
  bool empty() const { return !has_instruments() && !refraction; }
};
/// \throw Error (usage) naming the flag and what was expected
std::map<Laterality, KnownData> parse_known_data(const KnownDataFlags& flags);
/// For stage.json's parameters.
Json to_json(const std::map<Laterality, KnownData>& known);

/// The clinic's refraction enters as one more measurement of the eye: all that is uncertain about it moves,
/// the lens index most where it is free, so that the sharpest lens comes to lie between what the images say
/// and what was given, nearer to the more accurate. What was given is of 589.3 nm.
///
/// \param traced  the eye whose sharpest lens is compared with the refraction
/// \throw Error (no_result) when that would need a lens index outside 1.36 to 1.50
Calibration calibrate(const raytrace::Tracer& tracer, const EyeModel& traced, UncertainOptics& uncertain,
                      const StatedRefraction& known, const PrescriptionSettings& settings);

}  // namespace emmetrope::correction
