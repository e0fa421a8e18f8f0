#pragma once
#include <vector>

#include "pipeline/base/power_vector.hpp"
#include "pipeline/eye/model/eye_model.hpp"

namespace emmetrope::correction {

/// Refraction of one direction of the visual field.
struct FieldPoint {
  /// Of the line of sight against the eye's axis, towards eye +x and +y
  double horizontal_deg = 0, vertical_deg = 0;
  PowerVector refraction;  ///< least-squares fit of ray slopes, in the entrance pupil plane across that line
};

/// Refraction over a square grid of the visual field out to `reach_deg` each way; directions that
/// the retina behind its equator does not see, or of whose light too little comes through, are left out. Rows from the top.
std::vector<FieldPoint> peripheral_refraction(const EyeModel& eye, double wavelength_nm, double reach_deg,
                                              int points_across);

}  // namespace emmetrope::correction
