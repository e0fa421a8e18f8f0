#pragma once
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "raytrace/movement/movement.hpp"

/// Eye movements by the models of the literature, sampled every millisecond.
namespace emmetrope::raytrace {

/// Microsaccades follow one another no faster.
inline constexpr double least_microsaccade_interval_s = 0.15;

/// Numbers of a model by name, all of them with a default.
using ModelParameters = std::map<std::string, double>;

struct MovementModel {
  std::string name;
  ModelParameters defaults;
  std::vector<EyeMoment> (*make)(const ModelParameters& parameters, std::uint64_t seed);
};

/// saccade: `amplitude_deg` towards `direction_deg` (from the patient's left counter-clockwise as the patient sees it: 90 up),
/// from `start_s`, about straight ahead. Its duration is 21 ms + 2.2 ms a degree (Carpenter, Movements of the Eyes, 1988), its
/// course that of least jerk, 10 s^3 - 15 s^4 + 6 s^5 (Hogan, J. Neurosci. 4, 2745, 1984): of 10 degrees the peak is
/// 436 degrees a second, as Bahill, Clark and Stark (Math. Biosci. 24, 191, 1975) found it.
///
/// pursuit: of a target that moves at `velocity_deg_s` towards `direction_deg` from time 0: after `latency_s` the eye's
/// velocity rises to `gain` times the target's with time constant `rise_s` (first-order; Robinson, Gordon and Gordon,
/// Biol. Cybern. 55, 43, 1986, have latency 0.13 s and about this rise).
///
/// drift: Brownian motion of diffusion constant `diffusion_arcmin2_s`, half of the mean squared displacement along an axis
/// a second (Kuang, Poletti, Victor and Rucci, Curr. Biol. 22, 510, 2012: about 40).
///
/// microsaccades: saccades as above of log-normal amplitude with median `amplitude_deg` and a spread of a factor 1.5, in
/// random directions, each back towards straight ahead, from wherever drift has led, where it would end more than 0.5 degrees off, at intervals of
/// 0.15 s and an exponential rest, `rate_hz` a second (Martinez-Conde, Macknik and Hubel, Nat. Rev. Neurosci. 5, 229,
/// 2004: 1 to 2 a second).
///
/// fixation: drift and microsaccades together.
const std::vector<MovementModel>& movement_models();

}  // namespace emmetrope::raytrace
