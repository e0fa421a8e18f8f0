#include "segmentation/judgement/quality.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "pipeline/base/even_points.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/parametric/corneal_metrics.hpp"
#include "pipeline/eye/population/limits.hpp"
#include "pipeline/eye/population/population.hpp"
#include "segmentation/finding/blanked_region.hpp"
#include "segmentation/finding/lens_axis.hpp"
#include "segmentation/finding/sampling.hpp"
#include "segmentation/fit/wall_layers.hpp"
#include "segmentation/judgement/clipped_values.hpp"
#include "segmentation/judgement/edge_agreement.hpp"

namespace emmetrope::segmentation {
namespace {

/// Standard deviation of a linear combination of parameters.
double sigma_of(const EyeFit& fit, const Eigen::VectorXd& weights) {
  Eigen::VectorXd active(static_cast<Eigen::Index>(fit.active.size()));
  for (std::size_t i = 0; i < fit.active.size(); ++i)
    active[static_cast<Eigen::Index>(i)] = weights[fit.active[i]];
  return std::sqrt(std::max(0.0, active.dot(fit.covariance * active)));
}

/// The limits of a number, and what its gate is called in fit.json where that differs.
struct GateName {
  GateName(const char* both) : GateName(both, both) {}
  GateName(const char* in_fit_json, const char* in_table) : gate(in_fit_json), quantity(in_table) {}
  const char* gate;
  const char* quantity;
};

/// Numbers judged by the table of limits, in the order of fit.json. Each reason is in the user's words.
class Gates {
 public:
  void refuse_below(const GateName& name, double value, const std::string& reason,
                    Withholds withholds = Withholds::fit) {
    const double limit = limits_of(name.quantity).accepted.low;
    add(name.gate, value, limit, value >= limit, withholds, reason);
  }
  void refuse_above(const GateName& name, double value, const std::string& reason,
                    Withholds withholds = Withholds::fit) {
    const double limit = limits_of(name.quantity).accepted.high;
    add(name.gate, value, limit, value <= limit, withholds, reason);
  }
  void refuse_above(const GateName& name, double value, double limit, const std::string& reason) {
    add(name.gate, value, limit, value <= limit, Withholds::fit, reason);
  }
  void warn_below(const GateName& name, double value, const std::string& reason) {
    const double limit = limits_of(name.quantity).plausible.low;
    add(name.gate, value, limit, value >= limit, Withholds::nothing, reason);
  }
  void warn_above(const GateName& name, double value, const std::string& reason) {
    warn_above(name, value, limits_of(name.quantity).plausible.high, reason);
  }
  void warn_above(const GateName& name, double value, double limit, const std::string& reason) {
    add(name.gate, value, limit, value <= limit, Withholds::nothing, reason);
  }
  void withhold(const char* gate, Withholds withholds, const std::string& reason) {
    add(gate, 1, 0, false, withholds, reason);
  }
  std::vector<QualityGate> take() { return std::move(gates_); }

 private:
  void add(const char* name, double value, double limit, bool passed, Withholds withholds,
           const std::string& reason) {
    QualityGate& gate = gates_.emplace_back();
    gate.name = name;
    gate.value = value;
    gate.limit = limit;
    gate.passed = passed;
    gate.withholds = withholds;
    gate.reason = passed ? "" : reason;
  }

