#pragma once
#include <filesystem>

#include "pipeline/base/command_line.hpp"
#include "raytrace/case/measured_eye.hpp"
#include "raytrace/trace_options.hpp"

namespace emmetrope::raytrace {

/// The eyes of a case: CASE/raytrace/<eye>/ with uncorrected.png, wavefront.json, psf.tiff, spots.csv,
/// eye.json and photoreceptors.ply.
/// \throw Error (input_invalid) when the case, or the eye that is asked for, has not been meshed
Answer trace_case(const std::filesystem::path& case_folder, const MeasuredEyeOptions& measured,
                  const TraceOptions& options, const CommonOptions& common);

}  // namespace emmetrope::raytrace
