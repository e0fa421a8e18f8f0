#include "data_samples/phantom/k_space.hpp"

#include <cmath>
#include <complex>
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

/// Noise of the image's own, windowed as the signal is, amplified by place.
cv::Mat noise_image(const cv::Mat& spectrum, double variation) {
  cv::Mat noise;
  cv::dft(spectrum, noise, cv::DFT_INVERSE | cv::DFT_SCALE);
  for (int row = 0; row < noise.rows; ++row)
    for (int column = 0; column < noise.cols; ++column)
      noise.at<cv::Vec2d>(row, column) *=
          noise_amplification(variation, (column + 0.5) / noise.cols, (row + 0.5) / noise.rows);
  return noise;
}

}  // namespace

std::vector<float> magnitude_image(const FineSlice& object, const KSpace& k_space) {
  const int rows = object.rows;
  const int columns = object.columns;
  const int fine_rows = fine * rows;
  const int fine_columns = fine * columns;
  const cv::Mat water = spectrum_of(object.water, fine_rows, fine_columns);
  const cv::Mat fat = spectrum_of(object.fat, fine_rows, fine_columns);

  const int reach_x = last_frequency(k_space.acquired_readout, columns);
  const int reach_y = last_frequency(k_space.acquired_phase, rows);
  const double acquired = (2.0 * reach_x + 1) * (2.0 * reach_y + 1);
  // Sum over a fine grid to mean over the image; noise of unit variance per image pixel.
  const double to_image = 1.0 / (fine * fine);
  std::mt19937_64 random(k_space.seed);
  std::normal_distribution<double> noise(0, k_space.sigma * rows * columns / std::sqrt(acquired));

  std::vector<Complex> water_factor, fat_factor;  // by kx + reach_x
  for (int kx = -reach_x; kx <= reach_x; ++kx) {
    water_factor.push_back(fine_cell_factor(kx, columns));
    fat_factor.push_back(water_factor.back() * chemical_shift_factor(kx, k_space.fat_shift_px, columns));
  }
  cv::Mat image = cv::Mat::zeros(rows, columns, CV_64FC2);
  cv::Mat noise_spectrum = image.clone();
  for (int ky = -reach_y; ky <= reach_y; ++ky) {
    const int fine_row = (ky + fine_rows) % fine_rows;
    const Complex row_factor = fine_cell_factor(ky, rows) * to_image * line_factor(k_space, ky, reach_y);
    const double row_window = window_at(k_space.window, std::abs(ky) / (reach_y + 1.0));
    for (int kx = -reach_x; kx <= reach_x; ++kx) {
      const int fine_column = (kx + fine_columns) % fine_columns;
      const auto& w = water.at<cv::Vec2d>(fine_row, fine_column);
      const auto& f = fat.at<cv::Vec2d>(fine_row, fine_column);
      const Complex signal = row_factor * (Complex(w[0], w[1]) * water_factor[kx + reach_x] +
                                           Complex(f[0], f[1]) * fat_factor[kx + reach_x]);
      const double window = row_window * window_at(k_space.window, std::abs(kx) / (reach_x + 1.0));
      const double in_phase = noise(random);
      const double quadrature = noise(random);
      const int at_row = (ky + rows) % rows, at_column = (kx + columns) % columns;
      image.at<cv::Vec2d>(at_row, at_column) = {window * signal.real(), window * signal.imag()};
      noise_spectrum.at<cv::Vec2d>(at_row, at_column) = {window * in_phase, window * quadrature};
    }
  }
  if (k_space.noise_variation == 0) image += noise_spectrum;
  cv::dft(image, image, cv::DFT_INVERSE | cv::DFT_SCALE);
  if (k_space.noise_variation != 0) image += noise_image(noise_spectrum, k_space.noise_variation);

  std::vector<float> magnitude(static_cast<std::size_t>(rows) * columns);
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < columns; ++column) {
      const auto& value = image.at<cv::Vec2d>(row, column);
      magnitude[static_cast<std::size_t>(row) * columns + column] = static_cast<float>(cv::norm(value));
    }
  return magnitude;
}

}  // namespace emmetrope::phantom
