#pragma once
#include <complex>
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

using ComplexImage = std::vector<std::complex<float>>;  ///< row after row

/// What a Fourier scanner makes of it: k-space cut to the acquired rectangle, zero filled to rows x columns. The fine
/// cells' own box blur is divided out.
ComplexImage signal_image(const FineSlice& object, const KSpace& k_space);
/// The noise of real and imaginary channel.
ComplexImage noise_image(int rows, int columns, const KSpace& k_space);
/// Of the sum.
std::vector<float> magnitude_image(const ComplexImage& signal, const ComplexImage& noise);
std::vector<float> magnitude_image(const FineSlice& object, const KSpace& k_space);

/// By how much layers of the object, `fine` a slice, add to slices that are phase-encoded, or slices of noise to each
/// other. As many slices as those of the volume, over which the picture repeats itself.
class SliceEncoding {
 public:
  SliceEncoding(int slices, Window window);
  double of_layer(int slice, int layer) const;  ///< the layers' own box blur is divided out
  double of_noise(int slice, int of_slice) const;

 private:
  std::vector<double> layer_, noise_;  ///< by the distance: in half layers, in slices
};

}  // namespace emmetrope::phantom
