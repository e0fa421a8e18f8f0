#pragma once
#include <string>
#include <vector>

namespace emmetrope::report {

/// Whether all that a reason says, "OD (right): one thing; another", stands among sentences about the same eye: a stage
/// carries the reasons of those before it along, and quotes them.
bool is_said(const std::string& reason, const std::vector<std::string>& sentences);

}  // namespace emmetrope::report
