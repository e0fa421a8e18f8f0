#pragma once
#include <filesystem>

#include "segmentation/fit/eye_fit.hpp"

namespace emmetrope::segmentation {

/// Writes points on the fitted surfaces as a PLY of vertices (binary, LPS): x, y, z, nx, ny, nz, label (0
/// anterior cornea, 1 posterior cornea, 2 anterior lens, 3 posterior lens, 4 retina), sigma_mm (of the
/// surface along its normal, from the fit's covariance, pose included).
/// \throw Error (not_writable)
void write_boundary(const std::filesystem::path& file, const EyeFit& fit);

}  // namespace emmetrope::segmentation
