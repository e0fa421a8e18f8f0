#pragma once
#include <filesystem>

#include "pipeline/eye/model/eye_model.hpp"
#include "raytrace/picture/trace_settings.hpp"

namespace emmetrope::raytrace {

/// Into a folder: visual-field.json, where the retina sees the visual field by chief rays, every 5 degrees from the
/// line of sight of the picture's centre as far as the eye sees, on every 15th meridian (columns of equal length).
void write_visual_field(const EyeModel& eye, const TraceSettings& settings,
                        const std::filesystem::path& folder);

}  // namespace emmetrope::raytrace
