#pragma once
#include "segmentation/fit/eye_fit.hpp"

namespace emmetrope::segmentation {

/// Pixels of a scanner without filters whose edges would be as soft as the sharpest of the images that were fitted: their
/// pixel over its fitted sharpness, where that is below 1.
double resolved_mm(const EyeFit& fit);

/// What the wall's layers leave unknown of a globe's length and diameters (standard deviation), nearly alike along all axes
/// and of one sign in a person's eyes (docs/evidence/worlds.md).
double error_of_layers_mm(const EyeFit& fit);

/// What a cornea that is hardly seen, in T1 or behind a window of the scanner, leaves unknown of the chamber's depth (standard
/// deviation).
double error_of_chamber_mm(const EyeFit& fit);

/// What tells images apart that err otherwise, after the contrast's name: ", dark fat", ", fine pixels", ", soft edges" or
/// nothing.
const char* images_of_layers(const EyeFit& fit);

}  // namespace emmetrope::segmentation
