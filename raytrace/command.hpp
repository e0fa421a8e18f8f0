#pragma once
#include <filesystem>
#include <optional>
#include <string>

#include "pipeline/base/command_line.hpp"
#include "raytrace/case/measured_eye.hpp"
#include "raytrace/tracer/exposure.hpp"

namespace emmetrope::raytrace {

/// What `emmetrope trace` was asked for, as text and numbers from its command line.
struct TraceOptions {
  std::string case_folder, eye, output, scene = "letters";
  std::string surfaces, size = "500x500", field_mm = "6x6", spectacle, plano_cylinder, gaze = "0,0",
                        fovea = "0,0", lens_model, method = "pupil", vertices = "800";
  std::string fixate, strabismus, motion = "0,0";
  std::optional<double> pupil_mm, wavelength_nm, accommodation_D, accommodation_parameter,
      pupillary_distance_mm;
  double rotation_centre_mm = 13.5;
  int exposure_steps = 32;
  std::optional<int> samples;
  MeasuredEyeOptions measured;
  TraceSettings settings;
};

/// `emmetrope trace`: the eyes of a case, or one eye by name or file.
Command command();

/// The settings with size, field and gaze read.
/// \throw Error (usage) naming the option
TraceSettings read_settings(const TraceOptions& options);

/// Where that eye stands and looks: --pupillary-distance, --gaze or --fixate, --strabismus.
/// \throw Error (usage) naming the option
EyePose read_pose(const TraceOptions& options, Laterality laterality);
Exposure read_exposure(const TraceOptions& options);

/// The eye with the spectacle in front of it that was asked for, if any.
EyeModel with_spectacle(const EyeModel& eye, const TraceOptions& options);

}  // namespace emmetrope::raytrace
