#pragma once
#include <Eigen/Core>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/eye/parametric/corneal_form.hpp"
#include "segmentation/finding/eye_candidates.hpp"

/// The numbers that are fitted, as one vector: names, places, populations.
namespace emmetrope::segmentation {

/// Places in the parameter vector. Names, units and frames are those of pipeline/eye/parametric/parametric_eye.hpp where
/// it has them, while an eye is fitted along its model's head axes; intensities are relative to the reference intensity of
/// the study.
enum Parameter : int {
  apex_x,
  apex_y,
  apex_z,
  gaze_horizontal,
  gaze_vertical,
  cornea_c,
  cornea_j0,
  cornea_j45,
  cornea_q,
  cornea_q_split,
  cornea_thickness,
  cornea_back_ratio,
  anterior_chamber_depth,
  lens_thickness,
  lens_anterior_radius,
  lens_posterior_radius,
  lens_anterior_q,
  lens_posterior_q,
  lens_decentre_x,
  lens_decentre_y,
  lens_tilt_x,
  lens_tilt_y,
  lens_equator_radius,
  axial_length,
  globe_x,
  globe_y,
  globe_z,
  wall_lateral,
  wall_axial,
  wall_inner_share,  ///< of the wall's thickness: its inner layer, retina and choroid
  iris_offset,       ///< middle of the iris behind the lens' front vertex, at 3 mm from the axis
  iris_slope,
  iris_half_thickness,
  pupil_radius,
  lid_thickness,
  lid_tilt_x,
  lid_tilt_y,
  lid_xx,
  lid_yy,
  lid_xy,
  vitreous,
  aqueous,
  wall,           ///< mean of its layers
  wall_layering,  ///< the inner layer less the outer one, the sclera
  cornea,
  lens,
  lens_nucleus,  ///< less the cortex, which is `lens`
  iris,
  lid,
  air,
  surround,
  eye_parameter_count
};

/// What each stack adds to the vector, relative to its first place.
enum StackParameter : int {
  coil_first = 0,  ///< 9 coefficients of a second-order polynomial in row, column, normal: ForwardModel
  coil_count = 9,
  coil_second_order = 3,  ///< the first of them that is not linear
  log_gain = 9,           ///< against the first stack
  shift_first = 10,       ///< LPS mm, against the first stack
  log_sharpness = 13,     ///< log of an edge's slope over that of the nominal k-space cut-off
  /// How the head has turned against the first stack: rotation vector (LPS, degrees) about the coil's
  /// reference, before the shift.
  turn_first = 14,
  /// By how much the image shows fat displaced against water (chemical shift): mm along the row, along the
  /// column.
  fat_shift_first = 17,
  /// Log of the cut-off along the row over that along the column, beyond what they nominally are.
  log_sharpness_ratio = 19,
  k_space_filter = 20,         ///< 0: none, 1: a Hann window (edge_response.hpp); edges are enhanced below 0
  log_sharpness_through = 21,  ///< as log_sharpness, through encoded slices
  stack_parameter_count = 22
};

/// What a filter takes from an edge's slope, 1 - f/2, a cut-off farther out by exp(0.6 f) gives back within 10 %
/// for f from -0.6 to 1: so that
/// sharpness and filter are told apart.
inline constexpr double log_cutoff_per_filter = 0.6;

/// Where things are in the vector of one eye with its stacks and fields.
struct ParameterLayout {
  int stacks = 1;
  int bumps = 0;  ///< Gaussians of the displacement of the wall, and as many of the background
  /// Whether the cornea has a free form (pipeline/eye/parametric/corneal_form.hpp) on its biconic.
  bool irregular_cornea = false;

  int stack(int index) const { return eye_parameter_count + index * stack_parameter_count; }
  int displacement() const { return stack(stacks); }
  int background() const { return displacement() + bumps; }
  /// Terms of the free form (um of depth), then how many times as deep the posterior cornea has it.
  int corneal_form() const { return background() + bumps; }
  int back_form_ratio() const { return corneal_form() + corneal_form_terms; }
  int size() const { return corneal_form() + (irregular_cornea ? corneal_form_terms + 1 : 0); }
  /// The name in fit.json: ParametricEye's where it has one.
  std::string name(int index) const;
};

/// Normal priors of parameters before the image is seen; an infinite sigma is none.
struct Priors {
  Eigen::VectorXd mean = {}, sigma = {};
  /// Cornea and wall are equally bright but for this, in the unit of intensities; infinite: not asked for.
  double cornea_like_wall_sigma = std::numeric_limits<double>::infinity();
  /// How bright the wall's inner layer may be, over the vitreous; infinite: not asked.
  double brightest_inner_layer = std::numeric_limits<double>::infinity();
  /// By how much the mean of cornea_c changes with the axial length, 1/mm per mm: longer eyes have flatter
  /// corneas.
  double curvature_per_axial_length = 0;
  /// Inverse of the correlation matrix of the cornea's free form, whose terms go together; empty: no form.
  /// All else is independent.
  Eigen::MatrixXd corneal_form_information = {};
};

/// Population and acquisition priors (values and sources: docs/method/segmentation.md) about a start vector:
/// parameters with no population mean (pose, intensities) are weakly held at `start` or not at all. Where the
/// patient's age is known, the radii of the lens, and of an adult the depth of the chamber and the thickness
/// of the lens, are expected as they are at that age.
Priors population_priors(const ParameterLayout& layout, const Eigen::VectorXd& start, Weighting weighting,
                         std::optional<double> age_years = {});

/// The same for a cornea that is not regular (keratoconus): with the prior of its free form, and of its
/// biconic with wider spreads.
/// \param layout  with the irregular cornea
Priors irregular_cornea_priors(const Priors& of_regular, const ParameterLayout& layout);

/// What is expected of cornea_c in an eye of this length.
double expected_curvature(const Priors& priors, double axial_length_mm);

/// A vector at the population means, pose and intensities zero.
Eigen::VectorXd population_mean(const ParameterLayout& layout);

/// Directions on the unit sphere (x, y, z of the eye frame, scaled by the globe's half axes) where the wall
/// may be displaced: alike on both sides of the eye, above and below; none over the cornea.
std::vector<Eigen::Vector3d> bump_directions();
inline constexpr double bump_width_rad = 0.3;

}  // namespace emmetrope::segmentation
