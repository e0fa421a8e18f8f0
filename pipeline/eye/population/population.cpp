#include "pipeline/eye/population/population.hpp"

#include <algorithm>
#include <cmath>

#include "pipeline/base/error.hpp"

namespace emmetrope {
namespace {

constexpr const char* dubbelman_2001 = "Dubbelman and van der Heijde 2001";
constexpr const char* rosales_2006 = "Rosales and Marcos 2006";
constexpr const char* weak = "chosen: weak";
constexpr const char* astigmatism = "Hoffmann and Huetz 2010; Naeser, Savini and Bregnhoej 2018";

/// A length in adults: at_age_0_mm + per_year_mm age, between the ages that were measured. The spread is that
/// of adults of any age.
struct AgeingLength {
  const char* parameter;
  double at_age_0_mm, per_year_mm, sigma_mm;

  constexpr double mean_mm(double age_years) const { return at_age_0_mm + per_year_mm * age_years; }
  /// What is left of the spread once the age is known, which varies by 15 years among them.
  double sigma_at_known_age_mm() const {
    return std::sqrt(sigma_mm * sigma_mm - std::pow(15 * per_year_mm, 2));
  }
};
constexpr AgeingLength lens_front{"lens_anterior_radius_mm", 12.9, -0.057, 1.5};
constexpr AgeingLength lens_back{"lens_posterior_radius_mm", 6.2, -0.012, 0.6};
constexpr AgeingLength chamber{"anterior_chamber_depth_mm", 3.87, -0.010, 0.35};
constexpr AgeingLength thickness_of_lens{"lens_thickness_mm", 2.93, 0.0236, 0.47};
constexpr double youngest_years = 18, oldest_years = 70;

}  // namespace

const std::vector<PopulationValue>& population_values() {
  constexpr double D = per_mm_of_keratometric_D;
  static const std::vector<PopulationValue> values{
      {"cornea_c_per_mm", 1 / 7.8, 1.5 * D, "Hoffmann and Huetz 2010"},
      {"cornea_j0_per_mm", -0.3 * D, 0.6 * D, astigmatism},  // steeper vertically
      {"cornea_j45_per_mm", 0, 0.4 * D, astigmatism},
      {"cornea_q", -0.2, 0.12, "Atchison 2006; Dubbelman, Sicam and van der Heijde 2006"},
      {"cornea_q_split", 0, 0.05, "Zhang et al. 2011, 1052 subjects"},
      {"cornea_thickness_mm", 0.55, 0.035, "chosen, above Doughty and Zaman 2000: 0.535 +- 0.031 mm"},
      {"cornea_back_ratio", 0.83, 0.015, "Dubbelman, Sicam and van der Heijde 2006: 0.81 to 0.84"},
      {"anterior_chamber_depth_mm", 3.5, 0.6, weak},
      {"lens_thickness_mm", 3.9, 0.6, weak},
      {"lens_anterior_radius_mm", lens_front.mean_mm(usual_age_years), lens_front.sigma_mm, dubbelman_2001},
      {"lens_posterior_radius_mm", lens_back.mean_mm(usual_age_years), lens_back.sigma_mm, dubbelman_2001},
      {"lens_anterior_q", -3, 1.5, "schematic eyes, and lenses in vivo (Ortiz et al. 2012)"},
      {"lens_posterior_q", -1, 1, dubbelman_2001},
      {"lens_decentre_x_mm", 0, 0.25, rosales_2006},
      {"lens_decentre_y_mm", 0, 0.25, rosales_2006},
      {"lens_tilt_x_deg", 0, 3, rosales_2006},
      {"lens_tilt_y_deg", 0, 3, rosales_2006},
      {"lens_equator_radius_mm", 4.6, 0.3, weak},
      {"axial_length_mm", 23.8, 2.5, weak},
      {"globe_semi_axis_x_mm", 11.5, 1.2, weak},
      {"globe_semi_axis_y_mm", 11.4, 1.2, weak},
      {"globe_semi_axis_z_mm", 11.2, 1.2, weak},
  };
  return values;
}

const PopulationValue& population_value(const std::string& parameter) {
  const auto& values = population_values();
  const auto found = std::find_if(values.begin(), values.end(),
                                  [&](const PopulationValue& value) { return value.parameter == parameter; });
  if (found == values.end())
    throw Error(ExitStatus::fault, "the parameter '" + parameter + "' has no population");
  return *found;
}

double tail_of(const std::string& parameter) { return parameter == "lens_index" ? 1 : 2; }

LensIndex lens_index_at_age(double age_years) {
  constexpr double at_age_0 = 1.441, per_year = -0.00039;
  const double known_years = std::clamp(age_years, youngest_years, oldest_years);
  return {at_age_0 + per_year * age_years,
          std::hypot(usual_lens_index_sigma, per_year * (age_years - known_years))};
}

std::vector<PopulationValue> population_at_age(double age_years) {
  const double age = std::clamp(age_years, youngest_years, oldest_years);
  std::vector<AgeingLength> ageing{lens_front, lens_back};
  if (age_years >= youngest_years) ageing.insert(ageing.end(), {chamber, thickness_of_lens});
  std::vector<PopulationValue> values;
  for (const AgeingLength& length : ageing)
    values.push_back({length.parameter, length.mean_mm(age), length.sigma_at_known_age_mm(), dubbelman_2001});
  return values;
}

Amplitude accommodation_amplitude(double age_years) {
  return {std::max(0.0, 18.5 - 0.30 * age_years), std::max(0.0, 15.0 - 0.25 * age_years)};
}

}  // namespace emmetrope
