#include "pipeline/report/content/normal_ranges.hpp"

namespace emmetrope::report {

// Ranges are mean -+ 2 standard deviations of the source: axial length 23.45 (1.51) mm, chamber depth 3.11
// (0.43) mm and corneal radius 7.69 (0.28) mm of 23 239 eyes [5]; corneal thickness 0.534 (0.040) mm of 28
// 709 eyes [6]; asphericity -0.28 (0.18) of 1683 eyes [10]. Lens thickness is 2.93 mm + 0.0236 mm a year [7]
// from 18 to 80 years, -+ 0.4 mm. The lens's radii [8] are 12.9 - 0.057 age and 6.2 - 0.012 age (mm; Navarro
// 2014 has 12.7 - 0.058 age and 5.9 - 0.013 age). Distances of the eyes are the range of the vast majority of
// adults [9].
const std::vector<BiometryRow>& biometry_rows() {
  static const std::vector<BiometryRow> rows{
      {"optical_axial_length_mm", "Axial length, optical", {2, false, "mm"}, 20.43, 26.47, "5"},
      {"axial_length_mm", "Axial length, to the inner retina", {2, false, "mm"}, 0, 0, ""},
      {"corneal_thickness_mm", "Corneal thickness", {2, false, "mm"}, 0.45, 0.61, "6"},
      {"anterior_chamber_depth_mm", "Anterior chamber depth", {2, false, "mm"}, 2.25, 3.97, "5"},
      {"lens_thickness_mm", "Lens thickness", {2, false, "mm"}, 2.95, 5.2, "7"},
      {"lens_anterior_radius_mm", "Lens front radius", {1, false, "mm"}, 7.5, 13.2, "8"},
      {"lens_posterior_radius_mm", "Lens back radius", {1, false, "mm"}, 4.9, 7.0, "8"},
      {"globe_width_mm", "Globe width (inner)", {1, false, "mm"}, 0, 0, ""},
      {"globe_height_mm", "Globe height (inner)", {1, false, "mm"}, 0, 0, ""},
      {"interpupillary_distance_mm", "Distance of the globe centres", {1, false, "mm"}, 50, 75, "9"}};
  return rows;
}

const std::vector<BiometryRow>& keratometry_rows() {
  static const std::vector<BiometryRow> rows{
      {"keratometry/flat/power_D", "Flat meridian K1", {2, false, "D"}, 40.91, 47.34, "5"},
      {"keratometry/flat/radius_mm", "Flat radius", {2, false, "mm"}, 0, 0, ""},
      {"keratometry/flat/axis_deg", "Flat axis", {0, false, "deg"}, 0, 0, ""},
      {"keratometry/steep/power_D", "Steep meridian K2", {2, false, "D"}, 40.91, 47.34, "5"},
      {"keratometry/steep/radius_mm", "Steep radius", {2, false, "mm"}, 0, 0, ""},
      {"keratometry/steep/axis_deg", "Steep axis", {0, false, "deg"}, 0, 0, ""},
      {"keratometry/cylinder_D", "Corneal cylinder (steep - flat)", {2, false, "D"}, 0, 0, ""},
      {"keratometry/asphericity_q", "Asphericity Q", {2, true, ""}, -0.64, 0.08, "10"},
      {"astigmatism/M_D", "Corneal mean power M", {2, false, "D"}, 40.91, 47.34, "5"},
      {"astigmatism/J0_D", "Corneal J0", {2, true, "D"}, 0, 0, ""},
      {"astigmatism/J45_D", "Corneal J45", {2, true, "D"}, 0, 0, ""},
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
