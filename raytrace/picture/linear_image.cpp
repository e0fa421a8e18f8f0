#include <cstdlib>
#include <opencv2/imgcodecs.hpp>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "raytrace/picture/linear_image.hpp"
#include "raytrace/picture/spectrum.hpp"

namespace emmetrope::raytrace {
namespace {

/// libtiff's COMPRESSION_NONE: left to itself OpenCV packs colours logarithmically, 2 % off.
constexpr int uncompressed = 1;

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

cv::Mat floats_of(const LinearImage& image) {
  cv::Mat picture(image.height, image.width, CV_32FC(image.channels));
  for (int row = 0; row < image.height; ++row)
    for (int column = 0; column < image.width; ++column)
      for (int c = 0; c < image.channels; ++c)
        picture.ptr<float>(row)[column * image.channels + c] =
            image.at(column, row, source_channel(image, c));
  return picture;
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

void write_tiff(const std::filesystem::path& file, const LinearImage& image) {
  write(file, floats_of(image), ".tiff", {cv::IMWRITE_TIFF_COMPRESSION, uncompressed});
}

void write_tiff_pages(const std::filesystem::path& file, const std::vector<LinearImage>& images) {
  std::vector<cv::Mat> pages;
  for (const LinearImage& image : images) pages.push_back(floats_of(image));
  // OpenCV encodes several pages into files only.
  std::filesystem::path part = file;
  part += ".part.tiff";
  if (!cv::imwritemulti(part.string(), pages, {cv::IMWRITE_TIFF_COMPRESSION, uncompressed}))
    throw output_error("cannot write " + part.string());
  const std::string bytes = read_file(part);
  std::filesystem::remove(part);
  write_file(file, bytes);
}

void write_exr(const std::filesystem::path& file, const LinearImage& image) {
  // OpenCV reads and writes OpenEXR where this says so.
  setenv("OPENCV_IO_ENABLE_OPENEXR", "1", 1);
  write(file, floats_of(image), ".exr", {cv::IMWRITE_EXR_TYPE, cv::IMWRITE_EXR_TYPE_FLOAT});
}

}  // namespace emmetrope::raytrace
