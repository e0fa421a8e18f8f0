#pragma once
#include <cstdint>
#include <vector>

#include "data_samples/phantom/acquisition.hpp"

namespace emmetrope::phantom {

/// A slice of the object on a grid `fine` times finer than the image in both directions. Row after row.
struct FineSlice {
  int columns = 0, rows = 0;  ///< of the image; the arrays hold (fine * rows) x (fine * columns)
  std::vector<double> water, fat;
};
inline constexpr int fine = 4;  ///< points per pixel and direction

struct KSpace {
  double acquired_readout = 1, acquired_phase = 1;  ///< fraction of each direction, the rest zero-filled
  double fat_shift_px = 0;                          ///< along the rows
  double sigma = 0;                                 ///< of one channel in the image, before the window
  Window window = Window::none;
  double noise_variation = 0, echo_train = 0, ghost = 0;  ///< as in Disturbances
  std::uint64_t seed = 1;
};

/// What a Fourier scanner makes of it: k-space cut to the acquired rectangle, noise in real and imaginary
/// channel, zero filled to rows x columns, magnitude. The fine cells' own box blur is divided out.
std::vector<float> magnitude_image(const FineSlice& object, const KSpace& k_space);

}  // namespace emmetrope::phantom
