#pragma once
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/base/frames.hpp"
#include "pipeline/base/laterality.hpp"
#include "pipeline/eye/parametric/parametric_eye.hpp"
#include "segmentation/edges/edge_biometry.hpp"
#include "segmentation/finding/find_eyes.hpp"
#include "segmentation/fit/corneal_irregularity.hpp"
#include "segmentation/fit/least_squares.hpp"
#include "segmentation/fit/observation.hpp"

namespace emmetrope::segmentation {

/// A Part of the image, whose residuals are judged together.
struct RegionFit {
  std::string name;
  int voxels = 0;
  double chi2 = 0;      ///< mean squared standardised residual
  double outliers = 0;  ///< share of voxels beyond 4 sigma
  /// Voxels per independent residual: neighbours' residuals are alike where the model is wrong.
  double correlation = 1;
};

/// What lies in the vitreous, 2 mm from the wall or more, and is none; 0: nothing.
struct IntraocularMass {
  double volume_mm3 = 0;  ///< in the stack that shows most of it
  /// Its mean difference from the vitreous, in steps from there to the surroundings (T1) or to no signal (T2).
  double over_step = 0;
  std::size_t stack = 0;  ///< of the fit, which shows most of it
  std::vector<Eigen::Vector3d> voxels =
      {};  ///< centres of its voxels, where the fit's first stack has them, LPS mm
};

/// A fitted eye.
struct EyeFit {
  ParameterLayout layout;
  Weighting weighting = Weighting::t2;
  std::vector<ObservedStack> stacks;
  ForwardModel model;
  Eigen::VectorXd parameters = {};
  std::vector<int> active = {};     ///< parameters that were free in the last pass
  Eigen::MatrixXd covariance = {};  ///< of them, in this order; priors included, image weighted by its misfit
  Priors priors = {};
  std::vector<Sample> samples = {};    ///< of the last pass
  std::vector<double> residuals = {};  ///< image minus model over the noise, of the samples
  double chi2_per_voxel = 0;           ///< in units of the noise
  /// of each stack: by how much its weights were widened for what the model does not explain
  Eigen::VectorXd misfit = {};
  std::vector<RegionFit> regions = {};  ///< by Part
  int iterations = 0;
  bool converged = false;
  /// Cost of the anterior fit from each start of the apex, lowest first subtracted, in the order of the
  /// starts.
  std::vector<double> start_costs = {};
  Evidence evidence = Evidence::intensities;
  CornealIrregularity irregularity = {};  ///< what decided whether the cornea has a free form
  double slice_displacement_mm = 0;       ///< slice_displacement.hpp
  IntraocularMass mass = {};              ///< that was left out (intraocular_mass.hpp)
  IntraocularMass unexplained = {};       ///< that this fit has in its vitreous all the same
  /// Of the covariance what images of this contrast at this field err by alike, those of the fellow eye too: neither growth
  /// nor the difference of two eyes has it. Empty where that is not known: of labels, and of an estimate from two contrasts.
  Eigen::MatrixXd shared_covariance = {};
  /// What of that images of any contrast have alike: neither a second contrast nor the fellow eye makes it smaller. Empty: of
  /// labels.
  Eigen::MatrixXd common_covariance = {};

  /// Derivatives of the free parameters along the patient's axes by those that were fitted, which the priors' standard
  /// deviations are of (patient_frame.hpp). Empty: they are the same.
  Eigen::MatrixXd turned_by = {};
  /// Of the globe, its horizontal that of the voxels: what its fellow starts from, whatever turns the header.
  Eigen::Vector3d half_axes_along_voxels_mm = {0, 0, 0};

  double value(int parameter) const { return parameters[parameter]; }
  /// Brightness of the wall's inner layer, which the vitreous borders on.
  double inner_wall() const { return value(wall) + (1 - value(wall_inner_share)) * value(wall_layering); }
  /// Whether cornea and lens are in none of its images, as someone took the face off.
  bool front_is_blanked() const { return segmentation::front_is_blanked(stacks); }
  /// As the head moved: from a place in this stack to where the first one has it, but for turns.
  Eigen::Vector3d head_shift_lps(std::size_t stack) const {
    return parameters.segment<3>(layout.stack(static_cast<int>(stack)) + shift_first);
  }
  /// Centre of the globe's ellipsoid.
  Eigen::Vector3d globe_centre_lps() const {
    return parameters.segment<3>(apex_x) -
           (parameters[axial_length] - parameters[globe_z]) * model.axis(parameters);
  }
  /// Standard deviation; of a frozen parameter its prior's, 0 where it is fixed by definition.
  double sigma(int parameter) const;
  /// Standard deviation of the distance from apex to interface along the axis, displacement included.
  double pole_depth_sigma_mm() const;
};

/// What half-level edges say of an eye in each of its views; none where they are not sure of it.
using ViewEdges = std::vector<std::optional<ReadEye>>;
ViewEdges read_edges_of(const FoundEye& eye, const std::vector<const Stack*>& stacks);

/// What the fit of a found eye starts from, and its stacks.
EyeStart start_of(const FoundEye& eye, const ViewEdges& edges, std::optional<double> age_years = {});
std::vector<const Stack*> views_of(const FoundEye& eye, const std::vector<const Stack*>& stacks);

/// Fits one eye to its stacks, which are of one weighting. The order that converges: globe, lens and pose
/// without the cornea, from several starts; the cornea from five depths and more; everything, the likeliest
/// globe; everything once more with weights that know the misfit; and where a test says that the cornea is
/// irregular, and pixels are fine enough, both again with its free form. Where labels are the evidence, intensities, coil and sharpness
/// are known and only shapes, pose and the head's shifts are free.
/// \param advance  called `fit_steps` times in all
/// \throw Error (no_result) when the data cannot support a fit
EyeFit fit_eye(const std::vector<const Stack*>& stacks, const EyeStart& start, Weighting weighting,
               const std::function<void()>& advance = {}, Evidence evidence = Evidence::intensities);
inline constexpr int fit_steps = 4;

/// Images that err alike (EyeFit::shared_covariance): "T1", "T1, dark fat", "T2", "T2, fine pixels"
/// or "T2, soft edges".
std::string alike_images(const EyeFit& fit);

/// The eye for the next stages: named parameters, covariance, priors and sources (Origin::of_images).
ParametricEye to_parametric_eye(const EyeFit& fit, Laterality laterality);

}  // namespace emmetrope::segmentation
