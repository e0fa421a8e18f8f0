#include "pipeline/base/case_subject.hpp"

#include "pipeline/base/json.hpp"

namespace emmetrope {

std::optional<double> subject_age_years(const std::filesystem::path& case_folder) {
  const auto file = case_folder / "case.json";
  if (!std::filesystem::exists(file)) return std::nullopt;
  const Json json = read_json(file);
  const Json::json_pointer age("/subject/age_years");
  if (!json.is_object() || !json.contains(age) || !json.at(age).is_number()) return std::nullopt;
  return json.at(age).get<double>();
}

}  // namespace emmetrope
