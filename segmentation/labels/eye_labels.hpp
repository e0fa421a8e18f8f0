#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "pipeline/base/json.hpp"
#include "segmentation/finding/sampling.hpp"
#include "segmentation/fit/eye_fit.hpp"

namespace emmetrope::segmentation {

/// Voxel labels; the left eye's are these plus 10.
enum class Label : std::uint8_t {
  none = 0,
  cornea = 1,
  anterior_chamber = 2,
  iris = 3,
  lens = 4,
  vitreous = 5,
  wall = 6
};
inline constexpr int left_eye_offset = 10;

/// A fitted eye's labels in a stack. Of an eye whose front was blanked the wall and the vitreous, where the image is.
class EyeInStack {
 public:
  /// \param view  of the fit, whose LPS the stack's is
  /// \param shift  of the head from the stack to that view, mm
  EyeInStack(const EyeFit& fit, std::size_t view, const Stack& stack,
             const Eigen::Vector3d& shift = Eigen::Vector3d::Zero());
  /// \param lps  in the stack
  Label at(const Eigen::Vector3d& lps) const;

 private:
  const EyeFit& fit_;
  ForwardModel::AtParameters eye_;
  int view_;
  Sampler sampler_;
  Eigen::Vector3d shift_;
  BlankedRegion blanked_;
};

/// Writes the labels of an eye into a volume on the stack's grid (one vector a slice): the tissue at each
/// voxel's centre.
/// \param view  index of the stack in the fit
void rasterise(const EyeFit& fit, std::size_t view, Laterality laterality,
               std::vector<std::vector<std::uint8_t>>& labels);

/// labels.json: {"labels": [{"value", "name"}]}.
Json label_names();

}  // namespace emmetrope::segmentation
