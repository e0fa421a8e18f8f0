#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "correction/prescription/prescription.hpp"
#include "correction/prescription/withholding.hpp"
#include "pipeline/base/notation.hpp"
#include "pipeline/base/version.hpp"

namespace emmetrope::correction {
namespace {

Json notation_json(const PowerVector& power) {
  const SpheroCylinder notation = to_sphero_cylinder(power);
  return {{"sphere_D", notation.sphere_D},
          {"cylinder_D", notation.cylinder_D},
          {"axis_deg", notation.axis_deg},
          {"text", format_refraction(notation)}};
}

Json rounded_json(const PowerVector& power) {
  const RoundedRefraction rounded = round_refraction(power);
  return {{"sphere_D", rounded.refraction.sphere_D},
          {"cylinder_D", rounded.refraction.cylinder_D},
          {"axis_deg", rounded.refraction.axis_deg},
          {"residual_D", rounded.residual_D},
          {"text", format_refraction(rounded.refraction)},
          {"plus_cylinder_text", format_plus_cylinder(rounded.refraction)}};
}

Json line_json(const char* name_key, const std::string& name, const BudgetLine& line) {
  return {{name_key, name}, {"M_D", line.M_D}, {"J0_D", line.J0_D}, {"J45_D", line.J45_D}};
}

Json search_json(const SearchResult& search) {
  Json optima = Json::array();
  for (const Eigen::VectorXd& lens : search.optima) {
    const PowerVector power = search.family.power(lens);
    optima.push_back({power.M_D, power.J0_D, power.J45_D});
  }
  Json curvature = Json::array();
  for (Eigen::Index i = 0; i < search.curvature.rows(); ++i) {
    const Eigen::VectorXd row = search.curvature.row(i);
    curvature.push_back(std::vector<double>(row.begin(), row.end()));
  }
  return {{"converged", search.accepted},
          {"images", search.images},
          {"log_curvature_per_D2", std::move(curvature)},
          {"distinct_optima_D", std::move(optima)}};
}

/// Why the criteria differ, with this eye's numbers.
Json difference_json(const Prescription& prescription) {
  const PowerVector& sharpest = prescription.refraction;
  const raytrace::RefractionCriteria& check = prescription.check;
  const raytrace::Wavefront& wavefront = prescription.wavefront;
  const double c40_um = wavefront.zernike_um.size() > 12 ? wavefront.zernike_um[12] : 0;
  const double radius_mm = wavefront.pupil_mm / 2;
  const double by_aberration_D = 12 * std::sqrt(5.0) * c40_um / (radius_mm * radius_mm);
  return {
      {"sharpness_minus_paraxial_M_D", sharpest.M_D - check.paraxial.M_D},
      {"sharpness_minus_minimum_rms_wavefront_M_D", sharpest.M_D - check.minimum_rms_wavefront.M_D},
      {"spherical_aberration_um", c40_um},
      {"entrance_pupil_mm", wavefront.pupil_mm},
      {"text",
       fmt::format(
           "The pupil's centre (paraxial) is {:+.2f} D from the whole pupil (minimum rms wavefront); primary "
           "spherical aberration of {:+.3f} um over the {:.1f} mm entrance pupil accounts for {:+.2f} D of "
           "it. The sharpest image lies {:+.2f} D from the whole pupil's refraction, where most of the light "
           "agrees. The larger the pupil, the larger these differences.",
           check.paraxial.M_D - check.minimum_rms_wavefront.M_D, c40_um, wavefront.pupil_mm, by_aberration_D,
           sharpest.M_D - check.minimum_rms_wavefront.M_D)}};
}

/// What was given and what the images say, from which the result has been combined.
Json calibration_json(const Calibration& calibration) {
  const RefractionIntervals alone =
      refraction_intervals(calibration.before, calibration.covariance_before, calibration.origins_before);
  Json without_it = notation_json(calibration.before);
  without_it["sphere_D"] = alone.sphere_D;
  without_it["cylinder_D"] = alone.cylinder_D;
  without_it["axis_deg"] = alone.axis_deg;
  without_it["M_D"] = alone.M_D;
  without_it["J0_D"] = alone.J0_D;
  without_it["J45_D"] = alone.J45_D;
  const double after = calibration.index_after.value;
  const std::string moved =
      calibration.index_was_known
          ? "The index of the lens was known and has stayed; what has moved is the shape of the eye."
          : fmt::format("For that the index of the lens has moved from {:.4f} to {:.4f}, the rest is shape.",
                        calibration.index_before, after);
  return {
      {"given", notation_json(calibration.given)},
      {"sigma_D", calibration.sigma_D},
      {"surprise_sigma", calibration.innovation_sigma},
      {"surprise_limit_sigma", doubtful_innovation_sigma},
      {"lens_index_before", calibration.index_before},
      {"lens_index_after", calibration.index_was_known ? Json(after) : Json(calibration.index_after)},
      {"without_it", std::move(without_it)},
      {"text",
       "The given refraction has been combined with what is known without it, each by its accuracy: the result "
       "is no independent measurement. " +
           moved}};
}

std::string to_string(AxisFrom from) {
  switch (from) {
    case AxisFrom::sharpness:
      return "sharpness";
    case AxisFrom::refraction:
      return "refraction";
    case AxisFrom::convention:
      return "convention";
  }
  return {};
}

Json contact_lens_json(const Prescription& prescription) {
  const PowerVector power =
      move_towards_eye(prescription.refraction, prescription.settings.vertex_distance_mm);
  Json json = notation_json(power);
  json["vertex_distance_mm"] = 0;
  json["rounded"] = rounded_json(power);
  return json;
}

Json plano_cylinder_json(const PlanoCylinderResult& plano, const PrescriptionSettings& settings) {
  Json json = {{"index", settings.plano_cylinder_index},
               {"vertex_distance_mm", settings.plano_cylinder_distance_mm}};
  if (plano.search.accepted)
    json.update({{"radius_mm", plano.lens.radius_mm},
                 {"axis_deg", plano.lens.axis_deg},
                 {"axis_from", to_string(plano.axis_from)},
                 {"sharpness", plano.sharpness},
                 {"power_D", plano.lens.power_D},
                 {"log_curvature_per_mm2", plano.radius_curvature_per_mm2},
                 {"search", search_json(plano.search)}});
  else
    json["reason"] = plano.search.reason;
  return json;
}

Json budget_json(const std::vector<BudgetLine>& budget) {
  Json json = Json::array();
  for (const BudgetLine& line : budget) json.push_back(line_json("source", line.source, line));
  return json;
}

Json if_measured_json(const std::vector<PrescriptionUncertainty::Value>& values) {
  Json json = Json::array();
  for (const auto& value : values)
    json.push_back(line_json("measurement", value.measurement, value.sigma_after));
  return json;
}

Json peripheral_json(const std::vector<FieldPoint>& field) {
  Json json = Json::array();
  for (const FieldPoint& point : field)
    json.push_back({{"horizontal_deg", point.horizontal_deg},
                    {"vertical_deg", point.vertical_deg},
                    {"M_D", point.refraction.M_D},
                    {"J0_D", point.refraction.J0_D},
                    {"J45_D", point.refraction.J45_D}});
  return json;
}

/// Conditions under which the refraction holds.
void add_conditions(Json& json, const PrescriptionSettings& settings) {
  json["vertex_distance_mm"] = settings.vertex_distance_mm;
  json["pupil_mm"] = settings.pupil_mm;
  json["wavelength_nm"] = settings.wavelength_nm;
  json["fovea_mm"] = {settings.fovea_mm.x(), settings.fovea_mm.y()};
  json["criterion"] = to_string(settings.criterion);
  json["chart"] = settings.chart.empty() ? "refraction chart" : settings.chart;
}

/// The refraction in every notation, with intervals, and whether it may stand as a prescription.
void add_refraction(Json& json, const PowerVector& refraction, const RefractionIntervals& intervals,
                    const std::string& contradiction) {
  const auto reason = [&](const std::string& text) { return text.empty() ? Json(nullptr) : Json(text); };
  const SpheroCylinder notation = to_sphero_cylinder(refraction);
  json["withheld"] = reason(contradiction.empty() ? reason_to_withhold(intervals.M_D) : contradiction);
  json["estimate"] = reason(reason_not_to_dispense(intervals.M_D));
  json["sphere_D"] = intervals.sphere_D;
  json["cylinder_D"] = intervals.cylinder_D;
  json["axis_deg"] = intervals.axis_deg;
  json["M_D"] = intervals.M_D;
  json["J0_D"] = intervals.J0_D;
  json["J45_D"] = intervals.J45_D;
  json["text"] = format_refraction(notation);
  json["plus_cylinder_text"] = format_plus_cylinder(notation);
  json["rounded"] = rounded_json(refraction);
}

}  // namespace

Json to_json(const Prescription& prescription, const PrescriptionUncertainty& uncertainty,
             const std::string& laterality) {
  const PrescriptionSettings& settings = prescription.settings;
  Json json;
  json["laterality"] = laterality.empty() ? Json(nullptr) : Json(laterality);
  add_conditions(json, settings);
  add_refraction(json, prescription.refraction,
                 refraction_intervals(prescription.refraction, uncertainty.covariance, uncertainty.origins),
                 contradiction_in(uncertainty));
  json["contact_lens"] = contact_lens_json(prescription);
  json["lenses"] = lenses_json(prescription.lenses, settings.spectacle);
  json["sharpest_lens"] = name_sharpest(prescription.lenses);
  json["plano_cylinder"] = plano_cylinder_json(prescription.plano_cylinder, settings);
  json["wavefront_check"] = raytrace::to_json(prescription.check);
  json["difference"] = difference_json(prescription);
  json["sharpness"] = {{"without_lens", prescription.sharpness_without_lens},
                       {"with_lens", prescription.search.best.sharpness}};
  json["images"] = prescription.images();
  json["search"] = search_json(prescription.search);
  json["budget"] = budget_json(uncertainty.budget);
  json["if_measured"] = if_measured_json(uncertainty.if_measured);
  json["peripheral"] = peripheral_json(prescription.field);
  json["learnt_from"] = uncertainty.data;
  if (uncertainty.calibration) json["calibration"] = calibration_json(*uncertainty.calibration);
  json["notice"] = research_notice;
  return json;
}

}  // namespace emmetrope::correction
