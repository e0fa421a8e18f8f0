#pragma once
#include <set>
#include <string>

#include "pipeline/base/json.hpp"

namespace emmetrope {

/// The scans that a case was measured from, each told by its voxels: matrix, least, largest and mean value to the last
/// digit. Two acquisitions differ in these by their noise; headers, ages and names that were changed leave them.
/// \param case_json  what case.json holds
/// \throw nlohmann::json::exception of a file that is broken
std::set<std::string> used_scans(const Json& case_json);

/// Whether the two cases have a scan in common.
bool share_a_scan(const Json& case_json, const Json& other_case_json);

}  // namespace emmetrope
