#pragma once
#include <filesystem>

#include "pipeline/base/command_line.hpp"

namespace emmetrope::report {

/// Two dates of one patient side by side: HTML and PDF in LATER/comparison/. A difference counts as a change
/// when it exceeds the 95 % interval of a difference of independent measurements, sqrt(h_a^2 + h_b^2) with
/// the half widths h.
/// \throw Error (input_invalid) when a case lacks its results
Answer write_comparison(const std::filesystem::path& earlier, const std::filesystem::path& later,
                        const CommonOptions& common);

}  // namespace emmetrope::report
