#include "pipeline/report/content/remedies.hpp"

#include <map>

namespace emmetrope::report {
namespace {

constexpr const char* look =
    "Look at the contours on the slices; where they lie off the edges, correct the labels (--labels).";
constexpr const char* keep_still = "Rescan with the head still, in fewer minutes.";
// Where the fit is withheld no other instrument helps.
constexpr const char* rescan = "Rescan this eye, still, in T2 of 0.5 mm in plane.";
constexpr const char* before_defacing = "Use the images from before the face was taken off.";
constexpr const char* all_grey_values =
    "Use the scanner's own images, not what a viewer saved of its window.";
constexpr const char* ask_radiologist = "Have a radiologist look at what is in the globe.";
constexpr const char* measure_cornea = "Measure the cornea, and give it (--keratometry).";

}  // namespace

std::string remedy_of_gate(const std::string& gate) {
  static const std::map<std::string, const char*> remedies{
      {"globe_inside_stack", "Rescan with the whole globe inside the slices."},
      {"front_is_blanked", before_defacing},
      {"wall_blanked", before_defacing},
      {"blanked_before_cornea", before_defacing},
      {"clipped_about_eye", all_grey_values},
      {"clipped_lens", all_grey_values},
      {"clipped_vitreous", all_grey_values},
      {"gaze_from_ahead_deg",
       "Look at the contours; use the scanner's own file, or one whose orientation is the head's."},
      {"globe_flattening_mm", "Use the images as the scanner made them, not resampled to a template."},
      {"globe_aspect_mm", "Use the scanner's own files, or check the spacing of the slices."},
      {"vertical_gaze_difference_deg", look},
      {"chamber_difference", look},
      {"lens_contrast", "Rescan in T2, which shows the lens."},
      {"rays_over_void_t1",
       "Rescan in T2, or with more bandwidth; or use the scanner's DICOM, which tells how far fat is displaced."},
      {"natural_lens_mm", "Take length and chamber by an instrument that knows lens implants."},
      {"cornea_contrast_t2", rescan},
      {"fluid_difference_t1", rescan},
      {"iris_over_aqueous_t1", rescan},
      {"fluid_difference_t2", ask_radiologist},
      {"intraocular_mass_seen_mm3", ask_radiologist},
      {"intraocular_mass_mm3", ask_radiologist},
      {"unexplained_in_vitreous_mm3", ask_radiologist},
      {"surroundings_over_vitreous_t2",
       "Use a T2-weighted series, or have a radiologist look at what fills the globe."},
      {"cornea_sigma_over_prior", measure_cornea},
      {"label_pixel_mm", measure_cornea},
      {"resolved_t2_mm", measure_cornea},
      {"chamber_of_unseen_cornea_mm", rescan},
      {"keratometry_flat_D", measure_cornea},
      {"keratometry_steep_D", measure_cornea},
      {"keratometry_plausible_D", measure_cornea},
      {"keratometry_plausible_upper_D", measure_cornea},
      {"apex_sigma_mm", rescan},
      {"axial_length_sigma_mm", rescan},
      {"axial_length_mm_lower", rescan},
      {"axial_length_mm_upper", rescan},
      {"slice_spacing_t1_mm", "Rescan in T2, or in T1 of 1 mm."},
      {"slice_displacement_mm", keep_still},
      {"plane_step_ratio",
       "Convert the scanner's images again, all of them, or use its DICOM, which tells where each lies."},
      {"lost_slices",
       "Ask the archive for the series again, as the scanner sent it, or name the others by --series."},
      {"head_shift_mm", keep_still},
  };
  const auto found = remedies.find(gate);
  return found == remedies.end() ? look : found->second;
}

std::string remedy_of_reason(const std::string& stage, const std::string& reason) {
  if (reason.rfind("no such eye was found", 0) == 0)
    return "Look whether the images show this eye; where they do not, rescan with it inside the slices.";
  if (reason.rfind("one eye only is seen", 0) == 0)
    return "Check which eye it is; --laterality takes that one alone.";
  return stage == "segmentation" ? look : "See \"Limits and warnings\" below.";
}

}  // namespace emmetrope::report
