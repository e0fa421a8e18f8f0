#pragma once
#include <cmath>

#include "pipeline/eye/population/limits.hpp"

/// What no scan of a head has: beyond it a header is wrong, and what it would give is a plausible eye of
/// another size.
namespace emmetrope::segmentation {

inline constexpr double least_spacing_mm = 0.05, largest_spacing_mm = 20;
inline constexpr double least_slope = 1e-9, largest_slope = 1e9;
/// In slopes; beyond it single precision does not tell neighbouring stored values apart.
inline constexpr double largest_intercept = 1e6;
inline constexpr double least_field_T = 0.01, largest_field_T = 20;
inline constexpr double least_bandwidth_Hz = 1, largest_bandwidth_Hz = 20'000;  ///< of a pixel

inline bool is_plausible_spacing(double mm) { return mm >= least_spacing_mm && mm <= largest_spacing_mm; }
inline bool is_plausible_field(double T) { return T >= least_field_T && T <= largest_field_T; }
inline bool is_plausible_bandwidth(double Hz) {
  return Hz >= least_bandwidth_Hz && Hz <= largest_bandwidth_Hz;
}
/// Not 0, which headers say that tell none: a newborn's is in days.
inline bool is_plausible_age(double years) { return years > 0 && human_age_years.contains(years); }
/// Positive: a negative slope turns T1 into T2.
inline bool is_plausible_slope(double slope) { return slope >= least_slope && slope <= largest_slope; }
inline bool is_plausible_intercept(double intercept, double slope) {
  return std::abs(intercept) <= largest_intercept * slope;
}

}  // namespace emmetrope::segmentation
