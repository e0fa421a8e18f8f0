#include "pipeline/base/json.hpp"

#include <fmt/format.h>

#include <set>
#include <string>
#include <vector>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"

namespace emmetrope {

Json parse_json(const std::string& text, const std::string& name) {
  constexpr int deepest = 64;               // the parser is recursive where values are destroyed: bound it
  std::vector<std::set<std::string>> keys;  // of the objects that are open
  const auto sound = [&](int depth, Json::parse_event_t event, Json& parsed) {
    if (depth > deepest) throw input_error(fmt::format("{} is nested deeper than {}", name, deepest));
    if (event == Json::parse_event_t::object_start) keys.emplace_back();
    if (event == Json::parse_event_t::object_end) keys.pop_back();
    if (event == Json::parse_event_t::key && !keys.back().insert(parsed.get<std::string>()).second)
      throw input_error(fmt::format("{}: the key {} stands twice in one object", name, parsed.dump()),
                        "keep one of the two");
    return true;
  };
  try {
    return Json::parse(text, sound);
  } catch (const Json::exception& fault) {
    throw input_error(name + " is no valid JSON: " + fault.what());
  }
}

Json read_json(const std::filesystem::path& file) { return parse_json(read_file(file), file.string()); }

void write_json(const std::filesystem::path& file, const Json& json) {
  write_file(file, json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
}

}  // namespace emmetrope
