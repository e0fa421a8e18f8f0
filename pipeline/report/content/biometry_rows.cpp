#include "pipeline/report/content/biometry_rows.hpp"

#include <cmath>

#include "pipeline/report/content/first_page.hpp"

namespace emmetrope::report {

bool BiometryRow::is_determined(const Json& document) const {
  return cylinder == nullptr ||
         has_axis(document.value(Json::json_pointer(std::string("/") + cylinder), Json()));
}

Normal BiometryRow::normal(std::optional<double> age_years) const { return normal_at_age(key, age_years); }

bool BiometryRow::is_normal(double value, std::optional<double> age_years) const {
  const Range range = normal(age_years).range;
  const double digit = std::pow(10, -style.decimals), half = digit / 2;
  return std::round(value / digit) * digit >= range.low - half &&
         std::round(value / digit) * digit <= range.high + half;
}

const std::vector<BiometryRow>& biometry_rows() {
  static const std::vector<BiometryRow> rows{
      {"optical_axial_length_mm", "Axial length, optical", {2, false, "mm"}},
      {inner_axial_length_key, "Axial length, to the inner retina", {2, false, "mm"}},
      {"globe_width_mm", "Globe width (inner)", {1, false, "mm"}},
      {"globe_height_mm", "Globe height (inner)", {1, false, "mm"}},
      {"corneal_thickness_mm", "Corneal thickness", {2, false, "mm"}},
      {"anterior_chamber_depth_mm", "Anterior chamber depth", {2, false, "mm"}},
      {"lens_thickness_mm", "Lens thickness", {2, false, "mm"}},
      {"lens_anterior_radius_mm", "Lens front radius", {1, false, "mm"}},
      {"lens_posterior_radius_mm", "Lens back radius", {1, false, "mm"}},
      {"interpupillary_distance_mm", "Between the globes' centres (not the pupils)", {1, false, "mm"}}};
  return rows;
}

const std::vector<BiometryRow>& keratometry_rows() {
  static const std::vector<BiometryRow> rows{
      {"keratometry/flat/power_D", "Flat meridian K1", {2, false, "D"}},
      {"keratometry/flat/radius_mm", "Flat radius", {2, false, "mm"}},
      {"keratometry/flat/axis_deg", "Flat axis", {0, false, "axis"}, "keratometry/cylinder_D"},
      {"keratometry/steep/power_D", "Steep meridian K2", {2, false, "D"}},
      {"keratometry/steep/radius_mm", "Steep radius", {2, false, "mm"}},
      {"keratometry/steep/axis_deg", "Steep axis", {0, false, "axis"}, "keratometry/cylinder_D"},
      {"keratometry/cylinder_D", "Corneal cylinder (steep - flat)", {2, false, "D"}},
      {"keratometry/asphericity_q", "Asphericity Q", {2, true, ""}},
      {"astigmatism/M_D", "Corneal mean power M", {2, false, "D"}},
      {"astigmatism/J0_D", "Corneal J0", {2, true, "D"}},
      {"astigmatism/J45_D", "Corneal J45", {2, true, "D"}},
      {"astigmatism/irregularity_um", "Irregularity (rms from the best toric)", {1, false, "\u00b5m"}},
      {"astigmatism/section_2p3mm/horizontal_mm",
       "Corneal section 2.3 mm deep, horizontal",
       {2, false, "mm"}},
      {"astigmatism/section_2p3mm/vertical_mm", "Corneal section 2.3 mm deep, vertical", {2, false, "mm"}}};
  return rows;
}

const std::vector<BiometryRow>& retina_rows() {
  static const std::vector<BiometryRow> rows{
      {"globe_depth_mm", "Globe depth (inner)", {1, false, "mm"}},
      {"retina/vertex_radius_mm/horizontal", "Retinal vertex radius, horizontal", {2, false, "mm"}},
      {"retina/vertex_radius_mm/vertical", "Retinal vertex radius, vertical", {2, false, "mm"}},
      {"retina/q_240", "Retinal asphericity Q, 240\u00b0", {2, true, ""}},
      {"retina/q_120", "Retinal asphericity Q, 120\u00b0", {2, true, ""}},
      {"retina/tilt_deg/horizontal", "Retinal tilt to the patient's left", {2, true, "deg"}},
      {"retina/tilt_deg/vertical", "Retinal tilt upwards", {2, true, "deg"}},
      {"retina/area_mm2", "Retinal area, 240\u00b0", {0, false, "mm\u00b2"}},
      {"retina/volume_mm3", "Vitreous volume", {0, false, "mm\u00b3"}},
      {"retina/staphyloma_index", "Staphyloma index", {1, false, ""}}};
  return rows;
}

std::map<std::string, std::string> withheld_quantities(const Json& biometry) {
  std::map<std::string, std::string> quantities;
  const auto add = [&](const BiometryRow& row, const std::string& name) {
    const Json::json_pointer at("/" + row.key);
    if (!biometry.is_object() || !biometry.contains(at) || !is_withheld(biometry.at(at))) return;
    std::string& list = quantities[biometry.at(at).at("withheld").get<std::string>()];
    if (list.find(name) == std::string::npos) list += (list.empty() ? "" : "; ") + name;
  };
  for (const BiometryRow& row : biometry_rows()) add(row, row.name);
  for (const BiometryRow& row : keratometry_rows()) add(row, "Keratometry and corneal astigmatism");
  for (const BiometryRow& row : retina_rows()) add(row, row.name);
  return quantities;
}

std::array<const std::vector<BiometryRow>*, 3> measured_rows() {
  return {&biometry_rows(), &keratometry_rows(), &retina_rows()};
}

}  // namespace emmetrope::report
