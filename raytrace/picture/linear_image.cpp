#include <opencv2/imgcodecs.hpp>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "raytrace/picture/linear_image.hpp"
#include "raytrace/picture/spectrum.hpp"

namespace emmetrope::raytrace {
namespace {

/// OpenCV wants blue first.
int source_channel(const LinearImage& image, int channel) {
  return image.channels >= 3 && channel < 3 ? 2 - channel : channel;
}

void write(const std::filesystem::path& file, const cv::Mat& picture, const std::string& ending,
           const std::vector<int>& options) {
  std::vector<unsigned char> bytes;
  if (!cv::imencode(ending, picture, bytes, options))
    throw Error(ExitStatus::fault, "cannot encode " + file.string());
  write_file(file, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

/// Light is encoded, the cover is linear.
unsigned char encoded(const LinearImage& image, int column, int row, int channel) {
  const double value = image.at(column, row, source_channel(image, channel));
  return static_cast<unsigned char>(std::lround(255 * (channel < 3 ? srgb_encoded(value) : value)));
}

}  // namespace

LinearImage with_cover(const LinearImage& image, const std::vector<char>& unseen) {
  if (unseen.empty()) return image;
  LinearImage covered{image.width, image.height, 4, {}};
  covered.values.reserve(4 * unseen.size());
  for (std::size_t pixel = 0; pixel < unseen.size(); ++pixel) {
    for (int c = 0; c < 3; ++c) covered.values.push_back(image.values[3 * pixel + c]);
    covered.values.push_back(unseen[pixel] != 0 ? 0.F : 1.F);
  }
  return covered;
}

void write_png(const std::filesystem::path& file, const LinearImage& image) {
  cv::Mat picture(image.height, image.width, CV_8UC(image.channels));
  for (int row = 0; row < image.height; ++row)
    for (int column = 0; column < image.width; ++column)
      for (int c = 0; c < image.channels; ++c)
        picture.ptr<unsigned char>(row)[column * image.channels + c] = encoded(image, column, row, c);
  write(file, picture, ".png", {cv::IMWRITE_PNG_COMPRESSION, 6});
}

}  // namespace emmetrope::raytrace
