#pragma once
#include <Eigen/Core>
#include <array>
#include <string>

namespace emmetrope {

/// What a biconic leaves of an irregular cornea: the Zernike terms of orders 3 to 7 over a circle of 4.5 mm
/// radius (OSA order and normalisation), as a depth, each less its value at the apex, which stays where it
/// is. Beyond 6 mm from the axis, which no cornea reaches, a term stays what it is at 6 mm.
inline constexpr int corneal_form_terms = 30;
inline constexpr int corneal_form_order = 7;
inline constexpr int corneal_form_first = 6;  ///< OSA index of the first term
inline constexpr double corneal_form_radius_mm = 4.5;
inline constexpr double corneal_form_reach_mm = 6;

/// The terms at (x, y) and their gradients by x and y (1/mm).
struct CornealForm {
  std::array<double, corneal_form_terms> value;
  std::array<Eigen::Vector2d, corneal_form_terms> gradient_per_mm;
};
CornealForm corneal_form(double x_mm, double y_mm);

/// "cornea_zernike_06_um" for 0: its name in fit.json.
std::string corneal_form_name(int term);

}  // namespace emmetrope
