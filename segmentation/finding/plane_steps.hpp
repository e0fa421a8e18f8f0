#pragma once
#include <optional>

#include "segmentation/intake/volume.hpp"

namespace emmetrope::segmentation {

/// Two neighbouring planes of a stack between which the image changes more than between others near them: a plane is
/// missing there, or the head moved.
struct PlaneStep {
  int axis = 0;      ///< 0: of columns, 1: of rows, 2: of slices
  int first = 0;     ///< the planes are this one and the next
  double ratio = 1;  ///< of the change to that at both sides, as if it grew with the distance
};

/// The largest step across a ball, if one is larger than the two at both sides of it. How much the image changes is told
/// by the correlation of whole planes, of 60 cm2 of the head or more, smoothed by 1.5 mm. Sides of a voxel shorter than
/// two thirds of the longest are no slices'; gaps that slices' positions tell, and places where a head begins to be
/// blanked, are passed over with their neighbours.
std::optional<PlaneStep> largest_plane_step(const Stack& stack, const Eigen::Vector3d& centre_lps,
                                            double radius_mm);

}  // namespace emmetrope::segmentation
