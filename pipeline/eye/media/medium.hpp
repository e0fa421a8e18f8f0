#pragma once
#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

namespace emmetrope {

/// A published dispersion formula n(wavelength); what enters a trace is its difference from the reference
/// wavelength. docs/use/eye-json.md documents each formula with units and one complete example.
struct Dispersion {
  enum class Formula {
    constant,
    cauchy,
    conrady,
    cornu,
    herzberger,
    sellmeier,
    schott,
    polynomial,
    abbe,
    table
  };
  Formula formula = Formula::constant;
  /// As docs/use/eye-json.md orders them; a table as wavelength (nm, ascending), index, wavelength, index, ...
  std::vector<double> coefficients;

  /// The published formula itself; 0 for `constant`.
  double formula_index(double wavelength_nm) const;
};

/// Gradient index n(t, r) = sum c_ij t^i r^(2j), t: depth behind the front vertex of the medium (mm), r:
/// distance from the axis (mm); at the reference wavelength. Liou and Brennan (1997), Atchison (2006).
struct GradientIndex {
  struct Term {
    int depth_power = 0;
    int radius_power = 0;  ///< even
    double coefficient = 0;
  };
  std::vector<Term> terms;

  double index(double depth_mm, double radius_mm) const;
};

/// A refracting medium.
struct Medium {
  double index = 1;  ///< at the eye's reference wavelength; on the axis at the front vertex for a gradient
  Dispersion dispersion;
  std::optional<GradientIndex> gradient;

  /// n(wavelength) = index + formula(wavelength) - formula(reference), so that the tabulated index holds at
  /// reference.
  double index_at(double wavelength_nm, double reference_wavelength_nm) const;
  /// The same inside a gradient; equal to index_at where there is none.
  double index_at(double depth_mm, double radius_mm, double wavelength_nm,
                  double reference_wavelength_nm) const;
};

}  // namespace emmetrope
