#pragma once
#include <array>
#include <optional>
#include <string>

namespace emmetrope {

/// od: the right eye, the globe at smaller LPS x; os: the left.
enum class Laterality { od, os };
/// What a command works on (`--laterality`).
enum class LateralityChoice { od, os, both };

inline constexpr std::array<Laterality, 2> both_eyes{Laterality::od, Laterality::os};

inline const char* to_string(Laterality eye) { return eye == Laterality::od ? "od" : "os"; }
inline const char* to_string(LateralityChoice choice) {
  return choice == LateralityChoice::both
             ? "both"
             : to_string(choice == LateralityChoice::od ? Laterality::od : Laterality::os);
}
inline bool includes(LateralityChoice choice, Laterality eye) {
  return choice == LateralityChoice::both || (choice == LateralityChoice::od) == (eye == Laterality::od);
}
/// The eye that is asked for alone.
inline std::optional<Laterality> one_eye(LateralityChoice choice) {
  if (choice == LateralityChoice::both) return std::nullopt;
  return choice == LateralityChoice::od ? Laterality::od : Laterality::os;
}
/// "OD (right)", "OS (left)": as the report writes it.
inline const char* clinical_name(Laterality eye) {
  return eye == Laterality::od ? "OD (right)" : "OS (left)";
}

}  // namespace emmetrope
