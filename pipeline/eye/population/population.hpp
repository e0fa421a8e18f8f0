#pragma once
#include <optional>
#include <string>
#include <vector>

/// What is known of human eyes before one is measured.
namespace emmetrope {

/// A parameter of ParametricEye in the population: mean, spread between eyes and where they come from
/// (docs/method/segmentation.md, "Priors", tells more).
struct PopulationValue {
  const char* parameter;
  double mean, sigma;
  const char* reference;
};

/// Shapes and lengths of cornea, lens and globe; the pose has no population.
const std::vector<PopulationValue>& population_values();
/// \throw Error (fault) for a parameter without a population
const PopulationValue& population_value(const std::string& parameter);

/// Of what the population alone tells, how many times as far an eye may be as a normal distribution says:
/// 2.6 % of eyes have more than 3 D of corneal cylinder (Hoffmann and Huetz 2010). The index of the lens,
/// which is no shape, has no such tail.
double tail_of(const std::string& parameter);

inline constexpr double usual_age_years = 40;

/// Between lenses of one age.
inline constexpr double usual_lens_index_sigma = 0.005;

/// Equivalent index of a lens of that age: a line (Dubbelman and van der Heijde 2001). Below 18 and above 70 years, where
/// no lens was measured for it, what it adds is uncertain besides.
struct LensIndex {
  double mean = 0, sigma = usual_lens_index_sigma;
};
LensIndex lens_index_at_age(double age_years);

/// Photoreceptors behind the vitreo-retinal interface.
inline constexpr double usual_retinal_depth_mm = 0.20, most_retinal_depth_mm = 1.0;

/// What 1 D of keratometric power is in curvature: the keratometric index is 1.3375.
inline constexpr double keratometric_D_mm = 337.5;
inline constexpr double per_mm_of_keratometric_D = 1 / keratometric_D_mm;

/// The same parameters at an age, where they change with it: lens radii from 18 to 70 years (clamped); of an
/// adult the depth of the chamber and the thickness of the lens too, since a child's are not a young adult's.
/// (Dubbelman and van der Heijde 2001.)
std::vector<PopulationValue> population_at_age(double age_years);

/// Amplitude of accommodation at an age, D; Hofstetter (1950): average 18.5 - 0.30 age, minimum 15 - 0.25
/// age; not below 0.
struct Amplitude {
  double average_D = 0, minimum_D = 0;
};
Amplitude accommodation_amplitude(double age_years);

}  // namespace emmetrope
