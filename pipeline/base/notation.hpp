#pragma once
#include <optional>
#include <string>

#include "pipeline/base/laterality.hpp"
#include "pipeline/base/power_vector.hpp"

/// How refractions are written, read and rounded. Axes follow TABO, both eyes as the examiner sees them.
namespace emmetrope {

/// The same refraction with the other sign of cylinder: S + C, -C, axis turned by 90 degrees. Axis 0 <= a <
/// 180.
SpheroCylinder transpose(const SpheroCylinder& refraction);

/// Half a clinical step: a smaller cylinder is none.
inline constexpr double least_cylinder_D = 0.125;

/// Three digits, from 001 to 180.
std::string format_axis(double axis_deg);

/// "-2.25 / -1.00 x 180", "+0.50 DS" (cylinder below 0.125 D), "0.00 / -0.75 x 090": sign and two decimals.
std::string format_refraction(const SpheroCylinder& refraction);
std::string format_plus_cylinder(const SpheroCylinder& refraction);

/// 0 where so many decimals show no more of it, so that "{:.2f}" never writes "-0.00".
double without_negative_zero(double value, int decimals);

/// A refraction as it is dispensed: sphere and cylinder in 0.25 D, axis in 5 degrees from 5 to 180.
struct RoundedRefraction {
  SpheroCylinder refraction;  ///< axis_deg is 180 where the cylinder is 0
  double residual_D = 0;  ///< length of what rounding leaves uncorrected, in power-vector space (M, J0, J45)
};
/// The dispensable refraction that is nearest in power-vector distance sqrt(dM^2 + dJ0^2 + dJ45^2); of equals
/// the one with the smaller cylinder. Rounding S, C and axis one by one is worse: they are not independent.
RoundedRefraction round_refraction(const PowerVector& refraction);

/// A refraction as people type it.
struct StatedRefraction {
  SpheroCylinder refraction;  ///< minus cylinder, whatever was typed
  double vertex_distance_mm = 12;
  std::optional<double> sigma_D;  ///< of M, J0 and J45 each
};
/// Reads "-2.25/-1.00x180@12+-0.25"; cylinder, vertex distance and accuracy may be left out ("-3", "+1.50
/// DS", "+1.5@14", "PL").
/// \throw Error (usage) naming the text and what was expected
StatedRefraction parse_refraction(const std::string& text);

/// One eye's, as an option takes it: "od:-2.25/-1.00x180@12+-0.25".
struct EyeRefraction {
  Laterality eye = Laterality::od;
  StatedRefraction stated;
};
/// \throw Error (usage) naming the text and what was expected
EyeRefraction parse_eye_refraction(const std::string& text);

}  // namespace emmetrope
