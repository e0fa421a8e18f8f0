#pragma once
#include <filesystem>
#include <string>

#include "pipeline/eye/model/eye_model.hpp"
#include "raytrace/picture/trace_settings.hpp"
#include "raytrace/wavefront/wavefront.hpp"

namespace emmetrope::raytrace {

/// At the eye's reference wavelength or the one asked for: wavefront.json, the point spread function psf.tiff
/// and the spot diagram spots.csv.
void write_wavefront(const EyeModel& eye, const TraceSettings& settings, const std::filesystem::path& folder);

/// What to say where surfaces let less through than the stop, whose image is the pupil that was asked for; else nothing.
std::string narrowed_pupil(const EyeModel& eye, const Wavefront& wavefront);

/// The wavefront that a trace's settings ask for.
WavefrontSettings wavefront_settings(const TraceSettings& settings);

}  // namespace emmetrope::raytrace
