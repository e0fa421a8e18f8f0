#pragma once
#include <filesystem>
#include <string>

#include "pipeline/report/document/document.hpp"

namespace emmetrope::report {

/// A picture file, made small for a page, as a figure: id, svg, width_px, height_px.
/// \throw Error (input_invalid) when the file is no picture
Figure picture_figure(const std::filesystem::path& file, const std::string& id);

}  // namespace emmetrope::report
