#include "pipeline/base/case_subject.hpp"

#include <fmt/format.h>

#include <cmath>

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

std::string age_warning(std::optional<double> of_study, std::optional<double> given) {
  if (!of_study || !given || std::abs(*of_study - *given) <= rounding_of_age_years) return {};
  return fmt::format("the age that was given, {:g} years, is not used: the study says {:g} years", *given,
                     *of_study);
}

}  // namespace emmetrope
