#include "raytrace/scene/picture.hpp"

#include <array>
#include <cmath>
#include <limits>
#include <new>
#include <opencv2/imgcodecs.hpp>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"

namespace emmetrope::raytrace {
namespace {

constexpr int largest_picture = 16384;

/// Nothing where OpenCV cannot read it, which of broken files it says by an exception or by an empty picture.
template <typename Read>
auto read_or_nothing(Read read) -> decltype(read()) {
  try {
    return read();
  } catch (const cv::Exception& fault) {
    if (fault.code == cv::Error::StsNoMem) throw std::bad_alloc();
    return {};
  }
}

}  // namespace

float linear_light(unsigned char value) {
  const double v = value / 255.0;
  return static_cast<float>(v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4));
}

std::shared_ptr<const Texture> decode_picture(const std::string& bytes, const std::string& name) {
  const cv::Mat picture = read_or_nothing([&] {
    if (bytes.empty() || bytes.size() > std::numeric_limits<int>::max()) return cv::Mat();
    const cv::Mat raw(1, static_cast<int>(bytes.size()), CV_8UC1, const_cast<char*>(bytes.data()));
    return cv::imdecode(raw, cv::IMREAD_COLOR);
  });
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

std::shared_ptr<const SpectralPicture> read_spectral_picture(const std::filesystem::path& file,
                                                             const std::vector<double>& wavelength_nm) {
  read_file(file);  // says what is wrong with the file itself
  const std::vector<cv::Mat> pages = read_or_nothing([&] {
    std::vector<cv::Mat> read;
    return cv::imreadmulti(file.string(), read, cv::IMREAD_UNCHANGED) ? read : std::vector<cv::Mat>();
  });
  if (pages.empty()) throw input_error(file.string() + " is no TIFF that can be read");
  if (pages.size() != wavelength_nm.size())
    throw input_error(file.string() + " has " + std::to_string(pages.size()) + " pages, and there are " +
                          std::to_string(wavelength_nm.size()) + " wavelengths_nm",
                      "give a page for every wavelength");
  SpectralPicture picture{wavelength_nm, {}};
  for (const cv::Mat& page : pages) {
    if (page.type() != CV_32FC1 || page.size() != pages.front().size() || page.cols < 2 || page.rows < 2 ||
        page.cols > largest_picture || page.rows > largest_picture)
      throw input_error(
          file.string() + ": a page is no picture of 32-bit floats of one channel and the first one's size",
          "write spectral radiance in W / (m^2 sr nm) as 32-bit floats");
    Texture texture{page.cols, page.rows, 1, {}};
    for (int row = 0; row < page.rows; ++row)
      texture.values.insert(texture.values.end(), page.ptr<float>(row), page.ptr<float>(row) + page.cols);
    for (const float value : texture.values)
      if (!(value >= 0 && std::isfinite(value)))
        throw input_error(file.string() + " holds a radiance of " + std::to_string(value),
                          "spectral radiance is finite and not negative");
    picture.pages.push_back(std::move(texture));
  }
  return std::make_shared<const SpectralPicture>(std::move(picture));
}

std::shared_ptr<const Texture> read_picture(const std::filesystem::path& file) {
  return decode_picture(read_file(file), file.string());
}

}  // namespace emmetrope::raytrace
