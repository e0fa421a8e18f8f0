#pragma once
#include <vtkImageData.h>
#include <vtkSmartPointer.h>

#include "pipeline/report/figures/slices.hpp"

namespace emmetrope::report {

/// VTK's side of a Volume; for the .cpp files that adapt VTK only.
struct Volume::Impl {
  vtkSmartPointer<vtkImageData> image;  ///< spacing 1, origin 0
  Eigen::Matrix4d lps_from_voxel;
};

}  // namespace emmetrope::report
