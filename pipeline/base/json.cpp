#include "pipeline/base/json.hpp"

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"

namespace emmetrope {

Json read_json(const std::filesystem::path& file) {
  try {
    return Json::parse(read_file(file));
  } catch (const Json::parse_error& fault) {
    throw input_error(file.string() + " is no valid JSON: " + fault.what());
  }
}

void write_json(const std::filesystem::path& file, const Json& json) {
  write_file(file, json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
}

}  // namespace emmetrope
