#pragma once
#include <limits>
#include <optional>
#include <string>
#include <vector>

/// What an eye's numbers may be: the one table that every stage judges by.
namespace emmetrope {

/// Both ends belong to it; either may be open.
struct Range {
  double low = -std::numeric_limits<double>::infinity(), high = std::numeric_limits<double>::infinity();
  bool contains(double value) const { return value >= low && value <= high; }
  bool contains(const Range& other) const { return contains(other.low) && contains(other.high); }
  /// Whether anything is outside.
  bool is_limited() const;
};

/// Diameters of the iris that may be asked for; others are in another unit.
inline constexpr Range iris_aperture_mm{0.5, 9};
/// Distances of a spectacle from the cornea; others are in another unit.
inline constexpr Range spectacle_distance_mm{5, 30};
/// Ages that a header may tell and that may be asked for; dates of birth that stand for removed ones (1900-01-01) are of
/// older persons.
inline constexpr Range human_age_years{0, 110};
/// Equivalent indices of a lens that may be asked for; others are of no human eye.
inline constexpr Range human_lens_index{1.36, 1.5};

/// \param name  the flag, and the field of the settings where that is called otherwise
/// \throw Error (usage) naming it, its value and what is allowed
void check_setting(const char* name, double value, const Range& allowed, const char* unit = "");
/// Of a spectacle, or 0 of a contact lens; as check_setting().
void check_vertex_distance(const char* name, double vertex_distance_mm);

/// The limits of one quantity at three severities, each within the one before where there are both.
struct Limits {
  std::string
      quantity;  ///< path in biometry.json ("keratometry/flat/power_D"), or the name below its heading
  std::string unit;
  Range accepted;   ///< outside it there is no result: no eye is like that, or the data do not support one
  Range plausible;  ///< outside it the user is warned
  Range normal;     ///< of healthy adults
  std::string normal_reference;  ///< where the normal range is from: authors and year
};

/// Numbers of biometry.json and of prescription.json, then qualities of a fit to images.
const std::vector<Limits>& limits_table();
/// \return null for a quantity that has no limits
const Limits* find_limits(const std::string& quantity);
/// From here on the normal ranges of adults hold.
inline constexpr double adult_years = 18;
inline bool is_child(std::optional<double> age_years) { return age_years && *age_years < adult_years; }
/// What is normal at an age, and where that is from.
struct Normal {
  Range range;  ///< not limited where nothing is known
  std::string reference;
};
/// \param age_years  of an adult, or unknown: the table's range; of a child a range of that age or none
Normal normal_at_age(const std::string& quantity, std::optional<double> age_years);
/// \throw Error (fault) for a quantity that has none
const Limits& limits_of(const std::string& quantity);

}  // namespace emmetrope
