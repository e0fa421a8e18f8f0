#pragma once
#include <Eigen/Core>
#include <cmath>
#include <random>

#include "pipeline/eye/instruments/instruments.hpp"

namespace emmetrope {

/// Standard deviation of a keratometer's reading in each meridian, D.
inline constexpr double keratometer_sigma_D = 0.25;

/// What such a keratometer reads on a cornea of those M, J0, J45.
inline ExternalMeasurement simulated_keratometry(const Eigen::Vector3d& corneal_power_D,
                                                 unsigned long long seed) {
  ExternalMeasurement measurement = keratometry_measurement("43@0/44@90", keratometer_sigma_D);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0, keratometer_sigma_D / std::sqrt(2.0));
  for (int i = 0; i < 3; ++i) measurement.value[i] = corneal_power_D[i] + noise(random);
  return measurement;
}

}  // namespace emmetrope
