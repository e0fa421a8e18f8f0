#pragma once
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "pipeline/base/json.hpp"
#include "pipeline/base/laterality.hpp"

/// Phantom studies with known truth. Geometry (this header) is apart from acquisition (acquisition.hpp).
namespace emmetrope::phantom {

/// One eye. Lengths mm, angles degrees, x, y and axes as in the contract's eye frame; depth d = -z behind the
/// apex. The values here are those of the sample study's right eye but for the cylinder.
struct EyeGeometry {
  // Cornea: biconic, d = (x^2/Rx + y^2/Ry) / (1 + sqrt(1 - (1+Qx) x^2/Rx^2 - (1+Qy) y^2/Ry^2)), x along
  // cornea_axis_deg.
  double cornea_radius_x_mm = 7.8, cornea_radius_y_mm = 7.8;
  double cornea_q_x = -0.2, cornea_q_y = -0.2;
  double cornea_axis_deg = 0;          ///< meridian of cornea_radius_x_mm
  double cornea_thickness_mm = 0.545;  ///< at the apex
  double cornea_back_ratio = 0.83;     ///< posterior over anterior radius in each meridian
  double limbus_radius_mm = 5.85;      ///< where cornea turns into sclera

  // Keratoconus: the front surface bulges by cone_height_um exp(-r^2 / (2 width^2)) about (cone_x, cone_y),
  // less what that is at the apex, which stays; the back surface cone_back_ratio times as far.
  double cone_height_um = 0;
  double cone_width_mm = 1.6;
  double cone_x_mm = 0, cone_y_mm = -1;
  double cone_back_ratio = 2;

  // Lens: two conics about one axis, their edge rounded off at the equator.
  double anterior_chamber_depth_mm = 3.4;  ///< apex to front vertex of the centred lens, cornea included
  double lens_thickness_mm = 3.8;
  double lens_anterior_radius_mm = 10.5, lens_posterior_radius_mm = 6.0;  ///< magnitudes
  double lens_anterior_q = -3, lens_posterior_q = -1;
  double lens_decentre_x_mm = 0, lens_decentre_y_mm = 0;
  /// About mid-lens, first about +x, then about the fixed +y
  double lens_tilt_x_deg = 0, lens_tilt_y_deg = 0;
  double lens_equator_radius_mm = 4.6;

  // Iris and ciliary body.
  double iris_diameter_mm = 4.0;
  double iris_thickness_mm = 0.40;
  double ciliary_thickness_mm = 1.2;

  // Vitreo-retinal interface: ellipsoid about the axis, centre at depth axial_length_mm - globe_semi_z_mm.
  double axial_length_mm = 23.6;  ///< of the ellipsoid; a bulge at the pole adds to it
  double globe_semi_x_mm = 11.5, globe_semi_y_mm = 11.4, globe_semi_z_mm = 10.8;
  double globe_axis_deg = 0;  ///< meridian of globe_semi_x_mm
  // Posterior bulge (staphyloma): the scaled radius becomes 1 + u/11 mm, u = height exp(-angle^2 / (2
  // width^2)).
  double bulge_height_mm = 0;
  double bulge_width_deg = 18;
  /// Direction from the posterior pole, in scaled space, towards +x and +y
  double bulge_x_deg = 0, bulge_y_deg = 0;
  double wall_lateral_mm = 0.85, wall_axial_mm = 1.0;  ///< retina, choroid and sclera together

  double lid_thickness_mm = 2.0;  ///< 0: open eye, air in front of the cornea

  // Structures that the fit's model has not; 0: none.
  double choroid_mm = 0;       ///< a bright layer inside the wall; the rest of it is then dark sclera
  double wall_variation = 0;   ///< relative amplitude with which the wall's thickness varies over the globe
  double tendon_mm = 0;        ///< thickness of the tendons that lie on the globe in front of its equator
  double nucleus_share = 0;    ///< of the lens: its nucleus, half axes over those of the lens
  double liquefied_share = 0;  ///< of the vitreous, in pockets
  double lid_slope = 0;        ///< the lid is thicker by this share 10 mm above the axis, thinner below
  double proptosis_mm = 0;     ///< the globe lies this much further out of the head
  double tumour_mm = 0;        ///< radius of a melanoma on the wall
  double tumour_x_deg = 40, tumour_y_deg = 20;  ///< its direction, as the bulge's
  double oil = 0;                               ///< 1: silicone oil in place of the vitreous
  double buckle_mm = 0;                         ///< thickness of a silicone band around the equator
  double implant = 0;                           ///< 1: the lens is of acrylic

