#pragma once
#include <string>

namespace emmetrope::report {

/// What somebody can do about a gate of segmentation that failed (docs/use/segment.md).
std::string remedy_of_gate(const std::string& gate);

/// About something that a stage said in words of its own.
std::string remedy_of_reason(const std::string& stage, const std::string& reason);

}  // namespace emmetrope::report
