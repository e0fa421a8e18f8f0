#pragma once
#include "segmentation/intake/volume.hpp"

namespace emmetrope::segmentation {

/// The voxels within `reach_mm` of a point along each axis, in an order that does not depend on how they were
/// stored: rows run to the patient's left (to the back, in sagittal slices), columns to the back or up. Where
/// voxels lie on one lattice, slices are normal to the longest side of a voxel; of sides equal to 2 % they
/// are sagittal before axial before coronal, as 3-D acquisitions of heads mostly are; never normal to a readout
/// that the header tells, and slices that were acquired one by one stay. Values, positions and what is known of the
/// displacement of fat stay; where no readout is told, sagittal slices are held to be read out up and down.
/// \pre stack.slices() > 0
Stack canonical_part(const Stack& stack, const Eigen::Vector3d& centre_lps, double reach_mm);

}  // namespace emmetrope::segmentation
