#include "pipeline/base/measured.hpp"

#include "pipeline/base/error.hpp"

namespace emmetrope {

Measured Measured::from_sigma(double value, double sigma, std::string source, std::string method) {
  constexpr double normal_quantile_975 = 1.959963985;
  return {value,
          {value - normal_quantile_975 * sigma, value + normal_quantile_975 * sigma},
          std::move(source),
          std::move(method)};
}

void to_json(Json& json, const Measured& measured) {
  json = Json{{"value", measured.value}, {"ci95", measured.ci95}, {"source", measured.source}};
  if (!measured.method.empty()) json["method"] = measured.method;
}

Json withheld(const std::string& reason) { return {{"value", nullptr}, {"withheld", reason}}; }

bool is_withheld(const Json& quantity) { return quantity.is_object() && quantity.contains("withheld"); }

void from_json(const Json& json, Measured& measured) {
  for (const char* key : {"value", "ci95", "source"})
    if (!json.is_object() || !json.contains(key))
      throw input_error("a measured number lacks \"" + std::string(key) + "\": " + json.dump());
  measured.value = json.at("value").get<double>();
  measured.ci95 = json.at("ci95").get<std::array<double, 2>>();
  measured.source = json.at("source").get<std::string>();
  measured.method = json.value("method", std::string());
}

}  // namespace emmetrope
