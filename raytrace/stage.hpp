#pragma once
#include "raytrace/command.hpp"

namespace emmetrope::raytrace {

/// The eyes of a case: CASE/raytrace/<eye>/ with uncorrected.png, wavefront.json, psf.tiff, spots.csv,
/// eye.json and photoreceptors.ply.
/// \throw Error (input_invalid) when the case, or the eye that is asked for, has not been meshed
Answer trace_case(TraceOptions options, const CommonOptions& common);

/// A schematic eye or an eye.json, into a picture or a folder of such files.
Answer trace_named(const TraceOptions& options, const CommonOptions& common);

}  // namespace emmetrope::raytrace
