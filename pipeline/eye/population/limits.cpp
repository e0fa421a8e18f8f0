#include "pipeline/eye/population/limits.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <iterator>
#include <string_view>

#include "pipeline/base/error.hpp"

namespace emmetrope {
namespace {

Range at_least(double low) {
  Range range;
  range.low = low;
  return range;
}
Range at_most(double high) {
  Range range;
  range.high = high;
  return range;
}

/// A row as it is written below.
class Row {
 public:
  Row(const char* quantity, const char* unit) {
    limits_.quantity = quantity;
    limits_.unit = unit;
  }
  Row& refuse_outside(Range range) { return limits_.accepted = range, *this; }
  Row& warn_outside(Range range) { return limits_.plausible = range, *this; }
  Row& normal(Range range, const char* reference) {
    limits_.normal = range;
    limits_.normal_reference = reference;
    return *this;
  }
  operator Limits() const { return limits_; }

 private:
  Limits limits_;
};

// Normal ranges are mean -+ 2 standard deviations of the source: axial length 23.45 (1.51) mm, chamber depth
// 3.11 (0.43) mm and corneal radius 7.69 (0.28) mm of 23 239 eyes; corneal thickness 0.534 (0.040) mm of 28
// 709 eyes; asphericity -0.28 (0.18) of 1683 eyes. Lens thickness is 2.93 mm + 0.0236 mm a year from 18 to 80
// years, -+ 0.4 mm. The lens's radii are 12.9 - 0.057 age and 6.2 - 0.012 age (mm; Navarro 2014 has 12.7 -
// 0.058 age and 5.9 - 0.013 age). Distances of the eyes are the range of the vast majority of adults.
constexpr const char *hoffmann = "Hoffmann and Huetz 2010", *cataract_patients = "BMC Ophthalmology 2021;21",
                     *handan = "Handan Eye Study", *lens_thickness = "Dubbelman et al. 2001",
                     *lens_radii = "Dubbelman and van der Heijde 2001", *dodgson = "Dodgson 2004",
                     *staphyloma = "BMC Ophthalmology 2024;24";
constexpr Range accepted_corneal_power_D{30, 60}, plausible_corneal_power_D{38, 50},
    normal_corneal_power_D{40.91, 47.34};

std::vector<Limits> biometry() {
  return {
      Row("axial_length_mm", "mm").refuse_outside({16, 38}).warn_outside({20, 32}),
      Row("optical_axial_length_mm", "mm").normal({20.43, 26.47}, hoffmann),
      Row("corneal_thickness_mm", "mm").warn_outside({0.4, 0.7}).normal({0.45, 0.61}, cataract_patients),
      Row("anterior_chamber_depth_mm", "mm")
          .refuse_outside(at_least(1.8))
          .warn_outside({2, 5})
          .normal({2.25, 3.97}, hoffmann),
      Row("lens_thickness_mm", "mm").warn_outside({2.8, 6}).normal({2.95, 5.2}, lens_thickness),
      Row("lens_anterior_radius_mm", "mm").warn_outside({5, 17}).normal({7.5, 13.2}, lens_radii),
      Row("lens_posterior_radius_mm", "mm").warn_outside({3.5, 9}).normal({4.9, 7.0}, lens_radii),
      Row("globe_width_mm", "mm").warn_outside({19, 30}),
      Row("globe_height_mm", "mm").warn_outside({19, 30}),
      Row("globe_depth_mm", "mm").warn_outside({17, 34}),
      // 202 eyes without a staphyloma had at most 37.5, 54 with one at least 42.7.
      Row("retina/staphyloma_index", "").normal(at_most(40), staphyloma),
      Row("interpupillary_distance_mm", "mm").warn_outside({45, 80}).normal({50, 75}, dodgson),
      // Beyond this astigmatic axes, which are given against the scanner, are not the patient's own.
      Row("head_roll_deg", "deg").warn_outside({-3, 3}),
      Row("astigmatism/M_D", "D")
          .refuse_outside(accepted_corneal_power_D)
          .warn_outside(plausible_corneal_power_D)
          .normal(normal_corneal_power_D, hoffmann),
      Row("keratometry/flat/power_D", "D")
          .refuse_outside(accepted_corneal_power_D)
          .warn_outside(plausible_corneal_power_D)
          .normal(normal_corneal_power_D, hoffmann),
      Row("keratometry/steep/power_D", "D")
          .refuse_outside(accepted_corneal_power_D)
          .warn_outside(plausible_corneal_power_D)
          .normal(normal_corneal_power_D, hoffmann),
      Row("keratometry/cylinder_D", "D").warn_outside({0, 6}),
      Row("keratometry/asphericity_q", "").warn_outside({-1, 0.6}).normal({-0.64, 0.08}, handan),
  };
}

/// Half widths of the 95 % intervals of a refraction's M, and of its J0 and J45.
std::vector<Limits> refraction() {
  return {
      // An interval of 6 D reaches from an eye that needs no lens to a highly myopic one (-6 D, International
      // Myopia Institute 2019): it does not even tell the class of the ametropia. With a lens that is 1 D off
      // its wearer may see worse than with the one that is worn.
      Row("M_half_width_D", "D")
          .refuse_outside(at_most(3))
          .warn_outside(at_most(1))
          .normal(at_most(0.5), "Goss and Grosvenor 1996"),
      // Beyond this a cylinder of 1 D may not be there.
      Row("J_half_width_D", "D").warn_outside(at_most(0.5)),
  };
}

/// Numbers of fit.json's "quality".
std::vector<Limits> fit_quality() {
  return {
      Row("globe_inside_stack", "").refuse_outside(at_least(0.85)),
      // Of heads blanked on purpose heights differed by up to 1.9 mm from the whole heads' above 0.38, by 1.1 at 0.33.
      Row("wall_blanked", "").refuse_outside(at_most(0.30)),
      // Of 39 eyes of real scans up to 0.17; of six eyes cut between cornea and lens 0.94 and more.
      Row("blanked_before_cornea", "").refuse_outside(at_most(0.6)),
      // Adults have 3.11 +- 0.43 (23 239 eyes), real scans by edges 2.9 to 4.4; edges on lids 4.8 to 5.4.
      Row("edge_chamber_mm", "mm").refuse_outside(at_most(4.6)),
      // Shares of voxels that have the highest value of the image; in lens and vitreous the lowest, too. Of 39 eyes of
      // real scans two have the highest about them, of an image that was clipped (0.025); lenses have up to 0.02 of
      // either, a vitreous 0.01, 0.08 where dark values were set to 0. Of a T1 head saved with ever lower ceilings
      // chamber and lens moved by 0.1 and 0.2 mm with 0.32 of the lens clipped, chambers by 0.3 and 0.4 mm
      // with 0.48, by 0.7 and 1.0 mm with 0.74. Of a T2 head whose vitreous was clipped whole, edges had globes 0.3 to
      // 1.1 mm too large.
      Row("clipped_about_eye", "").warn_outside(at_most(0.01)),
      Row("clipped_lens", "").refuse_outside(at_most(0.4)),
      Row("clipped_vitreous", "").refuse_outside(at_most(0.5)),
      // 0 where there is none. The wall behind a mass that fills a fifth of a globe is not known (chosen).
      Row("intraocular_mass_mm3", "mm3").warn_outside(at_most(0)).refuse_outside(at_most(1000)),
      Row("unexplained_in_vitreous_mm3", "mm3").refuse_outside(at_most(0)),
      Row("lens_contrast", "").refuse_outside(at_least(0.10)),
      Row("lens_off_axis_mm", "mm").refuse_outside(at_most(2)),
      // Natural lenses are thicker (lens_thickness_mm); fits to implants of 0.75 and 1.07 mm in T2 told 2.0 and 2.63.
      Row("natural_lens_mm", "mm").refuse_outside(at_least(2.8)),
      // Phantoms in T2 have 0.88 to 0.93, a cornea that was missed 0.03.
      Row("cornea_contrast_t2", "").refuse_outside(at_least(0.5)),
      // Of the surroundings' brightness. Fits of real T1 heads have up to 0.10 (0.04 rms), of phantoms 0.03; both eyes of one
      // head whose corneas reached into the lids 0.17 and 0.20.
      Row("fluid_difference_t1", "").refuse_outside(at_most(0.15)),
      // Of the surroundings' brightness. Fits of real T1 heads have 0.2 and more (2-D of 5 mm: 0), of 308 phantom eyes 0.24
      // and more but for two that were wrong, -0.08 and -0.23.
      Row("iris_over_aqueous_t1", "").refuse_outside(at_least(0)),
      // Of the vitreous' brightness. Right fits in T2, two real eyes and phantoms, have up to 0.06, with silicone oil 1.4.
      Row("fluid_difference_t2", "").refuse_outside(at_most(0.3)),
      // Right fits in T2 have 0.3 to 0.5; T1 of eyes filled with silicone oil, taken for T2 as the wall is darker, 1.4.
      Row("surroundings_over_vitreous_t2", "").refuse_outside(at_most(1)),
      Row("cornea_sigma_over_prior", "").refuse_outside(at_most(0.95)),
      // A tissue's label is of its voxel's middle. In eight phantom eyes of 0.8 mm, labelled by this program itself,
      // corneas fitted to the labels were 2 D too steep in the mean; of 0.31 mm they are right.
      Row("label_pixel_mm", "mm").refuse_outside(at_most(0.6001)),
      // Pixel over sharpness in T2. Behind a Hann window (1.0 to 1.2 mm) corneas of 42 phantom eyes were 1.7 D too steep in
      // the mean, up to 3.8 D, within 0.8; without one (0.6 to 0.9) right to 0.9 D (rms).
      Row("resolved_t2_mm", "mm").refuse_outside(at_most(0.9)),
      // Where that is above 0.8, and edges do not tell the same chamber, or above its limit: in T1 of slices of 2 mm both
      // eyes of a real head had 2.1 mm, half of what its whole images show, as the iris was taken for the cornea; in one of
      // 1 mm one eye had 2.0 mm, its fellow 4.1.
      Row("chamber_of_unseen_cornea_mm", "mm").refuse_outside(at_least(2.4)),
      Row("axial_length_sigma_mm", "mm").refuse_outside(at_most(0.6)),
      Row("apex_sigma_mm", "mm").refuse_outside(at_most(0.5)),
      // Of the thinnest stack. In thicker ones fits of real T1 heads had globes 2 mm smaller than independent
      // readings: wall and fat are one edge.
      Row("slice_spacing_t1_mm", "mm").refuse_outside(at_most(3.5)),
      // A wall as bright as what surrounds it has no outer border, and any thickness fits: a warning then.
      Row("wall_thickness_t1_mm", "mm").refuse_outside(at_least(0.3)).warn_outside(at_least(0.3)),
      // Retina, choroid and sclera are 0.8 to 1.5 mm.
      Row("thickest_wall_t1_mm", "mm").warn_outside(at_most(2.5)),
      // Between stacks. A head is rigid, each centre known to some 0.2 mm; those of two people differ by 4 mm (rms). Chosen.
      Row("globes_apart_difference_mm", "mm").refuse_outside(at_most(2)),
      // Right readings of real heads have up to 0.07; phantoms whose fat is displaced by 2.2 mm, whose lengths are read 2.5
      // mm too long, 0.24, by 3.4 mm 0.42.
      Row("rays_over_void_t1", "").refuse_outside(at_most(0.15)),
      Row("wall_over_surroundings_t1", "").refuse_outside(at_most(1.2)),
      // Chosen: of right fits of real heads up to 2.9, of one that was stretched to an atlas 4.6. A clean phantom of a short
      // eye, 3.4 mm flatter, is fitted as 3.9 to 4.2.
      Row("globe_flattening_mm", "mm").refuse_outside(at_most(4)),
      // Beyond what two standard deviations explain. Chosen: of right fits of real heads up to 2.3, of one whose slices were
      // told 17 % too near 2.7 and 2.9.
      Row("globe_aspect_mm", "mm").warn_outside(at_most(2)),
      Row("chi2_per_voxel", "").refuse_outside(at_most(25)),
      // Up to the second where edges confirm the fit: what moved stands in its intervals.
      Row("slice_displacement_mm", "mm").warn_outside(at_most(0.25)).refuse_outside(at_most(0.5)),
      // Of 748 steps of 20 real scans across the eyes up to 1.23, where one plane was taken out in 97.9 % of 576 more.
      Row("plane_step_ratio", "").refuse_outside(at_most(1.284)),
      // No two slices that were acquired have the same noise.
      Row("lost_slices", "").refuse_outside(at_most(0)),
      Row("outlier_share", "").refuse_outside(at_most(0.35)),
      // Standard deviations between the fit and the edges; within the first they confirm each other. Chosen.
      Row("edge_disagreement", "").refuse_outside(at_most(2.5)).warn_outside(at_most(1.5)),
      // The same, whatever the edges may be those of. Chosen: of right fits of phantoms with displaced fat 2.7, of real
      // heads 1.7; of a wrong one, of a head of 1 mm that was interpolated to 0.5 mm, 3.3 and 3.5.
      Row("edge_difference", "").refuse_outside(at_most(3)),
      // Of the step between vitreous and wall; up to the second where edges confirm the fit. Chosen.
      Row("residual_over_contrast", "").warn_outside(at_most(0.5)).refuse_outside(at_most(1)),
      Row("converged", "").warn_outside(at_least(1)),
      Row("head_shift_mm", "mm").warn_outside(at_most(6)),
      // Between two eyes in one image, which has one chemical shift and one bandwidth. Chosen; right fits of
      // phantoms differ by up to 0.2 mm, wrong ones by 1.5 to 2 mm.
      Row("fat_shift_difference_mm", "mm").refuse_outside(at_most(0.5)),
      // Standard deviations between widths or heights of a person's globes; chosen.
      Row("globe_difference", "").warn_outside(at_most(2.5)),
      // The same between lengths, chambers, lenses or extents of one eye in T1 and in T2; chosen.
      Row("contrast_difference", "").warn_outside(at_most(3)),
      // Eyes look up and down together. Chosen; right fits of real heads differ by up to 11 (noisy T1), wrong ones by 15.
      Row("vertical_gaze_difference_deg", "deg").refuse_outside(at_most(12)),
      // By the header, the head's own tilt with it; where a lens is told eyes of real heads look up to 36 away.
      Row("gaze_from_ahead_deg", "deg").refuse_outside(at_most(50)),
      // Standard deviations: fellow eyes of real heads up to 1.9, where the iris of one was taken for its cornea 5.5.
      Row("chamber_difference", "").refuse_outside(at_most(3)),
  };
}

struct AtAge {
  double years, mean, sd;
};
struct GrowthCurve {
  std::string_view quantity;
  const char* reference;
  AtAge at[4];
};
// Axial length: means and standard deviations of 12 386 European children at 6, 9 and 15 years. All else: means of girls
// and boys alike at 4, 10 and 17 years, of 1907 German children (aqueous depth 2.795, 3.075 and 3.13 mm behind a cornea of
// 0.552 mm; radius 7.795 and 7.835 mm, as power 337.5 / radius), with the standard deviations of 257 German children (of
// both sexes together: 0.175, 0.27, 0.0325 and 0.237 mm). The last value stands until 18.
constexpr AtAge power_at_4{4, 43.30, 1.32}, power_at_10{10, 43.08, 1.30}, power_at_17{17, 43.08, 1.30},
    power_at_18{18, 43.08, 1.30};
constexpr const char *tideman = "Tideman et al. 2018", *rauscher = "Rauscher et al. 2021";
constexpr GrowthCurve growth_curves[] = {
    {"optical_axial_length_mm",
     tideman,
     {{6, 22.36, 0.75}, {9, 23.10, 0.84}, {15, 23.41, 0.86}, {18, 23.41, 0.86}}},
    {"corneal_thickness_mm",
     rauscher,
     {{4, 0.552, 0.0325}, {10, 0.552, 0.0325}, {17, 0.552, 0.0325}, {18, 0.552, 0.0325}}},
    {"anterior_chamber_depth_mm",
     rauscher,
     {{4, 3.347, 0.27}, {10, 3.627, 0.27}, {17, 3.682, 0.27}, {18, 3.682, 0.27}}},
    {"lens_thickness_mm",
     rauscher,
     {{4, 3.74, 0.175}, {10, 3.455, 0.175}, {17, 3.51, 0.175}, {18, 3.51, 0.175}}},
    {"astigmatism/M_D", rauscher, {power_at_4, power_at_10, power_at_17, power_at_18}},
    {"keratometry/flat/power_D", rauscher, {power_at_4, power_at_10, power_at_17, power_at_18}},
    {"keratometry/steep/power_D", rauscher, {power_at_4, power_at_10, power_at_17, power_at_18}},
};

}  // namespace

bool Range::is_limited() const { return !contains(Range{}); }

void check_setting(const char* name, double value, const Range& allowed, const char* unit) {
  if (!allowed.contains(value))
    throw usage_error(
        fmt::format("{} is {:g}{}, outside {:g} to {:g}", name, value, unit, allowed.low, allowed.high),
        fmt::format("give {:g} to {:g}{}", allowed.low, allowed.high, unit));
}

void check_vertex_distance(const char* name, double vertex_distance_mm) {
  if (vertex_distance_mm == 0) return;
  try {
    check_setting(name, vertex_distance_mm, spectacle_distance_mm, " mm");
  } catch (const Error& error) {
    throw usage_error(error.what(), error.remedy() + ", or 0 for a contact lens");
  }
}

const std::vector<Limits>& limits_table() {
  static const std::vector<Limits> table = [] {
    std::vector<Limits> all;
    for (const std::vector<Limits>& part : {biometry(), refraction(), fit_quality()})
      all.insert(all.end(), part.begin(), part.end());
    return all;
  }();
  return table;
}

const Limits* find_limits(const std::string& quantity) {
  const auto found = std::find_if(limits_table().begin(), limits_table().end(),
                                  [&](const Limits& limits) { return limits.quantity == quantity; });
  return found == limits_table().end() ? nullptr : &*found;
}

Normal normal_at_age(const std::string& quantity, std::optional<double> age_years) {
  if (!is_child(age_years)) {
    const Limits* limits = find_limits(quantity);
    return limits == nullptr ? Normal{} : Normal{limits->normal, limits->normal_reference};
  }
  const auto found = std::find_if(std::begin(growth_curves), std::end(growth_curves),
                                  [&](const GrowthCurve& curve) { return curve.quantity == quantity; });
  if (found == std::end(growth_curves)) return {};
  for (std::size_t i = 1; i < std::size(found->at); ++i) {
    const AtAge &younger = found->at[i - 1], &older = found->at[i];
    if (*age_years < younger.years || *age_years > older.years) continue;
    const double along = (*age_years - younger.years) / (older.years - younger.years),
                 mean = younger.mean + along * (older.mean - younger.mean),
                 sd = younger.sd + along * (older.sd - younger.sd);
    return {{mean - 2 * sd, mean + 2 * sd}, found->reference};
  }
  return {};
}

const Limits& limits_of(const std::string& quantity) {
  if (const Limits* found = find_limits(quantity)) return *found;
  throw Error(ExitStatus::fault, "no limits are known of " + quantity);
}

}  // namespace emmetrope
