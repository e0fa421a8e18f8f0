#include "raytrace/movement/models.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include "pipeline/base/frames.hpp"

namespace emmetrope::raytrace {
namespace {

constexpr double sample_s = 1e-3;

/// A displacement in degrees: to the patient's left, up.
using Displacement = Eigen::Vector2d;

Displacement towards(double direction_deg) {
  return {std::cos(direction_deg * degree), std::sin(direction_deg * degree)};
}

/// Where the eye looks at every sample.
template <typename PlaceAt>
std::vector<EyeMoment> sampled(double duration_s, const PlaceAt& place_at) {
  std::vector<EyeMoment> moments;
  const int last = std::max(1, static_cast<int>(std::lround(duration_s / sample_s)));
  for (int k = 0; k <= last; ++k) {
    EyeMoment moment;
    moment.time_s = k * sample_s;
    const Displacement place = place_at(moment.time_s);
    moment.gaze = {place.x(), place.y()};
    moments.push_back(moment);
  }
  return moments;
}

double saccade_duration_s(double amplitude_deg) { return 0.021 + 0.0022 * amplitude_deg; }

/// The share of a saccade that is done.
double saccade_share(double since_start_s, double amplitude_deg) {
  const double s = std::clamp(since_start_s / saccade_duration_s(amplitude_deg), 0.0, 1.0);
  return s * s * s * (10 + s * (6 * s - 15));
}

std::vector<EyeMoment> saccade(const ModelParameters& p, std::uint64_t /*seed*/) {
  const double amplitude_deg = p.at("amplitude_deg");
  const Displacement whole = amplitude_deg * towards(p.at("direction_deg"));
  return sampled(p.at("duration_s"), [&](double time_s) -> Displacement {
    return (saccade_share(time_s - p.at("start_s"), amplitude_deg) - 0.5) * whole;
  });
}

std::vector<EyeMoment> pursuit(const ModelParameters& p, std::uint64_t /*seed*/) {
  const Displacement velocity = p.at("gain") * p.at("velocity_deg_s") * towards(p.at("direction_deg"));
  const double rise_s = p.at("rise_s");
  return sampled(p.at("duration_s"), [&](double time_s) -> Displacement {
    const double since_s = std::max(0.0, time_s - p.at("latency_s"));
    const double lost_s = rise_s > 0 ? rise_s * -std::expm1(-since_s / rise_s) : 0;
    return (since_s - lost_s) * velocity;
  });
}

/// Places at rising times, a sample apart.
std::vector<Displacement> brownian(double duration_s, double diffusion_arcmin2_s, std::mt19937_64& random) {
  const double step_deg = std::sqrt(2 * diffusion_arcmin2_s * sample_s) / 60;
  std::normal_distribution<double> normal;  // which may have no spread of 0, as without drift
  std::vector<Displacement> places{{0, 0}};
  for (double time_s = 0; time_s < duration_s + sample_s; time_s += sample_s) {
    const double x = step_deg * normal(random), y = step_deg * normal(random);
    places.push_back(places.back() + Displacement(x, y));
  }
  return places;
}

struct Jump {
  double start_s, amplitude_deg;
  Displacement towards;
};

std::vector<Jump> jumps(const ModelParameters& p, const std::vector<Displacement>& drift,
                        std::mt19937_64& random) {
  constexpr double spread = 1.5, farthest_deg = 0.5;
  const double rest_s = std::max(1 / p.at("rate_hz") - least_microsaccade_interval_s, 1e-3);
  std::exponential_distribution<double> rest(1 / rest_s);
  std::lognormal_distribution<double> amplitude(std::log(p.at("amplitude_deg")), std::log(spread));
  std::uniform_real_distribution<double> direction(0, 360);
  std::vector<Jump> all;
  Displacement jumped(0, 0);
  for (double time_s = rest(random); time_s < p.at("duration_s");
       time_s += least_microsaccade_interval_s + rest(random)) {
    Jump jump{time_s, amplitude(random), towards(direction(random))};
    const Displacement place = drift[static_cast<std::size_t>(std::lround(time_s / sample_s))] + jumped;
    if ((place + jump.amplitude_deg * jump.towards).norm() > farthest_deg && !place.isZero(0))
      jump.towards = -place.normalized();
    jumped += jump.amplitude_deg * jump.towards;
    all.push_back(jump);
  }
  return all;
}

Displacement after(const std::vector<Jump>& jumps, double time_s) {
  Displacement place(0, 0);
  for (const Jump& jump : jumps)
    place += saccade_share(time_s - jump.start_s, jump.amplitude_deg) * jump.amplitude_deg * jump.towards;
  return place;
}

std::vector<EyeMoment> fixational(const ModelParameters& p, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const double duration_s = p.at("duration_s");
  const auto diffusion = p.find("diffusion_arcmin2_s");
  const std::vector<Displacement> drift =
      brownian(duration_s, diffusion == p.end() ? 0 : diffusion->second, random);
  const std::vector<Jump> of_microsaccades =
      p.count("rate_hz") > 0 ? jumps(p, drift, random) : std::vector<Jump>();
  return sampled(duration_s, [&](double time_s) -> Displacement {
    return drift[static_cast<std::size_t>(std::lround(time_s / sample_s))] + after(of_microsaccades, time_s);
  });
}

}  // namespace

const std::vector<MovementModel>& movement_models() {
  static const std::vector<MovementModel> models{
      {"saccade",
       {{"amplitude_deg", 10}, {"direction_deg", 0}, {"start_s", 0.05}, {"duration_s", 0.2}},
       &saccade},
      {"pursuit",
       {{"velocity_deg_s", 10},
        {"direction_deg", 0},
        {"latency_s", 0.13},
        {"rise_s", 0.05},
        {"gain", 0.95},
        {"duration_s", 1}},
       &pursuit},
      {"drift", {{"diffusion_arcmin2_s", 40}, {"duration_s", 1}}, &fixational},
      {"microsaccades", {{"amplitude_deg", 0.3}, {"rate_hz", 1.5}, {"duration_s", 2}}, &fixational},
      {"fixation",
       {{"diffusion_arcmin2_s", 40}, {"amplitude_deg", 0.3}, {"rate_hz", 1.5}, {"duration_s", 2}},
       &fixational}};
  return models;
}

}  // namespace emmetrope::raytrace
