#pragma once
#include <Eigen/Core>
#include <optional>
#include <vector>

#include "pipeline/base/json.hpp"
#include "pipeline/base/power_vector.hpp"
#include "pipeline/eye/model/eye_model.hpp"
#include "raytrace/wavefront/pupil_rim.hpp"

/// Wavefront aberration of an eye, ANSI Z80.28 / ISO 24157, by exact rays from the retina outward.
///
/// The reference plane is the entrance pupil's, perpendicular to the line of sight (the ray from the retinal
/// point through the centre of the stop); its x is the eye's horizontal, its y up. W (um) is the optical path
/// of the ray through the pupil's centre less that of the ray here: positive where the emerging wavefront is
/// ahead, as a myope's converging one is at the rim: M = -4 sqrt(3) c20 / r^2 with c in um and r in mm.
///
/// The pupil is what the stop and the surfaces let through, seen along the line of sight: off the axis about an
/// ellipse. Its Zernike terms are those of the smallest circle about the line of sight that holds it, fitted
/// over the pupil alone; off the axis they are not orthogonal there, so that rms values and second-order
/// refraction come from the wavefront over the pupil and not from single terms.
namespace emmetrope::raytrace {

struct WavefrontSettings {
  std::optional<double> wavelength_nm;      ///< default: the eye's reference wavelength
  std::optional<double> entrance_pupil_mm;  ///< a circle instead of what the eye's stop lets through
  int order = 8;                            ///< highest radial order of the Zernike terms, 2 to 12
  Eigen::Vector2d fovea_mm{0, 0};           ///< on the retina from the pole, eye x and y
  /// Stiles-Crawford effect: light weighs 10^(-this r^2), r mm from the centre of the eye's pupil, not as a spectacle
  /// magnifies it; 0: none
  double stiles_crawford_per_mm2 = 0;
};

struct Wavefront {
  double wavelength_nm = 0;
  double pupil_mm = 0;  ///< diameter of the Zernike terms' circle in the entrance pupil plane
  PupilRim rim;         ///< empty: that circle
  double stiles_crawford_per_mm2 = 0;
  double pupil_magnification = 1;         ///< of what the eye wears: its own pupil is as much smaller
  double pupil_position_mm = 0;           ///< depth of that plane behind the corneal vertex
  Eigen::Vector2d pupil_centre_mm{0, 0};  ///< where the line of sight crosses it, eye x and y
  std::vector<double> zernike_um;         ///< OSA index order from 0; [0] is 0
  double fit_residual_rms_um = 0;         ///< what the terms leave
  /// The rays behind it: where they cross the pupil, from its centre, and their share of its area.
  struct PupilRay {
    Eigen::Vector2d place_mm;
    Eigen::Vector2d slope;  ///< direction cosines across the line of sight
    double wavefront_um = 0;
    double area_share = 0;
  };
  std::vector<PupilRay> rays;
  Eigen::Vector2d line_of_sight_deg{0, 0};  ///< its angles against the eye's axis towards +x and +y
  /// In the pupil's plane, along the meridian of the field (the plane of the eye's axis and the line of sight);
  /// y within a degree of the axis.
  Eigen::Vector2d tangential{0, 1};

  /// Vergences in the entrance pupil plane, air, 1/m: the three criteria that need no search.
  PowerVector paraxial, minimum_rms_wavefront, minimum_rms_spot;

  /// Over the pupil, without piston and tilt.
  double rms_um() const { return rms_beyond_order_um(1); }
  /// Without what a lens corrects.
  double higher_order_rms_um() const { return rms_beyond_order_um(2); }
  /// Of the light through a place of the pupil, by the Stiles-Crawford effect: 1 in its middle.
  double receptor_weight(const Eigen::Vector2d& place_mm) const;
  /// The share of the light that a ray stands for.
  double light_share(const PupilRay& ray) const;
  /// Of the best plane through the wavefront over the pupil, towards x and y: the middle of point_spread() lies
  /// there from the line of sight, in object space.
  Eigen::Vector2d tilt_mrad() const;
  /// Of all rays' light.
  Eigen::Vector2d mean_slope() const;
  /// Root mean square of the rays' slopes about their mean: the radius of the blur, as seen from the object's
  /// side.
  double spot_rms_arcmin() const;

 private:
  double rms_beyond_order_um(int order) const;
};

/// The wavefront's, or its circle where it has none.
inline PupilRim rim_of(const Wavefront& wavefront) {
  return wavefront.rim.radius_mm.empty() ? PupilRim{{wavefront.pupil_mm / 2}} : wavefront.rim;
}

/// \throw Error (usage) for settings beyond their range; (no_result) when too few rays reach the air to say anything
Wavefront measure_wavefront(const EyeModel& eye, const WavefrontSettings& settings = {});

/// The wavefront behind a thin lens in the entrance pupil plane, which moves the terms of second order.
/// \param lens_in_pupil  what it corrects, the sign of a prescription
Wavefront with_lens(Wavefront wavefront, const PowerVector& lens_in_pupil);

/// Image quality in monochromatic light with the wavefront as it is (tilt removed) or with a lens in the
/// entrance pupil.
struct ImageQuality {
  double strehl = 0;  ///< peak of the point spread function over that of the perfect pupil
  /// visual Strehl ratio by the OTF (Thibos et al. 2004), weighted by contrast_sensitivity()
  double vsotf = 0;
  /// At whole cycles a degree to the pupil's cut-off; along Wavefront::tangential and across it.
  std::vector<double> cpd, mtf_tangential, mtf_sagittal;
};
/// \param lens_in_pupil  what a thin lens in the entrance pupil plane corrects, the sign of a prescription
ImageQuality image_quality(const Wavefront& wavefront, const PowerVector& lens_in_pupil = {});

/// The point spread function on a square grid, unit sum, as the patient perceives it, like a retinal image:
/// row 0 at the top (+y), columns to the patient's right (-x), angles in object space about Wavefront::tilt_mrad().
struct PointSpread {
  int size = 0;
  double pitch_arcmin = 0;
  /// The blur is wider than the grid, and what leaves it on one side enters on the other
  bool wraps = false;
  std::vector<float> values;
};
PointSpread point_spread(const Wavefront& wavefront, const PowerVector& lens_in_pupil = {});

/// The refraction by four criteria, all moved to the same vertex distance in front of the cornea.
struct RefractionCriteria {
  PowerVector paraxial, minimum_rms_wavefront, minimum_rms_spot, visual_strehl;
};
/// `visual_strehl` is a through-focus search of the best VSOTF over M, J0 and J45.
RefractionCriteria refraction_by_wavefront(const Wavefront& wavefront, double vertex_distance_mm);
RefractionCriteria refraction_by_wavefront(const EyeModel& eye, const WavefrontSettings& settings,
                                           double vertex_distance_mm);

/// A vergence in the entrance pupil plane as a prescription at the vertex distance, and back.
PowerVector at_vertex(const Wavefront& wavefront, const PowerVector& in_pupil, double vertex_distance_mm);
PowerVector in_pupil(const Wavefront& wavefront, const PowerVector& at_vertex, double vertex_distance_mm);

/// wavefront.json of the case folder: pupil_mm, wavelength_nm, zernike_um, rms_um, strehl, vsotf, mtf, and
/// more.
Json wavefront_json(const Wavefront& wavefront);
/// {"paraxial": {"M_D", "J0_D", "J45_D"}, ...}: `wavefront_check` of prescription.json.
Json to_json(const RefractionCriteria& refraction);

}  // namespace emmetrope::raytrace
