#include "raytrace/scene/picture.hpp"

#include <array>
#include <cmath>
#include <opencv2/imgcodecs.hpp>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"

namespace emmetrope::raytrace {
namespace {

constexpr int largest_picture = 16384;

}  // namespace

float linear_light(unsigned char value) {
  const double v = value / 255.0;
  return static_cast<float>(v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4));
}

std::shared_ptr<const Texture> decode_picture(const std::string& bytes, const std::string& name) {
  const cv::Mat raw(1, static_cast<int>(bytes.size()), CV_8UC1, const_cast<char*>(bytes.data()));
  const cv::Mat picture = bytes.empty() ? cv::Mat() : cv::imdecode(raw, cv::IMREAD_COLOR);
  if (picture.empty()) throw input_error(name + " is no picture that can be read", "use PNG, JPEG or TIFF");
  if (picture.cols > largest_picture || picture.rows > largest_picture || picture.cols < 2 ||
      picture.rows < 2)
    throw input_error(
        name + " has " + std::to_string(picture.cols) + " x " + std::to_string(picture.rows) + " pixels",
        "use 2 to 16384 pixels a side");
  std::array<float, 256> light{};
  for (int i = 0; i < 256; ++i) light[i] = linear_light(static_cast<unsigned char>(i));
  Texture texture;
  texture.width = picture.cols;
  texture.height = picture.rows;
  texture.channels = 3;
  texture.values.reserve(3 * picture.total());
  for (int row = 0; row < picture.rows; ++row)
    for (int column = 0; column < picture.cols; ++column)
      for (int c = 0; c < 3; ++c)
        texture.values.push_back(light[picture.ptr<unsigned char>(row)[3 * column + 2 - c]]);
  return std::make_shared<const Texture>(std::move(texture));
}

std::shared_ptr<const Texture> read_picture(const std::filesystem::path& file) {
  return decode_picture(read_file(file), file.string());
}

}  // namespace emmetrope::raytrace
