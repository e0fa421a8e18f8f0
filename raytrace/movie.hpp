#pragma once
#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "pipeline/base/laterality.hpp"
#include "raytrace/movement/movement.hpp"
#include "raytrace/tracer/exposure.hpp"

namespace emmetrope::raytrace {

/// What an eye sees while it moves.
struct MovieSettings {
  std::string movement;  ///< a .csv file or a model (make_movement)
  double frame_rate_hz = 60;

  /// \throw Error (usage) naming the option, also for more than 10000 frames; as make_movement
  void check(const TraceSettings& trace) const;
};

/// The eye with what it wears, straight ahead, at an accommodation and with an iris aperture where that is given.
using EyeInState = std::function<EyeModel(double accommodation_D, const std::optional<double>& pupil_mm)>;

/// Into a folder, all or nothing:
/// - movie.mp4 (H.264) and frames/0000.png ...: the retinal image of each frame, averaged over its time in as many steps
///   as the image moves pixels, `exposure.steps` at most; what the scene moves during an exposure it moves during the
///   whole movie;
/// - movement.json: columns, one entry a frame, of its middle: gaze, vergence, accommodation, pupil, retinal slip.
/// \throw Error as MovieSettings::check and the tracer
void write_movie(const Tracer& tracer, const EyeInState& eye_in_state, Laterality side, const Scene& scene,
                 const TraceSettings& trace, const Exposure& exposure, const MovieSettings& settings,
                 const std::filesystem::path& folder);
/// Whether the eye can be in the states farthest and nearest of a movement.
/// \throw Error as `eye_in_state`, with the time
void require_states(const EyeInState& eye_in_state, const std::string& movement, std::uint64_t seed);
/// Takes that of an earlier eye away; files that no movie's table stands beside are somebody else's.
void remove_movie(const std::filesystem::path& folder);

}  // namespace emmetrope::raytrace
