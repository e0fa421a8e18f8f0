#include "pipeline/report/normal_ranges.hpp"

namespace emmetrope::report {

// Ranges are mean -+ 2 standard deviations of the source. Hoffer (1980) measured 7500 eyes by ultrasound and
// keratometer; Dubbelman's lens formulas are taken at 20 and 70 years, widened by their scatter.
const std::vector<BiometryRow>& biometry_rows() {
  static const std::vector<BiometryRow> rows{
      {"optical_axial_length_mm", "Axial length, optical", {2, false, "mm"}, 20.95, 26.35, "5"},
      {"axial_length_mm", "Axial length, to the inner retina", {2, false, "mm"}, 0, 0, ""},
      {"corneal_thickness_mm", "Corneal thickness", {2, false, "mm"}, 0.47, 0.60, "6"},
      {"anterior_chamber_depth_mm", "Anterior chamber depth", {2, false, "mm"}, 2.36, 4.12, "5"},
      {"lens_thickness_mm", "Lens thickness", {2, false, "mm"}, 3.0, 5.3, "7"},
      {"lens_anterior_radius_mm", "Lens front radius", {1, false, "mm"}, 7.5, 13.2, "8"},
      {"lens_posterior_radius_mm", "Lens back radius", {1, false, "mm"}, 4.9, 7.0, "8"},
      {"globe_width_mm", "Globe width (inner)", {1, false, "mm"}, 0, 0, ""},
      {"globe_height_mm", "Globe height (inner)", {1, false, "mm"}, 0, 0, ""},
      {"interpupillary_distance_mm", "Distance of the globe centres", {1, false, "mm"}, 52, 78, "9"}};
  return rows;
}

const std::vector<BiometryRow>& keratometry_rows() {
  static const std::vector<BiometryRow> rows{
      {"keratometry/flat/power_D", "Flat meridian K1", {2, false, "D"}, 40.61, 47.01, "5"},
      {"keratometry/flat/radius_mm", "Flat radius", {2, false, "mm"}, 0, 0, ""},
      {"keratometry/flat/axis_deg", "Flat axis", {0, false, "deg"}, 0, 0, ""},
      {"keratometry/steep/power_D", "Steep meridian K2", {2, false, "D"}, 40.61, 47.01, "5"},
      {"keratometry/steep/radius_mm", "Steep radius", {2, false, "mm"}, 0, 0, ""},
      {"keratometry/steep/axis_deg", "Steep axis", {0, false, "deg"}, 0, 0, ""},
      {"keratometry/cylinder_D", "Corneal cylinder (steep - flat)", {2, false, "D"}, 0, 0, ""},
      {"keratometry/asphericity_q", "Asphericity Q", {2, true, ""}, -0.62, 0.10, "10"},
      {"astigmatism/M_D", "Mean power M", {2, false, "D"}, 40.61, 47.01, "5"},
      {"astigmatism/J0_D", "J0", {2, true, "D"}, 0, 0, ""},
      {"astigmatism/J45_D", "J45", {2, true, "D"}, 0, 0, ""},
      {"astigmatism/irregularity_um",
       "Irregularity (rms from the best toric)",
       {1, false, "\u00b5m"},
       0,
       0,
       ""},
      {"astigmatism/section_2p3mm/horizontal_mm",
       "Corneal section 2.3 mm deep, horizontal",
       {2, false, "mm"},
       0,
       0,
       ""},
      {"astigmatism/section_2p3mm/vertical_mm",
       "Corneal section 2.3 mm deep, vertical",
       {2, false, "mm"},
       0,
       0,
       ""}};
  return rows;
}

}  // namespace emmetrope::report
