#include "pipeline/base/case_scans.hpp"

#include <algorithm>

namespace emmetrope {

std::set<std::string> used_scans(const Json& case_json) {
  std::set<std::string> used_stacks, scans;
  for (const Json& stack : case_json.value("stacks", Json::array()))
    if (stack.value("used", false)) used_stacks.insert(stack.value("name", ""));
  for (const Json& series : case_json.value("series", Json::array())) {
    if (used_stacks.count(series.value("name", "")) == 0) continue;
    Json voxels = Json::array();
    for (const char* key : {"columns", "rows", "slices", "min", "max", "mean"})
      voxels.push_back(series.value(key, Json()));
    if (std::all_of(voxels.begin(), voxels.end(), [](const Json& told) { return told.is_number(); }))
      scans.insert(voxels.dump());
  }
  return scans;
}

bool share_a_scan(const Json& case_json, const Json& other_case_json) {
  const std::set<std::string> scans = used_scans(case_json), others = used_scans(other_case_json);
  return std::any_of(scans.begin(), scans.end(),
                     [&](const std::string& scan) { return others.count(scan) > 0; });
}

}  // namespace emmetrope
