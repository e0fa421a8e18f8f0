#pragma once
#include <cstddef>
#include <filesystem>
#include <vector>

namespace emmetrope::raytrace {

/// Linear-light image, row after row from the top as the patient perceives it, channels interleaved: grey, red green
/// blue, or with a fourth what the picture covers (0 to 1).
struct LinearImage {
  int width = 0, height = 0, channels = 3;
  std::vector<float> values;
  float at(int column, int row, int channel) const {
    return values[(static_cast<std::size_t>(row) * width + column) * channels + channel];
  }
};

/// The three channels of an image and its cover: none at `unseen` pixels, where that is not empty.
LinearImage with_cover(const LinearImage& image, const std::vector<char>& unseen);

/// Writes sRGB-encoded PNG from linear light; whole or not at all.
void write_png(const std::filesystem::path& file, const LinearImage& image);

}  // namespace emmetrope::raytrace
