#pragma once
#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "segmentation/fit/eye_parameters.hpp"
#include "segmentation/fit/eye_surfaces.hpp"

namespace emmetrope::segmentation {

/// How a stack samples space.
struct StackSampling {
  Eigen::Vector3d along_row, along_column, normal;  ///< LPS unit vectors
  double row_cutoff_per_mm = 0;  ///< k-space cut-off along the row: 1 / (2 spacing) if not interpolated
  double column_cutoff_per_mm = 0;
  double thickness_mm = 0;  ///< of the box profile
  int subslices = 1;
  double noise = 0.05;  ///< sigma of one channel, in the unit of intensities
  /// Prior spread about 0 of the chemical shift of fat: mm along row and column; 0: there is none.
  Eigen::Vector2d fat_shift_sigma_mm = Eigen::Vector2d::Zero();
  double fat = 1;  ///< its intensity, positive
  /// How much darker muscle is than the globe's wall: this share of the difference of the wall's layers.
  double muscle_under_wall = 0;
  /// Prior spread about 0 of the coil's second-order coefficients.
  double coil_curvature_sigma = 0.2;
  double slice_cutoff_per_mm = 0;  ///< of encoded slices (3-D); 0: they have a box profile
};

/// Fat is at least this much brighter than muscle, where its share of the surroundings is computed.
inline constexpr double least_fat_over_muscle = 0.2;

/// Fat's signal in what surrounds the globe: what of it is not fat is muscle.
double fat_signal(double around, double muscle, double fat);

/// Which part of the eye explains a voxel. Chosen once a pass, so that the cost stays smooth.
enum class Zone : std::uint8_t {
  front,  ///< air, lid, cornea, aqueous, iris, front of the lens
  rear,   ///< back of the lens, vitreous, wall, what surrounds the globe
};

/// What a voxel tells about: residuals are judged, and weights widened, part by part.
enum class Part : std::uint8_t { wall, surroundings, lens, cornea, lid, vitreous };
inline constexpr std::size_t part_count = 6;
inline constexpr const char* part_names[part_count] = {
    "globe's wall", "surroundings of the globe", "lens and iris", "cornea", "lid", "vitreous"};

/// The surfaces that light meets.
enum class OpticalSurface { cornea_anterior, cornea_posterior, lens_anterior, lens_posterior, retina };

/// One voxel that is compared with the model.
struct Sample {
  Eigen::Vector3d position;  ///< LPS, nominal centre
  float value = 0;           ///< in the unit of intensities
  float deviation = 1;       ///< standard deviation of its noise, frozen within a pass
  std::uint8_t stack = 0;
  Zone zone = Zone::rear;
  Part part = Part::vitreous;
  bool near_wall = false, near_lens = false, near_cornea = false;
  std::vector<std::uint8_t> bumps;  ///< those that matter here
  /// What the image has here beyond planar edges (curved_edges.hpp), without the coil; frozen within a pass.
  float curved = 0;
};

/// One row of the Jacobian: dense storage, the touched places listed.
class SparseRow {
 public:
  explicit SparseRow(int size) : value_(size, 0.0), listed_(size, 0) {}
  void clear() {
    for (const int i : touched_) {
      value_[i] = 0;
      listed_[i] = 0;
    }
    touched_.clear();
  }
  void add(int index, double derivative) {
    if (!listed_[index]) {
      listed_[index] = 1;
      touched_.push_back(index);
    }
    value_[index] += derivative;
  }
  void scale(double factor) {
    for (const int i : touched_) value_[i] *= factor;
  }
  double operator[](int index) const { return value_[index]; }
  const std::vector<int>& touched() const { return touched_; }

 private:
  std::vector<double> value_;
  std::vector<char> listed_;
  std::vector<int> touched_;
};

/// Voxel intensities of an eye: nested tissues, each entering through its surface's edge response, averaged
/// through a slice that is not encoded, times the coil's profile; without noise. Intensity is linear in nested layers, so that
/// a cornea thinner than the blur is right.
///
/// Front: air + (lid - air) H_lid + (cornea - lid) H_front + (aqueous - cornea) H_back + (lens - aqueous)
/// H_lens + nucleus H_nucleus + (iris - aqueous) (H_iris_front - H_iris_back_or_lens) H_pupil
/// Rear:  surround(n) (1 - H_outer) + fat(n) (H_outer - H_fat) + wall (H_outer - H_inner)
/// + layering (H_between - (1 - share) H_inner - share H_outer) + vitreous H_inner
/// + (lens - vitreous) H_lens + nucleus H_nucleus
/// The wall has a brighter inner layer (retina and choroid, `share` of its thickness) and a darker outer one (sclera);
/// `wall` is the mean of both. The lens has a nucleus.
/// H_fat is H_outer displaced by the chemical shift: the fat of what surrounds the globe lies over the wall
/// on one side and leaves a gap on the other, muscle stays in its place. surround(n) tells their shares:
/// muscle is as bright as the wall (in T2 darker, muscle_under_wall), fat as its brightest surroundings. The coil
/// multiplies by exp(log_gain + polynomial in (position - reference) / 12 mm along the stack's row, column and normal,
/// without constant).
class ForwardModel {
 public:
  ForwardModel(ParameterLayout layout, std::vector<StackSampling> stacks, Eigen::Vector3d coil_reference);

