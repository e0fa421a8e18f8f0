#include "data_samples/phantom/k_space.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <opencv2/core.hpp>
#include <random>

#include "data_samples/phantom/chemical_shift.hpp"
#include "pipeline/base/frames.hpp"

namespace emmetrope::phantom {
namespace {

using Complex = std::complex<double>;

cv::Mat spectrum_of(const std::vector<double>& image, int rows, int columns) {
  const cv::Mat real(rows, columns, CV_64F, const_cast<double*>(image.data()));
  cv::Mat spectrum;
  cv::dft(real, spectrum, cv::DFT_COMPLEX_OUTPUT);
  return spectrum;
}

/// Per frequency k of an image of n pixels: the factor that moves the fine grid's origin to the first pixel's
/// centre and undoes the average over a fine cell.
Complex fine_cell_factor(int k, int n) {
  const double cycles = static_cast<double>(k) / (fine * n);  // per fine cell
  const double blur = k == 0 ? 1 : std::sin(pi * cycles) / (pi * cycles);
  return std::polar(1 / blur, 2 * pi * cycles * 0.5 * (fine - 1));
}

/// Largest frequency that is acquired; the Nyquist frequency itself has no partner and is left out.
int last_frequency(double acquired, int n) { return static_cast<int>(std::ceil(acquired * n / 2)) - 1; }

/// \param t  frequency over the largest that is acquired
double window_at(Window window, double t) {
  switch (window) {
    case Window::none:
      return 1;
    case Window::hann:
      return 0.5 + 0.5 * std::cos(pi * std::min(1.0, t));
    case Window::fermi:
      return 1 / (1 + std::exp((t - 0.8) / 0.06));
  }
  return 1;
}

/// What the order of acquisition makes of a line: the echo train's decay from the middle outwards, and two
/// ghosts of what moves in step with every third line.
double line_factor(const KSpace& k_space, int ky, int reach_y) {
  const double decay = std::exp(-k_space.echo_train * std::abs(ky) / reach_y);
  return decay * (1 + 2 * k_space.ghost * std::cos(2 * pi * ky / 3.0));
}

/// Parallel imaging amplifies noise unevenly: most in the middle of the picture.
double noise_amplification(double variation, double x, double y) {
  return 1 + variation * std::cos(pi * (x - 0.5)) * std::cos(pi * (y - 0.5));
}

/// The image of a spectrum, which is used up.
ComplexImage image_of(cv::Mat spectrum) {
  cv::dft(spectrum, spectrum, cv::DFT_INVERSE | cv::DFT_SCALE);
  ComplexImage image;
  image.reserve(spectrum.total());
  std::transform(spectrum.begin<cv::Vec2d>(), spectrum.end<cv::Vec2d>(), std::back_inserter(image),
                 [](const cv::Vec2d& value) { return std::complex<float>(Complex(value[0], value[1])); });
  return image;
}

/// How far k-space is acquired, and its window.
struct AcquiredRectangle {
  int reach_x, reach_y;
  Window window;

