#include "pipeline/cohort/results/quantities.hpp"

namespace emmetrope::cohort {
namespace {

Quantity biometry(const char* column, const char* key, const char* unit, const char* description) {
  return {column, "meshing", "biometry.json", key, unit, description};
}
Quantity refraction(const char* column, const char* key, const char* unit, const char* description) {
  return {column, "correction", "prescription.json", key, unit, description};
}

}  // namespace

const std::vector<Quantity>& quantities() {
  static const std::vector<Quantity> list{
      biometry("axial_length", "/axial_length_mm", "mm", "Corneal apex to the vitreo-retinal interface"),
      biometry("optical_axial_length", "/optical_axial_length_mm", "mm",
               "Corneal apex to the photoreceptors"),
      biometry("corneal_thickness", "/corneal_thickness_mm", "mm", "On the axis"),
      biometry("anterior_chamber_depth", "/anterior_chamber_depth_mm", "mm", "Apex to lens, cornea included"),
      biometry("lens_thickness", "/lens_thickness_mm", "mm", "On the axis"),
      biometry("lens_anterior_radius", "/lens_anterior_radius_mm", "mm", "At the vertex"),
      biometry("lens_posterior_radius", "/lens_posterior_radius_mm", "mm", "At the vertex, magnitude"),
      biometry("globe_width", "/globe_width_mm", "mm",
               "Largest extent of the interface along the horizontal"),
      biometry("globe_height", "/globe_height_mm", "mm",
               "Largest extent of the interface along the vertical"),
      biometry("globe_depth", "/globe_depth_mm", "mm", "Extent of the globe's ellipsoid along the axis"),
      biometry("flat_power", "/keratometry/flat/power_D", "D", "Flat meridian, 337.5 / R"),
      biometry(
          "flat_axis", "/keratometry/flat/axis_deg", "deg",
          "Flat meridian, TABO, where there is one: n/a of a cornea that may be a sphere; the interval may "
          "reach beyond 0 and 180"),
      biometry("steep_power", "/keratometry/steep/power_D", "D", "Steep meridian, 337.5 / R"),
      biometry("corneal_m", "/astigmatism/M_D", "D", "Mean corneal power"),
      biometry("corneal_j0", "/astigmatism/J0_D", "D", "Corneal astigmatism with the rule"),
      biometry("corneal_j45", "/astigmatism/J45_D", "D", "Oblique corneal astigmatism"),
      biometry("retina_radius_horizontal", "/retina/vertex_radius_mm/horizontal", "mm",
               "Vertex radius of the best ellipsoid over 240 degrees"),
      biometry("retina_radius_vertical", "/retina/vertex_radius_mm/vertical", "mm",
               "Vertex radius of the best ellipsoid over 240 degrees"),
      biometry("retina_q_240", "/retina/q_240", "", "Asphericity of the best ellipsoid over 240 degrees"),
      biometry("retina_q_120", "/retina/q_120", "", "Asphericity of the best ellipsoid over 120 degrees"),
      biometry("retina_tilt_horizontal", "/retina/tilt_deg/horizontal", "deg",
               "Tilt of the back of the eye to the patient's left"),
      biometry("retina_tilt_vertical", "/retina/tilt_deg/vertical", "deg",
               "Tilt of the back of the eye upwards"),
      biometry("retina_area", "/retina/area_mm2", "mm2", "Of the interface within 240 degrees"),
      biometry("vitreous_volume", "/retina/volume_mm3", "mm3", "Inside the interface behind the lens"),
      biometry("staphyloma_index", "/retina/staphyloma_index", "",
               "337.5 over the smallest radius of curvature (mm) near the pole"),
      biometry("interpupillary_distance", "/interpupillary_distance_mm", "mm", "Between the globes' centres"),
      refraction("refraction_m", "/M_D", "D", "Spherical equivalent at the spectacle plane"),
      refraction("refraction_j0", "/J0_D", "D", "Astigmatism of the refraction at 0 and 90 degrees"),
      refraction("refraction_j45", "/J45_D", "D", "Astigmatism of the refraction at 45 and 135 degrees")};
  return list;
}

}  // namespace emmetrope::cohort
