#include "pipeline/report/figures/letter_chart.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "pipeline/base/error.hpp"
#include "raytrace/scene/optotypes.hpp"

namespace emmetrope::report {
namespace {

constexpr double pitch_in_letters = 1.6;

double letter_arcmin(double logmar) { return 5 * std::pow(10, logmar); }

/// Share of ink in the square of side `step` about (x, y), in minutes of arc from the middle of the chart, y
/// downwards.
float ink_at(const std::vector<LetterLine>& lines, double x, double y, double step) {
  for (std::size_t row = 0; row < lines.size(); ++row) {
    const LetterLine& line = lines[row];
    const double letter = line.letter_arcmin, pitch = pitch_in_letters * letter;
    const double from_top = y - line.middle_arcmin + letter / 2;
    if (from_top < -step || from_top > letter + step) continue;
    const double from_left = x + (pitch * line.letters - 0.6 * letter) / 2;
    const int place = static_cast<int>(std::floor((from_left + 0.3 * letter) / pitch));
    if (place < 0 || place >= line.letters) continue;
    // A stride of three goes once through all ten letters.
    const char name = raytrace::sloan_letters[(5 * row + 3 * static_cast<std::size_t>(place)) % 10];
    constexpr int fine = 4;
    int ink = 0;
    for (int i = 0; i < fine; ++i)
      for (int j = 0; j < fine; ++j) {
        const double u = from_left - place * pitch + ((j + 0.5) / fine - 0.5) * step;
        const double v = from_top + ((i + 0.5) / fine - 0.5) * step;
        ink += raytrace::sloan_ink(name, 5 * u / letter, 5 - 5 * v / letter) ? 1 : 0;
      }
    return static_cast<float>(ink) / (fine * fine);
  }
  return 0;
}

}  // namespace

std::vector<LetterLine> letter_lines(const std::vector<double>& logmar, double width_arcmin) {
  double total = -0.6 * letter_arcmin(logmar.back());
  for (const double acuity : logmar) total += pitch_in_letters * letter_arcmin(acuity);
  std::vector<LetterLine> lines;
  double top = -total / 2;
  for (const double acuity : logmar) {
    const double letter = letter_arcmin(acuity), pitch = pitch_in_letters * letter;
    const int fitting = static_cast<int>((width_arcmin + 0.6 * letter) / pitch);
    lines.push_back({acuity, letter, top + letter / 2, std::clamp(fitting, 1, 5)});
    top += pitch;
  }
  return lines;
}

Picture blurred_letters(const raytrace::PointSpread& spread, const std::vector<LetterLine>& lines,
                        double field_arcmin) {
  const double step = spread.pitch_arcmin;
  // The blur must not come in again on the other side. Even, and a product of small primes.
  const int side =
      2 * cv::getOptimalDFTSize((static_cast<int>(std::ceil(field_arcmin / step)) + spread.size + 1) / 2);
  const int middle = side / 2, half = spread.size / 2;
  cv::Mat chart(side, side, CV_32F), kernel = cv::Mat::zeros(side, side, CV_32F);
  for (int row = 0; row < side; ++row)
    for (int column = 0; column < side; ++column)
      chart.at<float>(row, column) = 1 - ink_at(lines, (column - middle) * step, (row - middle) * step, step);
  for (int row = 0; row < spread.size; ++row)  // zero angle goes to the corner
    for (int column = 0; column < spread.size; ++column)
      kernel.at<float>((row - half + side) % side, (column - half + side) % side) =
          spread.values[static_cast<std::size_t>(row) * spread.size + column];
  cv::Mat chart_spectrum, kernel_spectrum, product, image;
  cv::dft(chart, chart_spectrum);  // of real values, in half the room
  cv::dft(kernel, kernel_spectrum);
  cv::mulSpectrums(chart_spectrum, kernel_spectrum, product, 0);
  cv::dft(product, image, cv::DFT_INVERSE | cv::DFT_SCALE);
  return {side, step, {image.begin<float>(), image.end<float>()}};
}

std::string grey_png(const Picture& picture, double shown_arcmin, int out_side, double white) {
  const int crop = static_cast<int>(shown_arcmin / picture.arcmin_per_pixel / 2) * 2;
  cv::Mat whole(picture.side, picture.side, CV_32F);
  std::memcpy(whole.data, picture.values.data(), picture.values.size() * sizeof(float));
  cv::Mat part;
  if (const int missing = std::max(0, crop - picture.side); missing > 0) {
    const int edge = (missing + 1) / 2;
    cv::copyMakeBorder(whole, part, edge, edge, edge, edge, cv::BORDER_CONSTANT, 0);
  } else {
    const int from = picture.side / 2 - crop / 2;
    part = whole(cv::Rect(from, from, crop, crop));
  }
  cv::Mat sized, bytes(out_side, out_side, CV_8U);
  cv::resize(part / white, sized, {out_side, out_side}, 0, 0,
             crop > out_side ? cv::INTER_AREA : cv::INTER_LINEAR);
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
