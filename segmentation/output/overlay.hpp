#pragma once
#include <filesystem>

#include "segmentation/fit/eye_fit.hpp"

namespace emmetrope::segmentation {

/// Six slices of a stack through the eye, cropped to it, with the fitted borders in colour: cornea cyan, iris
/// violet, lens orange, inner wall green, outer wall yellow; in red what lies in the vitreous and is none.
/// \throw Error (not_writable)
void write_overlay(const std::filesystem::path& file, const EyeFit& fit, std::size_t view);

/// The same of a stack that the eye was not fitted to.
/// \param shift  a point of it plus this is where it lies in the first stack of the fit, LPS mm
void write_overlay(const std::filesystem::path& file, const EyeFit& fit, const Stack& other,
                   const Eigen::Vector3d& shift);

/// The same slices with the standardised residual (image minus model) of every voxel that was used: blue
/// below -4, red above 4 sigma, white none.
void write_residuals(const std::filesystem::path& file, const EyeFit& fit, std::size_t view);

/// Slices through a place where no eye could be fitted, without contours.
void write_plain(const std::filesystem::path& file, const Stack& stack, const Eigen::Vector3d& centre);

}  // namespace emmetrope::segmentation
