#include "pipeline/report/point_spread.hpp"

#include <array>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"

namespace emmetrope::report {
namespace {

constexpr int transform_side = 1024;
constexpr int pupil_samples =
    256;  ///< across the pupil: the picture is lambda / pupil * 256 wide, 2.5 degrees at 3.5 mm
constexpr double arcmin_per_radian = 180 * 60 / pi;

double factorial(int n) { return n < 2 ? 1 : n * factorial(n - 1); }

/// Moves the zero frequency from the corner to the middle, or back (even sides).
void swap_quadrants(cv::Mat& image) {
  const int half = image.rows / 2;
  cv::Mat a = image(cv::Rect(0, 0, half, half)), b = image(cv::Rect(half, 0, half, half));
  cv::Mat c = image(cv::Rect(0, half, half, half)), d = image(cv::Rect(half, half, half, half));
  cv::Mat held = a.clone();
  d.copyTo(a);
  held.copyTo(d);
  held = b.clone();
  c.copyTo(b);
  held.copyTo(c);
}

cv::Mat view_of(const Picture& picture) {
  return {picture.side, picture.side, CV_32F, const_cast<float*>(picture.values.data())};
}

/// Block letters of 5 x 5 strokes, the grid of an optotype; 1 is ink, rows downwards.
constexpr std::array<std::array<int, 5>, 5> letter_rows{
    {{0b11111, 0b10000, 0b11110, 0b10000, 0b11111},    // E
     {0b10001, 0b10001, 0b11111, 0b10001, 0b10001},    // H
     {0b11111, 0b10000, 0b11110, 0b10000, 0b10000},    // F
     {0b11111, 0b00100, 0b00100, 0b00100, 0b00100},    // T
     {0b10001, 0b10001, 0b10001, 0b10001, 0b11111}}};  // U

/// One letter with its upper left corner at (x, y), strokes of `stroke` pixels (fractions by area).
void draw_letter(cv::Mat& chart, const std::array<int, 5>& rows, double x, double y, double stroke) {
  const int size = static_cast<int>(std::ceil(5 * stroke)) + 1;
  constexpr int fine = 4;
  for (int row = 0; row < size; ++row)
    for (int column = 0; column < size; ++column) {
      int ink = 0;
      for (int i = 0; i < fine * fine; ++i) {
        const double u = (std::floor(x) + column + (i % fine + 0.5) / fine - x) / stroke;
        const double v = (std::floor(y) + row + (i / fine + 0.5) / fine - y) / stroke;
        const int cell_u = static_cast<int>(std::floor(u)), cell_v = static_cast<int>(std::floor(v));
        if (cell_u >= 0 && cell_u < 5 && cell_v >= 0 && cell_v < 5) ink += rows[cell_v] >> (4 - cell_u) & 1;
      }
      const int at_y = static_cast<int>(y) + row, at_x = static_cast<int>(x) + column;
      if (ink > 0 && at_y >= 0 && at_y < chart.rows && at_x >= 0 && at_x < chart.cols)
        chart.at<float>(at_y, at_x) = 1 - static_cast<float>(ink) / (fine * fine);
    }
}

}  // namespace

PupilWavefront corrected_by(PupilWavefront wavefront, const PowerVector& refraction) {
  const double r_squared = wavefront.pupil_mm * wavefront.pupil_mm / 4;
  if (wavefront.zernike_um.size() < 6) wavefront.zernike_um.resize(6, 0);
  wavefront.zernike_um[3] += refraction.J45_D * r_squared / (2 * std::sqrt(6.0));
  wavefront.zernike_um[4] += refraction.M_D * r_squared / (4 * std::sqrt(3.0));
  wavefront.zernike_um[5] += refraction.J0_D * r_squared / (2 * std::sqrt(6.0));
  return wavefront;
}

double zernike_value(int index, double rho, double theta) {
  const int n = static_cast<int>(std::ceil((-3 + std::sqrt(9 + 8.0 * index)) / 2 - 1e-9));
  const int m = 2 * index - n * (n + 2);
  const int absolute = std::abs(m);
  double radial = 0;
  for (int s = 0; s <= (n - absolute) / 2; ++s)
    radial += (s % 2 == 0 ? 1 : -1) * factorial(n - s) /
              (factorial(s) * factorial((n + absolute) / 2 - s) * factorial((n - absolute) / 2 - s)) *
              std::pow(rho, n - 2 * s);
  const double norm = std::sqrt((m == 0 ? 1.0 : 2.0) * (n + 1));
  return norm * radial * (m >= 0 ? std::cos(absolute * theta) : std::sin(absolute * theta));
}

Picture point_spread(const PupilWavefront& wavefront) {
  if (!(wavefront.pupil_mm > 0 && wavefront.wavelength_nm > 0))
    throw input_error("wavefront.json: pupil_mm or wavelength_nm is not positive",
                      "run emmetrope trace again");
  cv::Mat pupil = cv::Mat::zeros(transform_side, transform_side, CV_64FC2);
  for (int row = 0; row < pupil_samples; ++row)
    for (int column = 0; column < pupil_samples; ++column) {
      const double x = (column + 0.5) / pupil_samples * 2 - 1, y = 1 - (row + 0.5) / pupil_samples * 2;
      const double rho = std::hypot(x, y), theta = std::atan2(y, x);
      if (rho > 1) continue;
      double path_um = 0;
      for (std::size_t i = 3; i < wavefront.zernike_um.size(); ++i)  // piston and tilt only move the picture
        if (wavefront.zernike_um[i] != 0)
          path_um += wavefront.zernike_um[i] * zernike_value(static_cast<int>(i), rho, theta);
      const double phase = 2 * pi * path_um * 1000 / wavefront.wavelength_nm;
      pupil.at<cv::Vec2d>(row, column) = {std::cos(phase), std::sin(phase)};
    }
  cv::Mat field, parts[2], intensity;
  cv::dft(pupil, field);
  cv::split(field, parts);
  intensity = parts[0].mul(parts[0]) + parts[1].mul(parts[1]);
  swap_quadrants(intensity);
  intensity /= cv::sum(intensity)[0];
  Picture picture;
  picture.side = transform_side;
  picture.arcmin_per_pixel = wavefront.wavelength_nm * 1e-6 / wavefront.pupil_mm * pupil_samples /
                             transform_side * arcmin_per_radian;
  cv::Mat single;
  intensity.convertTo(single, CV_32F);
  picture.values.assign(single.begin<float>(), single.end<float>());
  return picture;
}

Picture blurred_letters(const Picture& spread, const std::vector<double>& logmar, double width_arcmin) {
  cv::Mat chart(spread.side, spread.side, CV_32F, cv::Scalar(1));
  double total = 0;
  const auto height = [&](double acuity) { return 5 * std::pow(10, acuity) / spread.arcmin_per_pixel; };
  for (const double acuity : logmar) total += 1.6 * height(acuity);
  double y = (spread.side - total) / 2;
  for (const double acuity : logmar) {
    const double letter = height(acuity), pitch = 1.6 * letter;
    const double room = width_arcmin / spread.arcmin_per_pixel;
    const int count = std::clamp(static_cast<int>((room + 0.2 * letter) / pitch), 1, 5);
    double x = (spread.side - pitch * count + 0.6 * letter) / 2;
    for (int i = 0; i < count; ++i, x += pitch)
      draw_letter(chart, letter_rows[static_cast<std::size_t>(i)], x, y + 0.3 * letter, letter / 5);
    y += pitch;
  }
  cv::Mat kernel = view_of(spread).clone(), chart_spectrum, kernel_spectrum, product, image;
  swap_quadrants(kernel);
  cv::dft(chart, chart_spectrum, cv::DFT_COMPLEX_OUTPUT);
  cv::dft(kernel, kernel_spectrum, cv::DFT_COMPLEX_OUTPUT);
  cv::mulSpectrums(chart_spectrum, kernel_spectrum, product, 0);
  cv::dft(product, image, cv::DFT_INVERSE | cv::DFT_REAL_OUTPUT | cv::DFT_SCALE);
  return {spread.side, spread.arcmin_per_pixel, {image.begin<float>(), image.end<float>()}};
}

Modulation modulation_transfer(const Picture& spread, const std::vector<double>& cpd) {
  cv::Mat spectrum, parts[2], kernel = view_of(spread).clone();
  cv::dft(kernel, spectrum, cv::DFT_COMPLEX_OUTPUT);
  cv::split(spectrum, parts);
  const double step_cpd = 60 / (spread.side * spread.arcmin_per_pixel);
  const auto at = [&](double frequency, bool along_x) {
    const double position = frequency / step_cpd;
    const int low = static_cast<int>(position);
    if (low + 1 >= spread.side / 2) return 0.0;
    const auto modulus = [&](int i) {
      const int row = along_x ? 0 : i, column = along_x ? i : 0;
      return std::hypot(parts[0].at<float>(row, column), parts[1].at<float>(row, column));
    };
    return modulus(low) + (position - low) * (modulus(low + 1) - modulus(low));
  };
  Modulation result;
  for (const double frequency : cpd) {
    result.horizontal.push_back(at(frequency, true));
    result.vertical.push_back(at(frequency, false));
  }
  return result;
}

double diffraction_mtf(double cpd, double pupil_mm, double wavelength_nm) {
  const double cutoff_cpd = pupil_mm / (wavelength_nm * 1e-6) * degree;
  const double u = cpd / cutoff_cpd;
  return u >= 1 ? 0 : 2 / pi * (std::acos(u) - u * std::sqrt(1 - u * u));
}

double healthy_mtf(double cpd, double pupil_mm) {
  constexpr double wavelength_nm = 555;
  const double d = pupil_mm, u1 = 21.95 - 5.512 * d + 0.3922 * d * d;
  return std::pow(1 + cpd * cpd / (u1 * u1), -0.62) * std::sqrt(diffraction_mtf(cpd, d, wavelength_nm));
}

std::string grey_png(const Picture& picture, int crop_side, int out_side, double white) {
  const int crop = std::min(crop_side, picture.side), from = (picture.side - crop) / 2;
  cv::Mat part = view_of(picture)(cv::Rect(from, from, crop, crop)) / white;
  cv::Mat sized, bytes(out_side, out_side, CV_8U);
  cv::resize(part, sized, {out_side, out_side}, 0, 0, crop > out_side ? cv::INTER_AREA : cv::INTER_LINEAR);
  for (int row = 0; row < out_side; ++row)
    for (int column = 0; column < out_side; ++column) {
      const double linear = std::clamp<double>(sized.at<float>(row, column), 0, 1);
      const double encoded = linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
      bytes.at<unsigned char>(row, column) = static_cast<unsigned char>(std::lround(255 * encoded));
    }
  std::vector<unsigned char> png;
  if (!cv::imencode(".png", bytes, png, {cv::IMWRITE_PNG_COMPRESSION, 9}))
    throw Error(ExitStatus::fault, "cannot encode a PNG");
  return {png.begin(), png.end()};
}

}  // namespace emmetrope::report
