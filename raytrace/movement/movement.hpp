#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/base/laterality.hpp"
#include "raytrace/picture/gaze.hpp"

namespace emmetrope::raytrace {

/// What both eyes do at one moment.
struct EyeMoment {
  double time_s = 0;
  Gaze gaze;                ///< of the two eyes together: to the patient's left, up
  double vergence_deg = 0;  ///< angle between their axes, half of it each, positive inward
  double accommodation_D = 0;
  std::optional<double> pupil_mm;  ///< iris aperture; none: as the eye has it

  /// \return where one eye looks
  Gaze gaze_of(Laterality eye) const;
};

/// Gaze, vergence, accommodation and pupil against time: moments of rising time, straight lines between them.
class Movement {
 public:
  /// \throw Error (input_invalid) for fewer than two moments, times that do not rise, gaze beyond 60 degrees,
  ///   accommodation below -0.5 D, or a pupil out of 0.5 to 9 mm
  Movement(std::string name, std::vector<EyeMoment> moments);

  const std::string& name() const { return name_; }
  double first_s() const { return moments_.front().time_s; }
  double last_s() const { return moments_.back().time_s; }
  double duration_s() const { return last_s() - first_s(); }
  /// The first and last moment hold before and after.
  EyeMoment at(double time_s) const;
  bool accommodates() const;
  /// As it was given; what is below 0 is a record's noise, for which the moments have 0.
  double least_accommodation_D() const { return least_accommodation_D_; }
  const std::vector<EyeMoment>& moments() const { return moments_; }

 private:
  std::string name_;
  std::vector<EyeMoment> moments_;
  double least_accommodation_D_ = 0;
};

/// A table: time_s and any of horizontal_deg, vertical_deg, vergence_deg, accommodation_D, pupil_mm, named in its first
/// line and separated by commas; at most a million rows.
/// \throw Error (input_invalid) naming file, line and column
Movement read_movement(const std::filesystem::path& file);

/// As --movement gives it: a file (.csv), or a model NAME[:key=value,...] (models.hpp).
/// \throw Error (usage) naming what is unknown
Movement make_movement(const std::string& text, std::uint64_t seed);

}  // namespace emmetrope::raytrace
