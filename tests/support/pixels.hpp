#pragma once
#include <filesystem>
#include <opencv2/imgcodecs.hpp>

namespace emmetrope::test {

/// Pixels of a picture that are of exactly this colour.
/// \param colour  blue, green, red
inline int pixels_of(const std::filesystem::path& file, const cv::Vec3b& colour) {
  const cv::Mat picture = cv::imread(file.string());
  int pixels = 0;
  for (int y = 0; y < picture.rows; ++y)
    for (int x = 0; x < picture.cols; ++x) pixels += picture.at<cv::Vec3b>(y, x) == colour ? 1 : 0;
  return pixels;
}

}  // namespace emmetrope::test
