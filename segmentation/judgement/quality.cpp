#include "segmentation/judgement/quality.hpp"
#include "pipeline/eye/population/population.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace emmetrope::segmentation {
namespace {

/// Standard deviation of a linear combination of parameters.
double sigma_of(const EyeFit& fit, const Eigen::VectorXd& weights) {
  Eigen::VectorXd active(static_cast<Eigen::Index>(fit.active.size()));
  for (std::size_t i = 0; i < fit.active.size(); ++i)
    active[static_cast<Eigen::Index>(i)] = weights[fit.active[i]];
  return std::sqrt(std::max(0.0, active.dot(fit.covariance * active)));
}

}  // namespace

std::vector<QualityGate> judge_quality(const FoundEye& found, const EyeFit& fit) {
  std::vector<QualityGate> gates;
  const auto at_least = [&](const char* name, double value, double limit, bool decides,
                            const std::string& reason) {
    const bool passed = value >= limit;
    gates.push_back({name, value, limit, passed, decides, passed ? "" : reason});
  };
  const auto at_most = [&](const char* name, double value, double limit, bool decides,
                           const std::string& reason) {
    const bool passed = value <= limit;
    gates.push_back({name, value, limit, passed, decides, passed ? "" : reason});
  };

  double inside = 0;
  for (const EyeView& view : found.views) inside = std::max(inside, view.globe.inside);
  at_least(
      "globe_inside_stack", inside, 0.85, true,
      fmt::format("the eye is cut off or slices through it are missing: {:.0f} % of its wall lies inside the "
                  "images",
                  100 * inside));
  // Of the fit's reference: vitreous in T2, what surrounds the globe in T1. Against both fluids: what is no
  // lens may differ from one of them.
  const auto [darker, brighter] = std::minmax({fit.value(vitreous), fit.value(aqueous)});
  const double contrast =
      fit.weighting == Weighting::t2 ? darker - fit.value(lens) : fit.value(lens) - brighter;
  at_least("lens_contrast", contrast, 0.10, true,
           "the lens is not visible: nothing between aqueous and vitreous differs from both");
  const double off_axis = std::hypot(fit.value(lens_decentre_x), fit.value(lens_decentre_y));
  at_most(
      "lens_off_axis_mm", off_axis, 2, true,
      fmt::format("the lens was not found: the fitted one lies {:.1f} mm beside the eye's axis", off_axis));

  const double k = keratometric_D_mm * fit.value(cornea_c), k_sigma = keratometric_D_mm * fit.sigma(cornea_c);
  const double prior_sigma = keratometric_D_mm * fit.priors.sigma[cornea_c];
  at_most("cornea_sigma_over_prior", k_sigma / prior_sigma, 0.95, true,
          fmt::format("the cornea is not visible (a defaced head?): the images say next to nothing about its "
                      "curvature (sigma {:.2f} D, prior {:.2f} D)",
                      k_sigma, prior_sigma));
  const double length_sigma = fit.pole_depth_sigma_mm();
  at_most("axial_length_sigma_mm", length_sigma, 0.6, true,
          fmt::format("the axial length is not determined (sigma {:.2f} mm): cornea or fundus is not "
                      "visible, or the head moved",
                      length_sigma));
  // In T1 fat that chemical shift has laid over the wall is brighter than either, and is taken for the wall.
  if (fit.weighting == Weighting::t1) {
    // A wall as bright as what surrounds it has no outer border, and any thickness fits.
    const double thickness = std::min(fit.value(wall_lateral), fit.value(wall_axial));
    const bool fits = fit.regions[static_cast<std::size_t>(Part::wall)].chi2 < 1.5;
    at_least("wall_thickness_t1_mm", thickness, 0.3, !fits,
             fits ? "the globe's wall is as bright as what surrounds it: its thickness is not known"
                  : fmt::format("a wall of {:.1f} mm is no eye's: fat was taken for it", thickness));
    // Retina, choroid and sclera are 0.8 to 1.5 mm.
    const double thickest = std::max(fit.value(wall_lateral), fit.value(wall_axial));
    at_most("thickest_wall_t1_mm", thickest, 2.5, false,
            fmt::format(
                "a wall of {:.1f} mm is no eye's: something as dark behind the globe was taken for it; its "
                "inner border may still be right",
                thickest));
    const double brightness = fit.value(wall) / fit.value(surround);
    at_most("wall_over_surroundings_t1", brightness, 1.2, true,
            fmt::format("the globe's wall is {:.1f} times as bright as the fat around it: fat displaced by "
                        "chemical shift covers it",
                        brightness));
  }
  Eigen::VectorXd apex = Eigen::VectorXd::Zero(fit.layout.size());
  apex.segment<3>(apex_x) = gaze_axis(fit.value(gaze_horizontal), fit.value(gaze_vertical));
  const double apex_sigma = sigma_of(fit, apex);
  at_most("apex_sigma_mm", apex_sigma, 0.5, true,
          fmt::format("the cornea is not visible: its apex is known to {:.2f} mm only", apex_sigma));

  at_most("chi2_per_voxel", fit.chi2_per_voxel, 25, true,
          fmt::format("the images do not look like an eye: residuals are {:.1f} times the noise (motion, "
                      "artefacts, a defaced head?)",
                      std::sqrt(fit.chi2_per_voxel)));
  at_most("slice_displacement_mm", fit.slice_displacement_mm, 0.25, true,
          fmt::format("the slices lie {:.2f} mm (rms) from where one eye has them: the head or the eye moved "
                      "between them",
                      fit.slice_displacement_mm));
  at_most("outlier_share", fit.regions[0].outliers, 0.35, true,
          fmt::format("{:.0f} % of the voxels at the globe's wall contradict the fitted eye",
                      100 * fit.regions[0].outliers));
  at_least("converged", fit.converged ? 1 : 0, 1, false, "the fit was still improving when it stopped");

  // Shapes: the first pair refuses what is no eye, the second flags what is unusual.
  // As it is told: to the interface on the axis, a bulge there included.
  const double length = to_parametric_eye(fit, found.laterality).pole_depth_mm();
  at_least("axial_length_mm_lower", length, 16, true,
           fmt::format("an axial length of {:.1f} mm is no eye's", length));
  at_most("axial_length_mm_upper", length, 38, true,
          fmt::format("an axial length of {:.1f} mm is no eye's", length));
  at_least("keratometry_D_lower", k, 30, true,
           fmt::format("a corneal power of {:.1f} D is no eye's: the cornea was not found", k));
  at_most("keratometry_D_upper", k, 60, true,
          fmt::format("a corneal power of {:.1f} D is no eye's: the cornea was not found", k));
  at_least("axial_length_plausible_mm", length, 20, false,
           fmt::format("axial length {:.2f} mm is below 20 mm", length));
  at_most("axial_length_plausible_upper_mm", length, 32, false,
          fmt::format("axial length {:.2f} mm is above 32 mm", length));
  at_least("keratometry_plausible_D", k, 38, false, fmt::format("corneal power {:.1f} D is below 38 D", k));
  at_most("keratometry_plausible_upper_D", k, 50, false,
          fmt::format("corneal power {:.1f} D is above 50 D", k));
  at_least("anterior_chamber_depth_mm", fit.value(anterior_chamber_depth), 1.8, true,
           fmt::format("an anterior chamber of {:.1f} mm is no eye's", fit.value(anterior_chamber_depth)));
  at_most("corneal_irregularity_chi2", fit.irregularity.chi2, CornealIrregularity::chi2_limit, false,
          fmt::format("irregular cornea (keratoconus, a scar, surgery?): no biconic describes it, score "
                      "{:.0f} (limit {:.0f}); a free form was fitted",
                      fit.irregularity.chi2, CornealIrregularity::chi2_limit));
  double shift = 0;
  for (int s = 1; s < fit.layout.stacks; ++s)
    shift = std::max(shift, fit.parameters.segment<3>(fit.layout.stack(s) + shift_first).norm());
  at_most("head_shift_mm", shift, 6, false,
          fmt::format("the head moved {:.1f} mm between the stacks", shift));
  return gates;
}

bool is_refused(const std::vector<QualityGate>& gates) {
  return std::any_of(gates.begin(), gates.end(),
                     [](const QualityGate& gate) { return gate.decides && !gate.passed; });
}

Json to_json(const QualityGate& gate) {
  return Json{{"name", gate.name},     {"value", gate.value},     {"limit", gate.limit},
              {"passed", gate.passed}, {"decides", gate.decides}, {"reason", gate.reason}};
}

}  // namespace emmetrope::segmentation
