#pragma once
#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "correction/prescription/peripheral.hpp"
#include "correction/prescription/uncertainty.hpp"
#include "correction/search/real_lenses.hpp"
#include "correction/search/search.hpp"
#include "pipeline/base/json.hpp"
#include "pipeline/base/progress.hpp"
#include "pipeline/eye/measured/uncertain_optics.hpp"
#include "pipeline/eye/population/limits.hpp"
#include "raytrace/wavefront/wavefront.hpp"

namespace emmetrope::correction {

/// What is asked for.
struct PrescriptionSettings {
  SharpnessCriterion criterion = SharpnessCriterion::gradient_energy;
  std::string
      chart;  ///< scene to judge sharpness on, where the retina looks if by its name; empty: refraction_chart
  double vertex_distance_mm = 12;
  double pupil_mm = 3;  ///< iris aperture
  double wavelength_nm = 589.3;
  Eigen::Vector2d fovea_mm{0, 0};  ///< on the retina from the pole
  double plano_cylinder_distance_mm = 10;
  double plano_cylinder_index = 1.5;
  SpectacleSettings spectacle;  ///< of the toric meniscus
  std::uint64_t seed = 1;
  Verbosity verbosity;

  /// \throw Error (usage) naming the field
  void check() const;
};

/// One row of the sweep of the paper's Fig. 7: the plano-cylinder at its best axis, all radii, the best among
/// them.
struct SweepRow {
  double radius_mm = 0, power_D = 0;
  std::array<double, all_criteria.size()> sharpness{};
};

/// What the axis of the plano-cylinder is from.
enum class AxisFrom {
  sharpness,   ///< sought with the radius
  refraction,  ///< the eye's own, as the full correction has it: the cylinder leaves too much blur to tell
  convention   ///< 180 degrees: an eye without astigmatism
};

/// The paper's experiment.
struct PlanoCylinderResult {
  PlanoCylinder lens;
  AxisFrom axis_from = AxisFrom::sharpness;
  double sharpness = 0;
  double radius_curvature_per_mm2 = 0;  ///< d^2 ln(sharpness) / d radius^2 at the optimum
  SearchResult search;
  std::vector<SweepRow> sweep;
};

/// Everything about one eye's correction, vergences at the vertex distance.
struct Prescription {
  PrescriptionSettings settings;
  PowerVector refraction;  ///< the optimum of image sharpness
  SearchResult search;
  double sharpness_without_lens = 0;
  std::vector<RealLens> lenses;  ///< thin lens, toric meniscus and contact lens, each at its sharpest
  PlanoCylinderResult plano_cylinder;
  raytrace::Wavefront wavefront;
  raytrace::RefractionCriteria check;
  std::vector<FieldPoint> field;  ///< refraction over the visual field

  /// Retinal images behind all of it; the sweep's pictures are a drawing and not among them.
  int images() const;
};

/// What sharpness is judged on: the refraction chart or a chart by its name, where the settings' point of the retina
/// looks; or a scene as it is.
/// \throw Error (usage) for one that is near by, or that the point looks past; (input_invalid) where the retina does
/// not reach; (no_result) where no light leaves the eye
std::shared_ptr<const raytrace::Scene> judged_scene(const EyeModel& eye,
                                                    const PrescriptionSettings& settings);

/// The thin lens of the sharpest image.
/// \throw Error (no_result) when none is found, or the wavefront asks for one beyond those that are sought, with the
/// reason
SearchResult sharpest_lens(const raytrace::Tracer& tracer, const EyeModel& eye,
                           const PrescriptionSettings& settings);

/// Finds the lens by image sharpness and by wavefront.
/// \throw Error (no_result) when no sharpest lens is found, with the reason
Prescription prescribe(const raytrace::Tracer& tracer, const EyeModel& eye,
                       const PrescriptionSettings& settings);

/// M by the least-squares fit of ray slopes, at the settings' vertex distance: quick, for derivatives.
PowerVector refraction_by_spot(const EyeModel& eye, const PrescriptionSettings& settings);

/// A refraction known from the clinic has been combined with what the images say: the result is then no
/// independent measurement.
struct Calibration {
  PowerVector given;  ///< at the settings' vertex distance
  double sigma_D = 0.25;
  double innovation_sigma = 0;  ///< normalised innovation: how far it was from what the eye said
  double index_before = 0;
  Measured index_after;
  bool index_was_known = false;  ///< it has then stayed, and the eye's shape has moved
  PowerVector before;            ///< what the eye said without it
  Eigen::Matrix3d covariance_before = Eigen::Matrix3d::Zero();
  std::array<Origin, 3> origins_before{"model", "model", "model"};  ///< of its M, J0, J45
};

/// Where the numbers' uncertainty comes from.
struct PrescriptionUncertainty {
  std::vector<BudgetLine> budget;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< of M, J0, J45, sampling included
  struct Value {
    std::string measurement;
    BudgetLine sigma_after;
  };
  std::vector<Value> if_measured;                            ///< what a further measurement would leave
  std::array<Origin, 3> origins{"model", "model", "model"};  ///< of M, J0, J45
  std::vector<std::string> data;  ///< what the eye was learnt from beside its images, in order
  std::optional<Calibration> calibration;
};
/// reason_of_contradiction() of the refraction that was given; empty where none was.
std::string contradiction_in(const PrescriptionUncertainty& uncertainty);
/// \param eye  what is known of it by now; null for a schematic eye, whose geometry is exact: what is left is
///   the image's sampling
PrescriptionUncertainty uncertainty_of(const Prescription& prescription, const UncertainOptics* optics,
                                       const std::optional<Calibration>& calibration = {});

/// prescription.json of the case folder.
/// \param laterality  "od", "os", or empty for a schematic eye
Json to_json(const Prescription& prescription, const PrescriptionUncertainty& uncertainty,
             const std::string& laterality);

}  // namespace emmetrope::correction