  std::vector<QualityGate> gates_;
};

/// How much of the globe's wall lies inside the stack that shows most of it.
double share_inside_stack(const FoundEye& found) {
  double inside = 0;
  for (const EyeView& view : found.views) inside = std::max(inside, view.globe.inside);
  return inside;
}

/// Share of the globe's wall that was blanked and that no stack shows. Blanked is what is so on both sides of the wall:
/// fluid or fat alone may be dark.
double share_of_wall_blanked(const EyeFit& fit) {
  const std::vector<Eigen::Vector3d> directions = mirrored_directions(500);
  constexpr double inside_mm = 1, outside_mm = 2, looked_at_mm = 6;  // from the wall
  const double radius_mm = (fit.value(globe_x) + fit.value(globe_y)) / 2;
  std::vector<bool> is_blanked(directions.size()), is_seen(directions.size());
  for (std::size_t k = 0; k < fit.stacks.size(); ++k) {
    const Stack& stack = *fit.stacks[k].stack;
    Eigen::Vector3d centre = fit.globe_centre_lps();
    if (k > 0) centre -= fit.head_shift_lps(k);
    const BlankedRegion blanked(stack, centre, radius_mm + looked_at_mm);
    const Sampler sampler(stack);
    for (std::size_t i = 0; i < directions.size(); ++i) {
      const Eigen::Vector3d& direction = directions[i];
      const bool was_blanked = blanked.holds(sampler, centre + (radius_mm - inside_mm) * direction) &&
                               blanked.holds(sampler, centre + (radius_mm + outside_mm) * direction);
      is_blanked[i] = is_blanked[i] || was_blanked;
      is_seen[i] =
          is_seen[i] || (!was_blanked && sampler.interpolate(centre + radius_mm * direction).has_value());
    }
  }
  int lost = 0;
  for (std::size_t i = 0; i < directions.size(); ++i) lost += is_blanked[i] && !is_seen[i] ? 1 : 0;
  return lost / static_cast<double>(directions.size());
}

/// Of the fit's reference: vitreous in T2, what surrounds the globe in T1. Against both fluids: what is no
/// lens may differ from one of them.
double lens_contrast(const EyeFit& fit) {
  const auto [darker, brighter] = std::minmax({fit.value(vitreous), fit.value(aqueous)});
  return fit.weighting == Weighting::t2 ? darker - fit.value(lens) : fit.value(lens) - brighter;
}

/// Standard deviation of the apex along the eye's axis.
double apex_sigma_mm(const EyeFit& fit) {
  Eigen::VectorXd along_axis = Eigen::VectorXd::Zero(fit.layout.size());
  along_axis.segment<3>(apex_x) = gaze_axis(fit.value(gaze_horizontal), fit.value(gaze_vertical));
  return sigma_of(fit, along_axis);
}

double largest_head_shift_mm(const EyeFit& fit) {
  double shift = 0;
  for (std::size_t s = 1; s < fit.stacks.size(); ++s) shift = std::max(shift, fit.head_shift_lps(s).norm());
  return shift;
}

/// How much of what was not known of the corneal power is still not known: 1 is nothing from the images.
double cornea_sigma_over_prior(const EyeFit& fit) { return fit.sigma(cornea_c) / fit.priors.sigma[cornea_c]; }

/// No eye is so much wider than it is deep; heads that were made to fit an atlas are.
void judge_shape(const EyeFit& fit, Gates& gates) {
  const double width_mm = 2 * std::max(fit.value(globe_x), fit.value(globe_y)),
               depth_mm = 2 * fit.value(globe_z);
  gates.refuse_above(
      "globe_flattening_mm", width_mm - depth_mm,
      fmt::format("a globe {:.1f} mm across and {:.1f} mm deep is no eye's: was the head stretched to "
                  "fit an atlas?",
                  width_mm, depth_mm));
}

/// A gap between slices that was left out of their spacing, or a head that was stretched, makes an eye of another form.
void judge_aspect(const EyeFit& fit, Gates& gates) {
  const double width_mm = 2 * fit.value(globe_x), height_mm = 2 * fit.value(globe_y);
  Eigen::VectorXd difference = Eigen::VectorXd::Zero(fit.layout.size());
  difference[globe_x] = 2;
  difference[globe_y] = -2;
  gates.warn_above(
      "globe_aspect_mm", std::max(0.0, std::abs(width_mm - height_mm) - 2 * sigma_of(fit, difference)),
      fmt::format(
          "the globe is {:.1f} mm wide and {:.1f} mm high, further apart than an eye's usually are: are "
          "the voxel sizes right (a gap between slices left out, a head stretched)?",
          width_mm, height_mm));
}

/// Where a face was taken off between cornea and lens the cut looks like a cornea.
void judge_before_cornea(const EyeFit& fit, Gates& gates) {
  constexpr double globe_radius_mm = 12, reach_mm = 16;
  const Eigen::Vector3d apex = fit.parameters.segment<3>(apex_x),
                        axis = gaze_axis(fit.value(gaze_horizontal), fit.value(gaze_vertical));
  std::optional<double> least;  // of the stacks that show the place
  for (std::size_t k = 0; k < fit.stacks.size(); ++k) {
    const Stack& stack = *fit.stacks[k].stack;
    Eigen::Vector3d in_stack = apex;
    if (k > 0) in_stack -= fit.head_shift_lps(k);
    const auto share = BlankedRegion(stack, in_stack - globe_radius_mm * axis, reach_mm)
                           .share_cut_before(stack, in_stack, axis);
    if (share) least = std::min(least.value_or(1), *share);
  }
  const double blanked = least.value_or(0);
  gates.refuse_above(
      "blanked_before_cornea", blanked,
      fmt::format("{:.0f} % of what lies right before the cornea was blanked in the images (a defaced head): "
                  "what looks like the cornea may be the cut",
                  100 * blanked),
      Withholds::front);
}

void judge_globe(const FoundEye& found, Gates& gates) {
  const double inside = share_inside_stack(found);
  gates.refuse_below(
      "globe_inside_stack", inside,
      fmt::format("the eye is cut off or slices through it are missing: {:.0f} % of its wall lies inside the "
                  "images",
                  100 * inside));
}

/// Faces are taken off from before, from below, along any mask. A fit that took blanked voxels for tissue has its globe
/// beside them: then the finder tells.
void judge_blanking(const FoundEye& found, const EyeFit& fit, Gates& gates) {
  double found_blanked = 1;
  for (const EyeView& view : found.views) found_blanked = std::min(found_blanked, view.globe.blanked);
  const double blanked = std::max(found_blanked, share_of_wall_blanked(fit));
  gates.refuse_above(
      "wall_blanked", blanked,
      fmt::format("{:.0f} % of the eye's wall was blanked in the images (a defaced head): what is left does "
                  "not tell its shape",
                  100 * blanked));
}

/// Half the height of an edge is not known where one of its sides was cut off.
void judge_vitreous_clipping(const ClippedShare& clipped, Gates& gates) {
  gates.refuse_above(
      "clipped_vitreous", clipped.share,
      fmt::format("grey values are clipped at {:g}, which {:.0f} % of the vitreous has (a windowed "
                  "export?): the globe's edges are not where they seem",
                  clipped.value, 100 * clipped.share));
}

void judge_clipping(const ClippedValues& clipped, Gates& gates) {
  gates.warn_above(
      "clipped_about_eye", clipped.about_eye.share,
      fmt::format("grey values are clipped at {:g}, which {:.0f} % of the voxels about the eye have "
                  "(a windowed export?)",
                  clipped.about_eye.value, 100 * clipped.about_eye.share));
  judge_vitreous_clipping(clipped.vitreous, gates);
}

/// Against where the header has the face.
void judge_gaze(const EyeFit& fit, Gates& gates) {
  const double deg = from_ahead_deg(gaze_axis(fit.value(gaze_horizontal), fit.value(gaze_vertical)));
  gates.refuse_above(
      "gaze_from_ahead_deg", deg,
      fmt::format(
          "by (0020,0037) ImageOrientationPatient (a NIfTI's sform or qform) the eye looks {:.0f} "
          "degrees away from straight ahead: its lens was misread, the header is wrong, or the head lay far off",
          deg));
}

/// Something that is no vitreous, in words, and what it may be.
std::string described(const IntraocularMass& mass, Weighting weighting) {
  return fmt::format("{:.0f} mm3 of the globe, 2 mm from its wall or more, are {} than the vitreous ({})",
                     mass.volume_mm3, weighting == Weighting::t1 ? "brighter" : "darker",
                     weighting == Weighting::t1 ? "a tumour, blood, a detached retina?"
                                                : "a tumour, blood, a detached retina, gas, metal?");
}

void judge_vitreous(const EyeFit& fit, Gates& gates) {
  const std::string mass = described(fit.mass, fit.weighting);
  gates.warn_above(
      {"intraocular_mass_seen_mm3", "intraocular_mass_mm3"}, fit.mass.volume_mm3,
      mass + ": they and what is near them were left out of the fit, and the retina there may lie elsewhere");
  gates.refuse_above("intraocular_mass_mm3", fit.mass.volume_mm3,
                     mass + ": the wall is not known behind so much");
  gates.refuse_above("unexplained_in_vitreous_mm3", fit.unexplained.volume_mm3,
                     described(fit.unexplained, fit.weighting) + ", or the fitted globe is not the eye's");
  if (fit.weighting != Weighting::t2 || fit.evidence == Evidence::labels) return;
  const double around = fit.value(surround) / fit.value(vitreous);
  gates.refuse_above(
      "surroundings_over_vitreous_t2", around,
      fmt::format(
          "what surrounds the globe is {:.1f} times as bright as the vitreous: these images are not T2-weighted, or "
          "the globe is not filled with water (silicone oil, blood?)",
          around));
}

void judge_lens(const EyeFit& fit, const ClippedShare& clipped, Gates& gates) {
  gates.refuse_above(
      "clipped_lens", clipped.share,
      fmt::format("grey values are clipped at {:g}, which {:.0f} % of the lens has (a windowed "
                  "export?): it looks thicker, and the chamber shallower, than they are",
                  clipped.value, 100 * clipped.share),
      Withholds::front);
  gates.refuse_below("lens_contrast", lens_contrast(fit),
                     "the lens is not visible: nothing between aqueous and vitreous differs from both");
  const double off_axis_mm = std::hypot(fit.value(lens_decentre_x), fit.value(lens_decentre_y));
  gates.refuse_above(
      "lens_off_axis_mm", off_axis_mm,
      fmt::format("the lens was not found: the fitted one lies {:.1f} mm beside the eye's axis",
                  off_axis_mm));
  const double thickness_mm = fit.value(lens_thickness);
  gates.refuse_below(
      "natural_lens_mm", thickness_mm,
      fmt::format("a lens {:.1f} mm thick is no natural one (was it replaced?): what it is and does to "
                  "light is not known",
                  thickness_mm),
      Withholds::front);
}

void judge_cornea_and_length(const EyeFit& fit, Gates& gates) {
  // As dark as the wall: 1; as bright as the fluid: 0.
  if (fit.weighting == Weighting::t2)
    gates.refuse_below("cornea_contrast_t2",
                       (fit.value(aqueous) - fit.value(cornea)) / (fit.value(aqueous) - fit.value(wall)),
                       "the cornea was not found: what was taken for it is as bright as the fluid behind it",
                       Withholds::front);
  const bool t1 = fit.weighting == Weighting::t1;
  const double fluids_apart =
      std::abs(fit.value(aqueous) - fit.value(vitreous)) / (t1 ? 1 : std::abs(fit.value(vitreous)));
  gates.refuse_above(
      t1 ? "fluid_difference_t1" : "fluid_difference_t2", fluids_apart,
      fmt::format(
          "the cornea was not found: what was taken for the aqueous differs from the vitreous by {:.0f} % "
          "of {}, and both are water (a lid? oil or blood in the vitreous?)",
          100 * fluids_apart, t1 ? "what surrounds the globe" : "its brightness"),
      Withholds::front);
  if (t1)
    gates.refuse_below(
        "iris_over_aqueous_t1", fit.value(iris) - fit.value(aqueous),
        "the cornea was not found: what was taken for the iris is darker than the water around it",
        Withholds::front);
  if (fit.evidence == Evidence::labels) {
    const double pixel_mm = finest_pixel_mm(fit.stacks);
    gates.refuse_above(
        "label_pixel_mm", pixel_mm,
        fmt::format("labels in pixels of {:.2f} mm do not tell a cornea's curvature: it is thinner",
                    pixel_mm),
        Withholds::cornea);
  }
  if (!t1) {
    const double soft_as_mm = resolved_mm(fit);
    gates.refuse_above(
        "resolved_t2_mm", soft_as_mm,
        fmt::format("edges as soft as those of pixels of {:.1f} mm (filtered by the scanner?) do not tell a "
                    "cornea's curvature: it is thinner",
                    soft_as_mm),
        Withholds::cornea);
  }
  const double power_sigma_D = keratometric_D_mm * fit.sigma(cornea_c);
  const double prior_sigma_D = keratometric_D_mm * fit.priors.sigma[cornea_c];
  gates.refuse_above(
      "cornea_sigma_over_prior", cornea_sigma_over_prior(fit),
      fmt::format("the cornea's shape is not visible: the images say next to nothing about its "
                  "curvature (sigma {:.2f} D, prior {:.2f} D)",
                  power_sigma_D, prior_sigma_D),
      Withholds::cornea);
  const double length_sigma_mm = fit.pole_depth_sigma_mm();
  gates.refuse_above("axial_length_sigma_mm", length_sigma_mm,
                     fmt::format("the axial length is not determined (sigma {:.2f} mm): cornea or fundus is "
                                 "not visible, or the head moved",
                                 length_sigma_mm));
}

void judge_slices_in_t1(const EyeFit& fit, Gates& gates) {
  double thinnest_mm = std::numeric_limits<double>::infinity();
  // Slices, whichever way they are stored, lie along the longest side of a voxel.
  for (const ObservedStack& stack : fit.stacks)
    thinnest_mm =
        std::min(thinnest_mm, std::max({stack.stack->slice_spacing_mm(), stack.stack->row_spacing_mm,
                                        stack.stack->column_spacing_mm}));
  gates.refuse_above(
      "slice_spacing_t1_mm", thinnest_mm,
      fmt::format("in T1 slices of {:.1f} mm the wall and the fat around it are one edge", thinnest_mm));
}

/// In T1 fat that chemical shift has laid over the wall is brighter than either, and is taken for the wall.
/// \param confirmed  by edges: then a wall that is no eye's tells nothing of its inner surface
void judge_wall_in_t1(const EyeFit& fit, Gates& gates, bool confirmed) {
  const Withholds if_failed = confirmed ? Withholds::nothing : Withholds::fit;
  constexpr double explained_chi2 = 1.5;
  const double thinnest_mm = std::min(fit.value(wall_lateral), fit.value(wall_axial));
  if (fit.regions[static_cast<std::size_t>(Part::wall)].chi2 < explained_chi2)
    gates.warn_below("wall_thickness_t1_mm", thinnest_mm,
                     "the globe's wall is as bright as what surrounds it: its thickness is not known");
  else
    gates.refuse_below(
        "wall_thickness_t1_mm", thinnest_mm,
        confirmed ? "only the bright inner layer of the globe's wall is seen: its thickness is not known"
                  : fmt::format("a wall of {:.1f} mm is no eye's: fat was taken for it", thinnest_mm),
        if_failed);
  const double thickest_mm = std::max(fit.value(wall_lateral), fit.value(wall_axial));
  gates.warn_above(
      "thickest_wall_t1_mm", thickest_mm,
      fmt::format("a wall of {:.1f} mm is no eye's: something as dark behind the globe was taken for it; its "
                  "inner border may still be right",
                  thickest_mm));
  if (fat_is_dark(fit.stacks)) return;  // what is dark covers nothing
  const double brightness = fit.value(wall) / fit.value(surround);
  gates.refuse_above("wall_over_surroundings_t1", brightness,
                     fmt::format("the globe's wall is {:.1f} times as bright as the fat around it: fat "
                                 "displaced by chemical shift covers it",
                                 brightness),
                     if_failed);
}

/// Edges that are the fat's lead a fit there, too, where the header does not tell how far it is displaced.
void judge_displaced_fat(const EyeFit& fit, Gates& gates) {
  std::optional<EdgeReading> worst;
  for (std::size_t k = 0; k < fit.stacks.size(); ++k) {
    const EdgeSeed seed{fit.globe_centre_lps() - fit.head_shift_lps(k),
                        gaze_axis(fit.value(gaze_horizontal), fit.value(gaze_vertical))};
    const auto reading = read_edges(*fit.stacks[k].stack, seed, fit.weighting);
    if (reading && (!worst || reading->rays_over_void > worst->rays_over_void)) worst = reading;
  }
  if (worst) gates.refuse_above("rays_over_void_t1", worst->rays_over_void, doubt_about_fat(*worst));
}

void judge_edges(const EdgeAgreement& agreement, Gates& gates) {
  gates.refuse_above("edge_disagreement", agreement.sigmas_beyond_wall,
                     fmt::format("the fit and the edges in the image disagree: {}", agreement.largest));
  if (!limits_of("edge_disagreement").plausible.contains(agreement.sigmas_beyond_wall)) return;  // said once
  gates.refuse_above(
      "edge_difference", agreement.sigmas,
      fmt::format("the fit and the edges in the image differ by {:.1f} standard deviations, more than "
                  "a wall and displaced fat make",
                  agreement.sigmas));
}

void judge_apex(const EyeFit& fit, Gates& gates) {
  const double sigma_mm = apex_sigma_mm(fit);
  gates.refuse_above("apex_sigma_mm", sigma_mm,
                     fmt::format("the cornea is not visible: its apex is known to {:.2f} mm only", sigma_mm),
                     Withholds::fit);
}

/// Root mean square of what neither model nor noise explain, over the step between vitreous and wall: of a clean image
/// the noise is so low that every model leaves many times as much.
double unexplained_over_contrast(const EyeFit& fit) {
  double noise = 0;
  for (const ObservedStack& stack : fit.stacks) noise = std::max(noise, stack.sampling.noise);
  const double step = std::max(std::abs(fit.value(wall) - fit.value(vitreous)),
                               std::abs(fit.inner_wall() - fit.value(vitreous)));
  return std::sqrt(std::max(0.0, fit.chi2_per_voxel - 1)) * noise / step;
}

/// \param confirmed  by edges
void judge_residuals(const EyeFit& fit, Gates& gates, bool confirmed) {
  const double share = unexplained_over_contrast(fit);
  const auto limit_of = [&](const char* quantity) {
    const Limits limits = limits_of(quantity);
    return confirmed ? limits.accepted.high : limits.plausible.high;
  };
  gates.refuse_above("residual_over_contrast", share, limit_of("residual_over_contrast"),
                     fmt::format("the images do not look like an eye: what the model leaves is {:.0f} % of "
                                 "the step at the globe's wall (motion, artefacts, a defaced head?)",
                                 100 * share));
  gates.refuse_above(
      "chi2_per_voxel", fit.chi2_per_voxel,
      fmt::format("the images do not look like an eye: residuals are {:.1f} times the noise (motion, "
                  "artefacts, a defaced head?)",
                  std::sqrt(fit.chi2_per_voxel)),
      confirmed ? Withholds::nothing : Withholds::fit);
  gates.refuse_above(
      "slice_displacement_mm", fit.slice_displacement_mm, limit_of("slice_displacement_mm"),
      fmt::format("the slices lie {:.2f} mm (rms) from where one eye has them: the head or the eye moved "
                  "between them",
                  fit.slice_displacement_mm));
  const double outlier_share = fit.regions[0].outliers;
  gates.refuse_above("outlier_share", outlier_share,
                     fmt::format("{:.0f} % of the voxels at the globe's wall contradict the fitted eye",
                                 100 * outlier_share));
  gates.warn_below("converged", fit.converged ? 1 : 0, "the fit was still improving when it stopped");
}

/// Whether edges tell about the same chamber.
bool edges_confirm_chamber(const EyeFit& fit, const std::optional<ReadEye>& edges) {
  if (!edges || !edges->biometry.anterior_chamber_depth) return false;
  const Estimate& chamber = *edges->biometry.anterior_chamber_depth;
  const double sigmas = std::abs(chamber.value - fit.value(anterior_chamber_depth)) /
                        std::hypot(chamber.sigma, fit.sigma(anterior_chamber_depth));
  return limits_of("edge_disagreement").plausible.contains(sigmas);
}

/// As they are told: of the cornea with its free form, beyond what its mean power shows.
void judge_meridians(const ParametricEye& eye, Gates& gates) {
  const CornealPower power = corneal_power(anterior_cornea(eye));
  const double half_cylinder_D = std::hypot(power.J0_D, power.J45_D);
  const double flat_D = power.M_D - half_cylinder_D, steep_D = power.M_D + half_cylinder_D;
  const auto no_meridian = [](const char* meridian, double power_D) {
    return fmt::format("a cornea of {:.1f} D in its {} meridian is no eye's: its shape was not found",
                       power_D, meridian);
  };
  gates.refuse_below({"keratometry_flat_D", "keratometry/flat/power_D"}, flat_D, no_meridian("flat", flat_D),
                     Withholds::cornea);
  gates.refuse_above({"keratometry_steep_D", "keratometry/steep/power_D"}, steep_D,
                     no_meridian("steep", steep_D), Withholds::cornea);
}

void judge_dimensions(const FoundEye& found, const EyeFit& fit, const std::optional<ReadEye>& edges,
                      Gates& gates) {
  const char *length = "axial_length_mm", *power = "astigmatism/M_D";
  const Range plausible_mm = limits_of(length).plausible, plausible_D = limits_of(power).plausible;
  // As it is told: to the interface on the axis, a bulge there included.
  const ParametricEye eye = to_parametric_eye(fit, found.laterality);
  const double length_mm = eye.pole_depth_mm();
  const double power_D = keratometric_D_mm * fit.value(cornea_c);
  const std::string no_length = fmt::format("an axial length of {:.1f} mm is no eye's", length_mm);
  gates.refuse_below({"axial_length_mm_lower", length}, length_mm, no_length);
  gates.refuse_above({"axial_length_mm_upper", length}, length_mm, no_length);
  const std::string no_power =
      fmt::format("a corneal power of {:.1f} D is no eye's: the cornea was not found", power_D);
  gates.refuse_below({"keratometry_D_lower", power}, power_D, no_power);
  gates.refuse_above({"keratometry_D_upper", power}, power_D, no_power);
  gates.warn_below({"axial_length_plausible_mm", length}, length_mm,
                   fmt::format("axial length {:.2f} mm is below {:g} mm", length_mm, plausible_mm.low));
  gates.warn_above({"axial_length_plausible_upper_mm", length}, length_mm,
                   fmt::format("axial length {:.2f} mm is above {:g} mm", length_mm, plausible_mm.high));
  gates.warn_below({"keratometry_plausible_D", power}, power_D,
                   fmt::format("corneal power {:.1f} D is below {:g} D", power_D, plausible_D.low));
  gates.warn_above({"keratometry_plausible_upper_D", power}, power_D,
                   fmt::format("corneal power {:.1f} D is above {:g} D", power_D, plausible_D.high));
  judge_meridians(eye, gates);
  const double chamber_mm = fit.value(anterior_chamber_depth);
  gates.refuse_below("anterior_chamber_depth_mm", chamber_mm,
                     fmt::format("an anterior chamber of {:.1f} mm is no eye's", chamber_mm));
  constexpr double hardly_seen = 0.8;  // sigma over prior; chosen: T1 of whole heads has 0.7 to 1
  const bool is_seen = limits_of("cornea_sigma_over_prior").accepted.contains(cornea_sigma_over_prior(fit));
  if (cornea_sigma_over_prior(fit) > hardly_seen && !(is_seen && edges_confirm_chamber(fit, edges)))
    gates.refuse_below(
        "chamber_of_unseen_cornea_mm", chamber_mm,
        fmt::format(
            "the cornea was not found: a chamber of {:.1f} mm behind a cornea whose shape is hardly visible",
            chamber_mm),
        Withholds::front);
}

void judge_corneal_form(const EyeFit& fit, Gates& gates) {
  constexpr double limit = CornealIrregularity::chi2_limit;
  const char* reason =
      fit.layout.irregular_cornea
          ? "irregular cornea (keratoconus, a scar, surgery?): no biconic describes it, "
            "score {:.0f} (limit {:.0f}); a free form was fitted"
      : finest_pixel_mm(fit.stacks) > CornealIrregularity::coarsest_pixel_mm
          ? "no regular cornea describes what is at its place, score {:.0f} (limit {:.0f}), and "
            "the voxels are too coarse to tell an irregular one from a lid or an artefact"
          : "no regular cornea describes what is at its place, score {:.0f} (limit {:.0f}), but slices lie beside "
            "their places, which looks like an irregular one";
  gates.warn_above("corneal_irregularity_chi2", fit.irregularity.chi2, limit,
                   fmt::format(fmt::runtime(reason), fit.irregularity.chi2, limit));
}

void judge_head_motion(const EyeFit& fit, Gates& gates) {
  const double shift_mm = largest_head_shift_mm(fit);
  gates.warn_above("head_shift_mm", shift_mm,
                   fmt::format("the head moved {:.1f} mm between the stacks", shift_mm));
}

}  // namespace

const char* to_string(Withholds withholds) {
  switch (withholds) {
    case Withholds::nothing:
      return "nothing";
    case Withholds::cornea:
      return "cornea";
    case Withholds::front:
      return "front";
    case Withholds::fit:
      return "fit";
  }
  return "fit";
}

std::vector<QualityGate> judge_quality(const FoundEye& found, const EyeFit& fit,
                                       const std::optional<ReadEye>& edges) {
  Gates gates;
  bool confirmed = false;
  if (edges) {
    const EdgeAgreement agreement = compare_with_edges(fit, *edges);
    judge_edges(agreement, gates);
    confirmed = agreement.confirms();
  }
  judge_globe(found, gates);
  judge_blanking(found, fit, gates);
  const ClippedValues clipped = clipped_values(fit);
  judge_clipping(clipped, gates);
  judge_gaze(fit, gates);
  judge_vitreous(fit, gates);
  if (fit.front_is_blanked()) {
    gates.withhold("front_is_blanked", Withholds::front,
                   "the front of the eye was blanked in the images (a defaced head): no cornea, no lens, no "
                   "length");
  } else {
    judge_before_cornea(fit, gates);
    judge_lens(fit, clipped.lens, gates);
    judge_cornea_and_length(fit, gates);
  }
  if (fit.weighting == Weighting::t1) {
    judge_slices_in_t1(fit, gates);
    judge_wall_in_t1(fit, gates, confirmed);
    if (!edges) judge_displaced_fat(fit, gates);
  }
  if (!fit.front_is_blanked()) judge_apex(fit, gates);
  judge_residuals(fit, gates, confirmed);
  judge_aspect(fit, gates);
  if (!fit.front_is_blanked()) {
    judge_shape(fit, gates);  // of a blanked head the depth is not known
    judge_dimensions(found, fit, edges, gates);
    judge_corneal_form(fit, gates);
  }
  judge_head_motion(fit, gates);
  return gates.take();
}

std::vector<QualityGate> judge_without_fit(const std::string& reason, const std::vector<const Stack*>& stacks,
                                           const std::vector<Eigen::Vector3d>& globe_centres_lps) {
  Gates gates;
  gates.withhold("fit", Withholds::fit, reason);
  ClippedShare clipped;
  for (std::size_t i = 0; i < stacks.size(); ++i)
    if (const ClippedShare here = clipped_vitreous(*stacks[i], globe_centres_lps[i]);
        here.share > clipped.share)
      clipped = here;
  judge_vitreous_clipping(clipped, gates);
  return gates.take();
}

QualityGate judge_labels(const EyeFit& drawn, const FoundEye& seen, const std::optional<ReadEye>& edges) {
  Gates gates;
  constexpr const char* cause = "(labels of another study, or moved?)";
  if (edges) {
    // A warning, unlike a refusal, is due where their 95 % intervals leave off.
    const LabelsBesideEdges beside = compare_labels_with_edges(drawn, *edges);
    gates.warn_above(
        "labels_by_edges", beside.over_ci95, 1,
        fmt::format("the labels and the edges in the image disagree: {} {}", beside.largest, cause));
  } else {
    constexpr double as_well_as_seen_mm = 3;  // chosen: the finder errs by one
    const double apart_mm = (drawn.globe_centre_lps() - seen.views.front().globe.centre).norm();
    gates.warn_above(
        "labels_off_mm", apart_mm, as_well_as_seen_mm,
        fmt::format("the labels lie {:.1f} mm from the eye that the image shows {}", apart_mm, cause));
  }
  return gates.take().front();
}

bool is_withheld(const std::vector<QualityGate>& gates, Withholds what) {
  return std::any_of(gates.begin(), gates.end(),
                     [&](const QualityGate& gate) { return gate.withholds == what && !gate.passed; });
}

std::string reasons_for(const std::vector<QualityGate>& gates, Withholds what) {
  std::string text;
  for (const QualityGate& gate : gates)
    if (gate.withholds == what && !gate.passed) text += (text.empty() ? "" : "; ") + gate.reason;
  return text;
}

Json to_json(const QualityGate& gate) {
  return Json{{"name", gate.name},
              {"value", gate.value},
              {"limit", gate.limit},
              {"passed", gate.passed},
              {"withholds", to_string(gate.withholds)},
              {"reason", gate.reason}};
}

}  // namespace emmetrope::segmentation
