#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "pipeline/base/json.hpp"
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

/// What the fitted eye has at a point of its frame.
Label label_at(const ForwardModel::AtParameters& eye, const Eigen::VectorXd& parameters,
               const Eigen::Vector3d& p);

/// Writes the labels of an eye into a volume on the stack's grid (one vector a slice): the tissue at each
/// voxel's centre.
/// \param view  index of the stack in the fit
void rasterise(const EyeFit& fit, std::size_t view, Laterality laterality,
               std::vector<std::vector<std::uint8_t>>& labels);

/// labels.json: {"labels": [{"value", "name"}]}.
Json label_names();

}  // namespace emmetrope::segmentation
