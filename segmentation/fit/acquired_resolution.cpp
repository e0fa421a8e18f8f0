#include "segmentation/fit/acquired_resolution.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <vector>

#include "pipeline/base/frames.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3i;

/// Lines along an axis (0: columns, 1: rows, 2: slices) that meet tissue, each less its mean, under a Hann window.
cv::Mat lines_along(const Stack& stack, int axis) {
  const Vector3i size(stack.columns, stack.rows, stack.slices());
  const int across = (axis + 1) % 3, over = (axis + 2) % 3, length = size[axis];
  std::vector<float> window;
  for (int i = 0; i < length; ++i)
    window.push_back(static_cast<float>(0.5 - 0.5 * std::cos(2 * pi * i / (length - 1))));
  cv::Mat lines(0, length, CV_32F), line(1, length, CV_32F);
  float brightest = 0;
  std::vector<float> peaks;
  Vector3i voxel;
  for (voxel[over] = 0; voxel[over] < size[over]; ++voxel[over])
    for (voxel[across] = 0; voxel[across] < size[across]; ++voxel[across]) {
      for (voxel[axis] = 0; voxel[axis] < length; ++voxel[axis])
        line.at<float>(voxel[axis]) = stack.at(voxel[0], voxel[1], voxel[2]);
      peaks.push_back(*std::max_element(line.begin<float>(), line.end<float>()));
      brightest = std::max(brightest, peaks.back());
      line -= cv::mean(line);
      for (int i = 0; i < length; ++i) line.at<float>(i) *= window[static_cast<std::size_t>(i)];
      lines.push_back(line);
    }
  constexpr float tissue = 0.1F;
  cv::Mat met(0, length, CV_32F);
  for (int k = 0; k < lines.rows; ++k)
    if (peaks[static_cast<std::size_t>(k)] > tissue * brightest) met.push_back(lines.row(k));
  return met;
}

double share_along(const Stack& stack, int axis) {
  constexpr int fewest = 16;  // voxels of a line whose spectrum tells anything
  const cv::Mat lines = lines_along(stack, axis);
  if (lines.rows == 0 || lines.cols < fewest) return 1;
  cv::Mat spectra;
  cv::dft(lines, spectra, cv::DFT_ROWS | cv::DFT_COMPLEX_OUTPUT);
  const int highest = lines.cols / 2;
  // Times the square of the frequency, by which images' power falls.
  std::vector<double> level(static_cast<std::size_t>(highest) + 1, 0.0);
  for (int k = 0; k <= highest; ++k) {
    for (int i = 0; i < spectra.rows; ++i) {
      const auto& value = spectra.at<cv::Vec2f>(i, k);
      level[static_cast<std::size_t>(k)] += double(value[0]) * value[0] + double(value[1]) * value[1];
    }
    level[static_cast<std::size_t>(k)] *= double(k) * k;
  }
  const auto at = [&](double share) { return static_cast<std::size_t>(std::lround(share * highest)); };
  double reference = 0;
  for (std::size_t k = std::max<std::size_t>(1, at(0.05)); k <= at(0.3); ++k)
    reference += level[k] / static_cast<double>(at(0.3) - std::max<std::size_t>(1, at(0.05)) + 1);
  constexpr double nothing = 0.063;  // 12 dB
  std::size_t last = at(0.95);       // what wraps around, or an offset that alternates, is above
  while (last > 1 && level[last] < nothing * reference) --last;
  // Scanners leave out corners and up to a quarter of a side of k-space, and smooth its rim.
  constexpr double rim = 0.75;
  const double share = static_cast<double>(last) / highest;
  return share < rim ? share : 1;
}

}  // namespace

AcquiredResolution acquired_resolution(const Stack& stack) {
  return {{share_along(stack, 0), share_along(stack, 1), share_along(stack, 2)}};
}

}  // namespace emmetrope::segmentation
