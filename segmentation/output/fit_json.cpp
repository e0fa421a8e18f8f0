#include "segmentation/output/fit_json.hpp"

#include <fmt/format.h>

#include <cmath>

#include "pipeline/base/measured.hpp"
#include "pipeline/eye/population/population.hpp"
#include "pipeline/eye/uncertainty/uncertain_eye.hpp"
#include "segmentation/edges/edge_biometry.hpp"

namespace emmetrope::segmentation {
namespace {

Json stack_json(const EyeFit& fit, int s) {
  const ObservedStack& o = fit.stacks[s];
  const int at = fit.layout.stack(s);
  return {{"name", o.stack->name},
          {"reference_intensity", o.reference},
          {"noise", o.sampling.noise * o.reference},
          {"shift_lps_mm", to_json_vector(fit.parameters.segment<3>(at + shift_first))},
          {"turn_lps_deg", to_json_vector(fit.parameters.segment<3>(at + turn_first))},
          {"fat_shift_mm", {fit.parameters[at + fat_shift_first], fit.parameters[at + fat_shift_first + 1]}},
          {"fat_is_dark", fit.stacks[s].fat_is_dark},
          {"misfit", fit.misfit[s]},
          {"gain", std::exp(fit.parameters[at + log_gain])},
          {"sharpness", std::exp(fit.parameters[at + log_sharpness])},
          {"sharpness_ratio", std::exp(fit.parameters[at + log_sharpness_ratio])},
          {"sharpness_through", std::exp(fit.parameters[at + log_sharpness_through])},
          {"k_space_filter", fit.parameters[at + k_space_filter]}};
}

Json region_json(const RegionFit& region) {
  return {{"name", region.name},
          {"voxels", region.voxels},
          {"chi2_per_voxel", region.chi2},
          {"residual_correlation", region.correlation},
          {"outlier_share", region.outliers}};
}

/// What is not to be used, and why: "fit" is everything that was fitted.
Json withheld_json(const JudgedEye& eye) {
  Json json = Json::object();
  for (const Withholds what : {Withholds::fit, Withholds::front, Withholds::cornea})
    if (is_withheld(eye.gates, what)) json[to_string(what)] = reasons_for(eye.gates, what);
  return json;
}

Json to_json(const Estimate& estimate) {
  return Measured::from_sigma(estimate.value, estimate.sigma, Origin::of_images("mri", 1), "edges");
}

/// The plain reading of half-level edges; null where it is not sure of the globe.
Json edges_json(const JudgedEye& eye) {
  const std::optional<ReadEye> edges = eye.main_edges();
  if (!edges) return nullptr;
  const EdgeReading& reading = edges->reading;
  const EdgeBiometry biometry = eye.stated_edges();
  Json json{{"lps_from_eye", to_json_matrix(frame_of(reading))},
            {"globe_centre_lps_mm", to_json_vector(reading.globe.centre)},
            {"globe_centre_sigma_mm", biometry.centre.sigma},
            {"lens_centre_lps_mm", to_json_vector(reading.lens_centre)},
            {"globe_width_mm", to_json(biometry.globe_width)},
            {"globe_height_mm", to_json(biometry.globe_height)},
            {"globe_depth_mm", to_json(biometry.globe_depth)},
            {"kept_share", reading.globe.kept_share},
            {"rms_mm", reading.globe.rms_mm}};
  const std::string on_axis_withheld = eye.edges_on_axis_withheld();
  for (const auto& [name, estimate] : {std::pair{"axial_length_mm", biometry.axial_length},
                                       {"anterior_chamber_depth_mm", biometry.anterior_chamber_depth},
                                       {"lens_thickness_mm", biometry.lens_thickness}})
    json[name] = on_axis_withheld.empty() ? to_json(*estimate) : withheld(on_axis_withheld);
  return json;
}

/// What half-level edges say of an eye whose fit is withheld.
std::string edges_summary(const Json& edges) {
  const auto number = [&](const char* name) {
    const Json& found = edges.at(name);
    if (found.at("value").is_null()) return std::string("withheld");
    const auto measured = found.get<Measured>();
    return fmt::format("{:.1f} +- {:.1f} mm", measured.value, 1.96 * measured.sigma());
  };
  return fmt::format("by edges alone: axial length {}, width {}, height {}", number("axial_length_mm"),
                     number("globe_width_mm"), number("globe_height_mm"));
}

/// Of the parameters' covariance what other such images at this field share; null: not known.
Json shared_error_json(const EyeFit& fit) {
  const Eigen::Index count = fit.shared_covariance.rows();
  if (count == 0) return nullptr;
  Json covariance = Json::object();
  const auto name = [&](Eigen::Index i) { return fit.layout.name(fit.active[static_cast<std::size_t>(i)]); };
  for (Eigen::Index i = 0; i < count; ++i)
    for (Eigen::Index k = 0; k < count; ++k)
      if (fit.shared_covariance(i, k) != 0) covariance[name(i)][name(k)] = fit.shared_covariance(i, k);
  return {{"images", alike_images(fit)}, {"covariance", covariance}};
}

/// What images of the other contrast said by themselves, or with this one where they are joined; null: there are none.
Json other_contrast_json(const JudgedEye& eye) {
  if (eye.in_other_contrast.empty()) return nullptr;
  const JudgedEye& other = eye.in_other_contrast.front();
  Json json{{"contrast", to_string(other.found.weighting)},
            {"status", other.status()},
            {"reason", other.reasons()},
            {"joined", eye.is_joined},
            {"stacks", Json::array()}};
  if (!other.fit) return json;
  json["globe_centre_lps_mm"] = to_json_vector(other.fit->globe_centre_lps());
  json["chi2_per_voxel"] = other.fit->chi2_per_voxel;
  json["voxels"] = other.fit->samples.size();
  for (int s = 0; s < other.fit->layout.stacks; ++s) json["stacks"].push_back(stack_json(*other.fit, s));
  return json;
}

}  // namespace

Json fit_json(const JudgedEye& eye, std::optional<double> head_roll_deg) {
  Json json{{"laterality", to_string(eye.found.laterality)}, {"status", eye.status()}};
  json["head_roll_deg"] = head_roll_deg ? Json(*head_roll_deg) : Json(nullptr);
  json["evidence"] = to_string(eye.evidence);
  json["contrast"] = to_string(eye.found.weighting);
  json["quality"] = Json::array();
  for (const QualityGate& gate : eye.gates) json["quality"].push_back(to_json(gate));
  json["withheld"] = withheld_json(eye);
  json["edges"] = edges_json(eye);
  json["other_contrast"] = other_contrast_json(eye);
  if (!eye.fit) return json;
  const EyeFit& fit = *eye.fit;
  json["globe_centre_lps_mm"] = to_json_vector(fit.globe_centre_lps());
  json["chi2_per_voxel"] = fit.chi2_per_voxel;
  json["voxels"] = fit.samples.size();
  json["iterations"] = fit.iterations;
  json["converged"] = fit.converged;
  json["noise"] = Json::array();
  json["stacks"] = Json::array();
  for (int s = 0; s < fit.layout.stacks; ++s) {
    json["noise"].push_back(fit.stacks[s].sampling.noise * fit.stacks[s].reference);
    json["stacks"].push_back(stack_json(fit, s));
  }
  json["regions"] = Json::array();
  for (const RegionFit& region : fit.regions) json["regions"].push_back(region_json(region));
  if (fit.evidence == Evidence::intensities)
    json["cornea"] = {{"form", fit.layout.irregular_cornea ? "irregular" : "biconic"},
                      {"irregularity_chi2", fit.irregularity.chi2},
                      {"irregularity_chi2_limit", CornealIrregularity::chi2_limit}};
  json["apex_start_costs"] = fit.start_costs;
  Json intensities;
  for (int i = vitreous; i <= surround; ++i) intensities[fit.layout.name(i)] = fit.parameters[i];
  json["intensities"] = intensities;
  json["eye"] = to_json(to_parametric_eye(fit, eye.found.laterality));
  json["shared_error"] = shared_error_json(fit);
  return json;
}

std::string summary(const Json& fit, Laterality laterality) {
  if (fit.at("status") == "refused") return fmt::format("{}: refused\n", clinical_name(laterality));
  if (fit.at("withheld").contains("fit"))
    return fmt::format("{}: {}\n", clinical_name(laterality), edges_summary(fit.at("edges")));
  const UncertainEye measured(parametric_eye_from_json(fit.at("eye")));
  const ParametricEye& eye = measured.eye();
  const auto half_width = [&](const char* name) { return 1.96 * measured.sigma(name); };
  if (fit.at("withheld").contains("front"))
    return fmt::format("{}: the back alone: width {:.2f} +- {:.2f} mm, height {:.2f} +- {:.2f} mm\n",
                       clinical_name(laterality), 2 * eye.globe_semi_axes_mm.x(),
                       2 * half_width("globe_semi_axis_x_mm"), 2 * eye.globe_semi_axes_mm.y(),
                       2 * half_width("globe_semi_axis_y_mm"));
  return fmt::format(
      "{}: axial length {:.2f} mm, {}, anterior chamber {:.2f} +- {:.2f} mm, lens {:.2f} +- {:.2f} mm\n",
      clinical_name(laterality), eye.pole_depth_mm(),
      fit.at("withheld").contains("cornea")
          ? std::string("corneal power withheld")
          : fmt::format("corneal power {:.2f} +- {:.2f} D", keratometric_D_mm * eye.cornea_c_per_mm,
                        keratometric_D_mm * half_width("cornea_c_per_mm")),
      eye.anterior_chamber_depth_mm, half_width("anterior_chamber_depth_mm"), eye.lens_thickness_mm,
      half_width("lens_thickness_mm"));
}

}  // namespace emmetrope::segmentation
