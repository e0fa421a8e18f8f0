#include "pipeline/base/measured.hpp"

#include "pipeline/base/error.hpp"

namespace emmetrope {

Origin Origin::of_images(const std::string& images, double image_share) {
  constexpr double mostly = 0.5, hardly = 0.1;
  Origin origin = image_share > mostly ? images : image_share < hardly ? "prior" : images + "+prior";
  origin.image_share = image_share;
  return origin;
}

Measured Measured::from_sigma(double value, double sigma, Origin origin, std::string method) {
  constexpr double normal_quantile_975 = 1.959963985;
  return {value,
          {value - normal_quantile_975 * sigma, value + normal_quantile_975 * sigma},
          std::move(origin.source),
          std::move(method),
          origin.image_share};
}

void to_json(Json& json, const Measured& measured) {
  json = Json{{"value", measured.value}, {"ci95", measured.ci95}, {"source", measured.source}};
  if (measured.image_share) json["image_share"] = *measured.image_share;
  if (!measured.method.empty()) json["method"] = measured.method;
}

Json withheld(const std::string& reason) { return {{"value", nullptr}, {"withheld", reason}}; }

bool is_withheld(const Json& quantity) { return quantity.is_object() && quantity.contains("withheld"); }

void from_json(const Json& json, Measured& measured) {
  try {
    measured.value = json.at("value").get<double>();
    measured.ci95 = json.at("ci95").get<std::array<double, 2>>();
    measured.source = json.at("source").get<std::string>();
    measured.method = json.value("method", std::string());
    measured.image_share =
        json.contains("image_share") ? std::optional(json.at("image_share").get<double>()) : std::nullopt;
  } catch (const Json::exception&) {
    throw input_error("a measured number has a value, a ci95 of two numbers and a source, found " +
                      json.dump());
  }
}

}  // namespace emmetrope
