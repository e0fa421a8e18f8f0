#pragma once
#include <complex>

#include "pipeline/base/frames.hpp"

namespace emmetrope::phantom {

/// Fat precesses more slowly than water and appears displaced along the readout: what its k-space is multiplied
/// by at a frequency, for a displacement in pixels along rows of so many columns.
inline std::complex<double> chemical_shift_factor(int frequency, double fat_shift_px, int columns) {
  return std::polar(1.0, -2 * pi * frequency * fat_shift_px / columns);
}

}  // namespace emmetrope::phantom
