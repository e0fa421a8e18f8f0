#pragma once
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <map>
#include <string>
#include <vector>

#include "pipeline/base/json.hpp"
#include "pipeline/base/laterality.hpp"
#include "pipeline/eye/parametric/corneal_form.hpp"
#include "pipeline/eye/population/population.hpp"

namespace emmetrope {

/// The eye that is fitted to MR voxels, as numbers: what fit.json holds and what meshes are made from.
/// Eye frame; depths d = -z in mm.
struct ParametricEye {
  Laterality laterality = Laterality::od;
  Eigen::Isometry3d lps_from_eye = Eigen::Isometry3d::Identity();

  /// Anterior cornea: curvature matrix C = [[c + j0, j45], [j45, c - j0]] (1/mm), depth = S / (1 + sqrt(1 -
  /// v'(I + Q)v)) with v = Cx, S = x'v: a biconic whose Q is cornea_q + split in the steep meridian and
  /// cornea_q - split in the flat one. A cornea without cylinder has one Q: the split is cornea_q_split times
  /// j / sqrt(j^2 + e^2) with j^2 = j0^2 + j45^2 and e of 0.25 D, so that all is smooth where j vanishes.
  double cornea_c_per_mm = 1 / 7.8, cornea_j0_per_mm = 0, cornea_j45_per_mm = 0;
  double cornea_q = -0.2, cornea_q_split = 0;
  double cornea_thickness_mm = 0.55;
  double cornea_back_ratio = 0.83;  ///< posterior radius over anterior in each meridian
  /// Free form (corneal_form.hpp) of an irregular cornea, added to the anterior depth: um of depth; all 0: a
  /// biconic. The posterior cornea has the same form this many times as deep.
  std::array<double, corneal_form_terms> cornea_zernike_um{};
  double cornea_back_form_ratio = 1;

  double anterior_chamber_depth_mm = 3.4;  ///< apex to lens front, cornea included
  double lens_thickness_mm = 3.8;
  double lens_anterior_radius_mm = 10.5, lens_posterior_radius_mm = 6.0;  ///< magnitudes
  double lens_anterior_q = -3, lens_posterior_q = -1;
  Eigen::Vector2d lens_decentre_mm{0, 0};
  Eigen::Vector2d lens_tilt_deg{0, 0};  ///< about mid-lens: first about +x, then about +y
  double lens_equator_radius_mm = 4.6;

  /// Vitreo-retinal interface: ellipsoid with centre on the axis at depth axial_length_mm - semi_axes.z, and
  /// a radial displacement u(n) (mm, in the scaled sphere of radius 11 mm): the point along scaled unit
  /// direction n lies at scaled radius 1 + u(n)/11. u is a sum of Gaussians exp(-angle^2 / (2 width^2)) about
  /// unit directions.
  double axial_length_mm = 23.8;  ///< of the ellipsoid; with u: axial_length_mm + u(pole) semi_axes.z / 11
  Eigen::Vector3d globe_semi_axes_mm{11.5, 11.4, 11.2};
  std::vector<Eigen::Vector3d> displacement_directions;
  std::vector<double> displacement_mm;
  double displacement_width_rad = 0.3;

  double iris_diameter_mm = 4;
  /// Equivalent index of the lens: a population's, as no image shows it; fit.json has none.
  double lens_index = lens_index_at_age(usual_age_years).mean;

  /// Covariance of named parameters (the names in fit.json), and which are measured and which are priors.
  std::vector<std::string> parameter_names;
  Eigen::MatrixXd covariance;
  std::map<std::string, std::string> source;  ///< "mri", "mri+prior", "prior", "keratometry", ... by name
  /// What was known of a parameter before the images were seen: standard deviation by name; absent: nothing.
  std::map<std::string, double> prior_sigma;

  /// C, the curvature matrix of the anterior cornea, and Q, its matrix of conic constants.
  Eigen::Matrix2d cornea_curvature_per_mm() const;
  Eigen::Matrix2d cornea_conic_constants() const;
  bool has_irregular_cornea() const;
  /// The anterior cornea's free form, mm of depth.
  double cornea_form_mm(double x_mm, double y_mm) const;
  /// The anterior cornea as a textbook biconic, without its free form; the posterior one has the same conic
  /// constants.
  struct Biconic {
    double steep_radius_mm, flat_radius_mm, steep_q, flat_q;
    double steep_axis_deg;  ///< 0 <= axis < 180
  };
  Biconic cornea_biconic() const;
  /// Depth of the anterior / posterior cornea at (x, y);
  /// \pre inside the surface's reach
  double cornea_anterior_depth_mm(double x_mm, double y_mm) const;
  double cornea_posterior_depth_mm(double x_mm, double y_mm) const;
  /// u in the scaled unit direction n.
  double displacement_at(const Eigen::Vector3d& scaled_direction) const;
  /// Point of the interface, eye frame, along scaled unit direction n.
  Eigen::Vector3d retina_point(const Eigen::Vector3d& scaled_direction) const;
  /// Unit normal of the interface at retina_point(n), into the vitreous (towards the light).
  Eigen::Vector3d retina_normal(const Eigen::Vector3d& scaled_direction) const;
  /// Centre of the globe's ellipsoid, eye frame.
  Eigen::Vector3d globe_centre_mm() const;
  /// Apex to the interface on the axis.
  double pole_depth_mm() const;

  /// A parameter by its name in fit.json. Plain fields, lens_index among them, have their own names; parts of vectors are
  /// lens_decentre_x_mm, lens_decentre_y_mm, lens_tilt_x_deg, lens_tilt_y_deg, globe_semi_axis_{x,y,z}_mm,
  /// displacement_000_mm and on, cornea_zernike_06_um to cornea_zernike_35_um. The pose is apex_{x,y,z}_mm
  /// (LPS) with gaze_horizontal_deg (straight ahead 0, positive to the patient's left) and gaze_vertical_deg
  /// (positive upwards); setting a gaze turns the eye about its apex, its x axis stays horizontal.
  ///
  /// \throw Error (fault) for an unknown name
  double get(const std::string& name) const;
  void set(const std::string& name, double value);
};

/// The unit of astigmatism below which the two conic constants of a cornea approach one another, 1/mm.
inline constexpr double cornea_split_scale_per_mm = 0.25 * per_mm_of_keratometric_D;

/// Whether `get` and `set` know the name.
bool has_parameter(const ParametricEye& eye, const std::string& name);
/// "displacement_012_mm" for 12.
std::string displacement_name(std::size_t index);

/// The schema of fit.json's "eye": every field above but lens_index, "parameters" (name, value, sigma, source) and
/// "covariance".
Json to_json(const ParametricEye& eye);
/// \throw Error (input_invalid) naming the key
ParametricEye parametric_eye_from_json(const Json& json);

}  // namespace emmetrope