  // Pose, in the head: where the eye looks from straight ahead, about the globe's centre.
  double gaze_horizontal_deg = 0;  ///< towards the patient's left
  double gaze_vertical_deg = 0;    ///< up
};

/// Both eyes and the head around them.
struct HeadGeometry {
  EyeGeometry od, os;
  double interpupillary_distance_mm = 62.5;  ///< of the globes' centres
  double roll_deg = 0;                       ///< positive: the left eye is higher
  /// Midpoint of the globes' centres in LPS, mm.
  double position_x_mm = 0.7, position_y_mm = -31, position_z_mm = 4;
  double age_years = 40;
  double lens_index = 1.4254;  ///< true equivalent index of both lenses; images do not show it

  const EyeGeometry& eye(Laterality laterality) const { return laterality == Laterality::od ? od : os; }
  EyeGeometry& eye(Laterality laterality) { return laterality == Laterality::od ? od : os; }
};

/// An eye where it is: its geometry expressed in the contract's eye frame (the head's roll has turned its
/// axes), and that frame.
struct PlacedEye {
  Laterality laterality = Laterality::od;
  EyeGeometry geometry;
  Eigen::Isometry3d lps_from_eye = Eigen::Isometry3d::Identity();
  /// How far the head has turned about the eye's axis against that frame, deg: lid and muscles turn with the
  /// head.
  double turn_deg = 0;

  /// The frame that turns with the head, with the same axis and apex.
  Eigen::Isometry3d lps_from_turned_eye() const;
  double globe_centre_depth_mm() const { return geometry.axial_length_mm - geometry.globe_semi_z_mm; }
  Eigen::Vector3d globe_centre_lps() const {
    return lps_from_eye * Eigen::Vector3d(0, 0, -globe_centre_depth_mm());
  }
};

/// The head's own frame: as LPS, but with its origin midway between the globes' centres and without roll.
Eigen::Isometry3d lps_from_head(const HeadGeometry& head);
PlacedEye place(const HeadGeometry& head, Laterality laterality);

/// \throw Error (usage) naming the first value that makes no eye: surfaces that cross, radii out of reach,
///   ...
void check(const HeadGeometry& head);

/// What a cone adds to the depth of the anterior cornea.
double cone_depth_mm(const EyeGeometry& eye, double x_mm, double y_mm);
/// Depth of the anterior cornea behind the apex, cone included.
double anterior_cornea_depth_mm(const EyeGeometry& eye, double x_mm, double y_mm);

/// Field by field under the names above: {"od": {...}, "os": {...}, "interpupillary_distance_mm": ..., ...}.
Json to_json(const HeadGeometry& head);
/// Keys that are missing keep their default.
/// \throw Error (input_invalid) naming an unknown key
HeadGeometry head_from_json(const Json& json);

/// Sets fields from "key=value,key=value".
/// \throw Error (usage) naming an unknown key, with the known ones, or a value that is no number
void set_fields(EyeGeometry& eye, const std::string& assignments);
void set_fields(HeadGeometry& head, const std::string& assignments);

/// Names of the fields, for --help.
std::vector<std::string> eye_field_names();
std::vector<std::string> head_field_names();

/// globe_semi_z_mm with which the outer globe meets the cornea at its limbus.
double matching_globe_semi_z_mm(const EyeGeometry& eye);

/// The head of the sample study: right eye with 2.25 D of with-the-rule corneal astigmatism, left eye near
/// emmetropia.
HeadGeometry sample_head();
/// A head drawn from the population in docs/method/phantom.md; one seed, one head.
HeadGeometry random_head(unsigned long long seed);
/// The same head with keratoconus of both eyes, drawn from docs/method/phantom.md's table of cones.
HeadGeometry random_keratoconus(unsigned long long seed);

}  // namespace emmetrope::phantom
