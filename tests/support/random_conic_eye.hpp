#pragma once
#include <random>

#include "pipeline/eye/schematic/schematic_eyes.hpp"

namespace emmetrope {

/// A Navarro eye with other conics, depths and length.
inline EyeModel random_conic_eye(unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  const auto about = [&](double mean, double sigma) { return mean + sigma * normal(random); };
  EyeModel eye = make_eye("navarro");
  const double chamber_mm = about(0, 0.2), length_mm = about(0, 1);
  eye.surface("cornea_anterior").shape = make_conic(about(7.8, 0.25), about(-0.2, 0.12));
  eye.surface("cornea_posterior").shape = make_conic(about(6.5, 0.2), about(-0.2, 0.12));
  eye.surface("lens_anterior").shape = make_conic(about(10.5, 1), about(-2, 1));
  eye.surface("lens_posterior").shape = make_conic(about(-6, 0.4), about(-1, 0.5));
  for (const char* name : {"iris", "lens_anterior", "lens_posterior"})
    eye.surface(name).position_mm += chamber_mm;
  eye.surface("retina").position_mm += length_mm;
  eye.surface("retina").shape = make_conic(about(-12.5, 0.4), about(0, 0.05));
  return eye;
}

}  // namespace emmetrope
