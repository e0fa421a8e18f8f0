#pragma once
#include <map>
#include <optional>
#include <string>

#include "pipeline/base/laterality.hpp"
#include "raytrace/irradiance_files.hpp"
#include "raytrace/movie.hpp"
#include "raytrace/spectacle/spectacle.hpp"
#include "raytrace/tracer/exposure.hpp"
#include "raytrace/visual_field.hpp"
#include "raytrace/wavefront/field.hpp"

namespace emmetrope::raytrace {

/// What eyes see and how it is pictured, be they measured or schematic.
struct TraceOptions {
  std::string scene = "letters";  ///< a chart NAME[:key=value,...], or a scene.json
  TraceSettings settings;         ///< of every eye, but for its pose
  std::map<Laterality, EyePose> poses;
  std::optional<double> pupillary_distance_mm;  ///< given where two eyes look
  Exposure exposure;
  std::optional<Spectacle> spectacle;
  std::optional<FieldGrid> psf_grid;             ///< what else is measured over the visual field
  std::optional<IrradianceSettings> irradiance;  ///< the light on the retina in physical units too
  IrradianceFiles irradiance_files;
  std::optional<MovieSettings> movie;
  std::map<Laterality, Landmarks> landmarks;  ///< of the retinas, where they were given

  /// \throw Error (usage) naming the option
  void check() const;
  TraceSettings settings_of(Laterality eye) const;
  Landmarks landmarks_of(Laterality eye) const;
  /// The eye with the spectacle before it, if there is one.
  EyeModel with_worn(const EyeModel& eye) const;
};

}  // namespace emmetrope::raytrace