  AcquiredRectangle(const KSpace& k_space, int rows, int columns)
      : reach_x(last_frequency(k_space.acquired_readout, columns)),
        reach_y(last_frequency(k_space.acquired_phase, rows)),
        window(k_space.window) {}
  double samples() const { return (2.0 * reach_x + 1) * (2.0 * reach_y + 1); }
  double weight(int kx, int ky) const {
    return window_at(window, std::abs(ky) / (reach_y + 1.0)) *
           window_at(window, std::abs(kx) / (reach_x + 1.0));
  }
};

}  // namespace

ComplexImage signal_image(const FineSlice& object, const KSpace& k_space) {
  const int rows = object.rows;
  const int columns = object.columns;
  const int fine_rows = fine * rows;
  const int fine_columns = fine * columns;
  const cv::Mat water = spectrum_of(object.water, fine_rows, fine_columns);
  const cv::Mat fat = spectrum_of(object.fat, fine_rows, fine_columns);

  const AcquiredRectangle acquired(k_space, rows, columns);
  // Sum over a fine grid to mean over the image.
  const double to_image = 1.0 / (fine * fine);
  std::vector<Complex> water_factor, fat_factor;  // by kx + reach_x
  for (int kx = -acquired.reach_x; kx <= acquired.reach_x; ++kx) {
    water_factor.push_back(fine_cell_factor(kx, columns));
    fat_factor.push_back(water_factor.back() * chemical_shift_factor(kx, k_space.fat_shift_px, columns));
  }
  cv::Mat spectrum = cv::Mat::zeros(rows, columns, CV_64FC2);
  for (int ky = -acquired.reach_y; ky <= acquired.reach_y; ++ky) {
    const int fine_row = (ky + fine_rows) % fine_rows;
    const Complex row_factor =
        fine_cell_factor(ky, rows) * to_image * line_factor(k_space, ky, acquired.reach_y);
    for (int kx = -acquired.reach_x; kx <= acquired.reach_x; ++kx) {
      const int fine_column = (kx + fine_columns) % fine_columns;
      const auto& w = water.at<cv::Vec2d>(fine_row, fine_column);
      const auto& f = fat.at<cv::Vec2d>(fine_row, fine_column);
      const Complex signal = acquired.weight(kx, ky) * row_factor *
                             (Complex(w[0], w[1]) * water_factor[kx + acquired.reach_x] +
                              Complex(f[0], f[1]) * fat_factor[kx + acquired.reach_x]);
      spectrum.at<cv::Vec2d>((ky + rows) % rows, (kx + columns) % columns) = {signal.real(), signal.imag()};
    }
  }
  return image_of(spectrum);
}

ComplexImage noise_image(int rows, int columns, const KSpace& k_space) {
  const AcquiredRectangle acquired(k_space, rows, columns);
  // Of unit variance per image pixel.
  std::mt19937_64 random(k_space.seed);
  std::normal_distribution<double> noise(0, k_space.sigma * rows * columns / std::sqrt(acquired.samples()));
  cv::Mat spectrum = cv::Mat::zeros(rows, columns, CV_64FC2);
  for (int ky = -acquired.reach_y; ky <= acquired.reach_y; ++ky)
    for (int kx = -acquired.reach_x; kx <= acquired.reach_x; ++kx) {
      const double in_phase = noise(random), quadrature = noise(random), weight = acquired.weight(kx, ky);
      spectrum.at<cv::Vec2d>((ky + rows) % rows, (kx + columns) % columns) = {weight * in_phase,
                                                                              weight * quadrature};
    }
  ComplexImage image = image_of(spectrum);
  if (k_space.noise_variation == 0) return image;
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < columns; ++column)
      image[static_cast<std::size_t>(row) * columns + column] *= static_cast<float>(
          noise_amplification(k_space.noise_variation, (column + 0.5) / columns, (row + 0.5) / rows));
  return image;
}

std::vector<float> magnitude_image(const ComplexImage& signal, const ComplexImage& noise) {
  std::vector<float> magnitude(signal.size());
  std::transform(signal.begin(), signal.end(), noise.begin(), magnitude.begin(),
                 [](std::complex<float> a, std::complex<float> b) { return std::abs(a + b); });
  return magnitude;
}

std::vector<float> magnitude_image(const FineSlice& object, const KSpace& k_space) {
  return magnitude_image(signal_image(object, k_space), noise_image(object.rows, object.columns, k_space));
}

SliceEncoding::SliceEncoding(int slices, Window window) {
  const int reach = last_frequency(1, slices);
  const double samples = 2.0 * reach + 1;
  const auto sum = [&](auto amplitude, double distance) {
    double total = 1;
    for (int k = 1; k <= reach; ++k)
      total +=
          2 * window_at(window, k / (reach + 1.0)) * amplitude(k) * std::cos(2 * pi * k * distance / slices);
    return total;
  };
  for (int half_layers = 0; half_layers <= 2 * fine * slices; ++half_layers)
    layer_.push_back(
        sum([&](int k) { return std::abs(fine_cell_factor(k, slices)); }, 0.5 * half_layers / fine) /
        (static_cast<double>(fine) * slices));
  for (int distance = 0; distance <= slices; ++distance)
    noise_.push_back(sum([](int) { return 1.0; }, distance) / std::sqrt(samples * slices));
}

double SliceEncoding::of_layer(int slice, int layer) const {
  return layer_[static_cast<std::size_t>(std::abs(2 * fine * slice + fine - 1 - 2 * layer))];
}

double SliceEncoding::of_noise(int slice, int of_slice) const {
  return noise_[static_cast<std::size_t>(std::abs(slice - of_slice))];
}

}  // namespace emmetrope::phantom
