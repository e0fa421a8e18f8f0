#pragma once
#include <Eigen/Core>

namespace emmetrope::raytrace {

/// Long, middle and short wavelength cones of the 2 degree observer, per unit of energy at the cornea, each 1 at its
/// peak: Stockman and Sharpe, Vision Research 40, 1711 (2000), as tabulated every 5 nm by the Colour and Vision Research
/// Laboratory (linss2_10e), which CIE 170-1:2006 took over. Lens and macular pigment of the average observer are in
/// them. Linear between the tabulated values, 0 outside 390 to 830 nm.
Eigen::Vector3d cone_fundamentals(double wavelength_nm);

/// V(lambda) of the CIE 1924 photopic observer, every 5 nm from 380 to 780, linear between, 0 outside.
double luminous_efficiency(double wavelength_nm);

/// lm / W at the peak.
inline constexpr double photopic_efficacy = 683.002;

}  // namespace emmetrope::raytrace
