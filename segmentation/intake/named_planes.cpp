#include "segmentation/intake/named_planes.hpp"

#include <fmt/format.h>

#include <array>
#include <tuple>

namespace emmetrope::segmentation {

int count_planes(const Stack& stack, int axis) {
  return std::array{stack.columns, stack.rows, stack.slices()}[axis];
}

std::string planes_in_words(const Stack& stack, int axis, int first, int last) {
  struct Normal {
    const char *planes, *low_side;
  };
  constexpr std::array<Normal, 3> normals{{{"sagittal", "right"}, {"coronal", "front"}, {"axial", "feet"}}};
  const Eigen::Vector3d direction = std::array{stack.along_row, stack.along_column, stack.normal}[axis];
  Eigen::Index lps = 0;
  direction.cwiseAbs().maxCoeff(&lps);
  const int count = count_planes(stack, axis);
  int low = first + 1, high = last + 1;
  if (direction[lps] < 0) std::tie(low, high) = std::pair{count - last, count - first};
  if (high == low)
    return fmt::format("{} plane {} of {}, counted from the patient's {}", normals[lps].planes, low, count,
                       normals[lps].low_side);
  return fmt::format("{} planes {} {} {} of {}, counted from the patient's {}", normals[lps].planes, low,
                     high == low + 1 ? "and" : "to", high, count, normals[lps].low_side);
}

}  // namespace emmetrope::segmentation
