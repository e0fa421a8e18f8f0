#include "pipeline/base/json.hpp"

#include <fmt/format.h>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"

namespace emmetrope {

Json read_json(const std::filesystem::path& file) {
  constexpr int deepest = 64;  // the parser is recursive where values are destroyed: bound it
  const auto within = [&](int depth, Json::parse_event_t, Json&) {
    if (depth > deepest)
      throw input_error(fmt::format("{} is nested deeper than {}", file.string(), deepest));
    return true;
  };
  try {
    return Json::parse(read_file(file), within);
  } catch (const Json::exception& fault) {
    throw input_error(file.string() + " is no valid JSON: " + fault.what());
  }
}

void write_json(const std::filesystem::path& file, const Json& json) {
  write_file(file, json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
}

}  // namespace emmetrope