  /// The same model whose gaze and whose eye's horizontal are counted along other axes than the patient's: columns towards
  /// the head's left, back and top, in LPS.
  ForwardModel along(const Eigen::Matrix3d& head_axes) const;
  const Eigen::Matrix3d& head_axes() const { return head_axes_; }
  /// Of the eye, out of it; LPS.
  Eigen::Vector3d axis(const Eigen::VectorXd& parameters) const;
  /// Across it, towards the head's left where the eye looks ahead; LPS.
  Eigen::Vector3d horizontal(const Eigen::VectorXd& parameters) const;
  /// Horizontal and vertical angle by which the eye has an axis.
  Eigen::Vector2d gaze_deg(const Eigen::Vector3d& axis_in_lps) const;

  /// The same model of an eye whose cornea has a free form.
  ForwardModel with_irregular_cornea() const;

  const ParameterLayout& layout() const { return layout_; }
  const std::vector<StackSampling>& stacks() const { return stacks_; }
  std::vector<StackSampling>& stacks() { return stacks_; }
  /// Where the coil's polynomial has its origin, and the eye its middle, about; LPS, mm.
  const Eigen::Vector3d& coil_reference() const { return coil_reference_; }

  /// A model at fixed parameters.
  /// \pre parameters.size() == layout.size()
  class AtParameters {
   public:
    AtParameters(const ForwardModel& model, const Eigen::VectorXd& parameters);
    /// Intensity of a sample; the row, where given, is cleared and receives the derivatives. The derivative
    /// of the distance's normalisation (second order in the distance to the edge) is left out.
    double intensity(const Sample& sample, SparseRow* row) const;
    /// The coil's factor at a sample.
    double coil(const Sample& sample) const;
    /// A point of the stack's LPS in the eye frame.
    Eigen::Vector3d to_eye(const Eigen::Vector3d& position, int stack) const;
    /// Signed distances (mm, positive inside, first order) at a point of the eye frame: what voxels are
    /// chosen by.
    struct Distances {
      double lid, cornea_front, cornea_back, lens, lens_front, globe, outer, iris;
      Eigen::Vector3d direction;  ///< scaled unit direction from the globe's centre
    };
    Distances distances(const Eigen::Vector3d& p) const;
    /// The wall's fields at a point of the eye frame, from some bumps.
    WallFields wall_fields(const std::vector<std::uint8_t>& bumps, const Eigen::Vector3d& p) const;
    /// Displacement (mm) in a scaled direction, from all bumps.
    double displacement(const Eigen::Vector3d& direction) const;

    /// A surface at a point of the eye frame: signed distance to first order, unit normal out of the tissue's
    /// inside, and (where a row is given) the derivatives of the distance by all parameters, pose included.
    struct SurfacePoint {
      double distance;
      Eigen::Vector3d outward;
    };
    /// The cornea's surface at a point of the eye frame.
    EyeSurface cornea_at(const Eigen::Vector3d& p, bool back) const;
    /// Signed distance (mm) of the outer globe from the anterior cornea's point at the limbus in a quadrant
    /// (0 to 3), with its derivatives by the shape parameters.
    double limbus_misfit(int quadrant, SparseRow* row) const;
    SurfacePoint at_surface(OpticalSurface surface, const Eigen::Vector3d& p, SparseRow* row) const;

   private:
    std::optional<CorneaField> cornea_field(const Eigen::Vector3d& p) const;
    std::array<double, coil_count> coil_terms(const Sample& sample) const;
    /// A surface's edge response, averaged through a sub-slice.
    struct Edge {
      double value = 1;  ///< 0 far outside, 1 far inside
      double d_f = 0;    ///< by the surface's F
      double d_log_sharpness = 0, d_log_sharpness_ratio = 0, d_log_sharpness_through = 0, d_filter = 0;
    };
    Edge edge(const EyeSurface& surface, int stack) const;
    class SignalSum;

    const ForwardModel& model_;
    const Eigen::VectorXd& a_;
    Eigen::Matrix3d eye_from_lps_, d_eye_from_lps_d_horizontal_, d_eye_from_lps_d_vertical_;
    struct StackInEye {
      Eigen::Vector3d row, column, normal;
      double inverse_kx, inverse_ky, inverse_kz, filter;  ///< kz: 0 where slices have a box profile
      Eigen::Matrix3d turn;                               ///< of the head, in LPS
      Eigen::Vector3d place;      ///< a point x of the stack lies at turn x + place in the first
      Eigen::Vector3d fat_shift;  ///< in the eye frame
      bool has_fat_shift = false;
    };
    std::vector<StackInEye> stack_in_eye_;
  };

 private:
  ParameterLayout layout_;
  std::vector<StackSampling> stacks_;
  Eigen::Vector3d coil_reference_;
  Eigen::Matrix3d head_axes_ = Eigen::Matrix3d::Identity();
  std::vector<Eigen::Vector3d> bumps_;
};

}  // namespace emmetrope::segmentation
