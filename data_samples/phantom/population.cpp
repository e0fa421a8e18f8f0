#include "data_samples/phantom/population.hpp"

namespace emmetrope::phantom {

const std::vector<Distribution>& population() {
  static const char* const dubbelman = "Dubbelman and van der Heijde 2001";
  static const char* const atchison = "Atchison et al. 2005";
  static const char* const chosen = "chosen";
  static const std::vector<Distribution> table{
      {"axial_length_mm", 23.6, 0, 1.05, 21.2, 26.8, "Jivrajka et al. 2008: 23.46, 1.03"},
      {"corneal_power_D", 43.3, 0, 1.45, 39.4, 47.2, "Dubbelman et al. 2006: radius 7.79, 0.27"},
      {"corneal_j0_D", 0.30, 0, 0.50, -1.5, 2.0, chosen},
      {"corneal_j45_D", 0, 0, 0.30, -1.2, 1.2, chosen},
      {"cornea_q", -0.20, 0, 0.09, -0.5, 0.1, chosen},
      {"cornea_q_of_meridian", 0, 0, 0.03, -0.1, 0.1, chosen},
      {"cornea_thickness_mm", 0.545, 0, 0.033, 0.45, 0.65, "chosen, near Doughty and Zaman 2000"},
      {"cornea_back_ratio", 0.83, 0, 0.015, 0.78, 0.88, "the prior of the fit"},
      {"limbus_radius_mm", 5.85, 0, 0.20, 5.4, 6.3, "Rufer et al. 2005: diameter 11.71, 0.42"},
      {"anterior_chamber_depth_mm", 3.47, -0.010, 0.22, 2.7, 4.2, dubbelman},
      {"lens_thickness_mm", 3.87, 0.0236, 0.25, 3.1, 5.2, dubbelman},
      {"lens_anterior_radius_mm", 10.6, -0.057, 1.23, 6.5, 15.0, dubbelman},
      {"lens_posterior_radius_mm", 5.72, -0.012, 0.57, 4.4, 7.5, dubbelman},
      {"lens_anterior_q", -3.0, 0, 0.8, -5, -0.5, chosen},
      {"lens_posterior_q", -1.2, 0, 0.5, -2.5, 0, chosen},
      {"lens_decentre_x_mm", 0, 0, 0.12, -0.4, 0.4, chosen},
      {"lens_decentre_y_mm", 0, 0, 0.10, -0.3, 0.3, chosen},
      {"lens_tilt_x_deg", 0.8, 0, 1.5, -5, 5, chosen},
      {"lens_tilt_y_deg", -3.0, 0, 1.5, -8, 8, chosen},
      {"lens_equator_radius_mm", 4.6, 0, 0.12, 4.3, 4.9, chosen},
      {"iris_diameter_mm", 4.5, 0, 0.7, 3.0, 6.0, chosen},
      {"iris_thickness_mm", 0.40, 0, 0.05, 0.3, 0.5, chosen},
      {"ciliary_thickness_mm", 1.2, 0, 0.15, 0.8, 1.6, chosen},
      {"globe_semi_x_mm", 11.46, 0, 0.28, 10.8, 12.2, atchison},
      {"globe_semi_y_mm", 11.36, 0, 0.12, 11.0, 11.7, atchison},
      {"wall_lateral_mm", 0.85, 0, 0.08, 0.6, 1.1, chosen},
      {"wall_axial_mm", 1.0, 0, 0.10, 0.7, 1.3, chosen},
      {"bulge_height_mm", 0.15, 0, 0.25, 0, 0.9, chosen},
      {"bulge_width_deg", 18, 0, 3, 12, 25, chosen},
      {"bulge_x_deg", 0, 0, 12, -30, 30, chosen},
      {"bulge_y_deg", 0, 0, 10, -25, 25, chosen},
      {"cone_height_um", 70, 0, 25, 20, 120, "adds 8 D at its middle, as in moderate keratoconus"},
      {"cone_width_mm", 1.6, 0, 0.2, 1.2, 2.0, chosen},
      {"cone_temporal_mm", 0.5, 0, 0.4, -0.5, 1.5, "cones lie below the apex and to the temple"},
      {"cone_y_mm", -1.0, 0, 0.4, -2, 0, "cones lie below the apex and to the temple"},
      {"cone_back_ratio", 2.0, 0, 0.3, 1.2, 2.8, "Chen and Yoon 2008, from the coma of both surfaces"},
      {"lid_thickness_mm", 2.0, 0, 0.3, 1.3, 2.8, chosen},
      {"gaze_of_an_eye_deg", 0, 0, 1, -3, 3, chosen},
      {"gaze_horizontal_deg", 0, 0, 4, -12, 12, chosen},
      {"gaze_vertical_deg", -12, 0, 6, -30, 8, "closed eyes in real scans: 10 to 20 down"},
      {"interpupillary_distance_mm", 62.5, 0, 3.0, 55, 71, "Dodgson 2004: 63.4, 3.8"},
      {"roll_deg", 0, 0, 1.2, -3.5, 3.5, chosen},
      {"position_x_mm", 0, 0, 2, -6, 6, chosen},
      {"position_y_mm", -31, 0, 4, -45, -20, chosen},
      {"position_z_mm", 2, 0, 5, -15, 15, chosen},
      {"lens_index", 1.4254, -0.00039, 0.005, 1.40, 1.46, dubbelman},
  };
  return table;
}

}  // namespace emmetrope::phantom
