#include "pipeline/report/figures/encoding.hpp"

#include <glib.h>

#include <memory>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "pipeline/base/clean_text.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"

namespace emmetrope::report {
namespace {

struct FreeByGlib {
  void operator()(gchar* text) const { g_free(text); }
};
using GlibText = std::unique_ptr<gchar, FreeByGlib>;

/// Its larger side at most so long; an empty picture stays empty.
cv::Mat shrunk(const cv::Mat& image, int most_px) {
  const int side = std::max(image.cols, image.rows);
  if (side <= most_px) return image;
  cv::Mat smaller;
  const double scale = static_cast<double>(most_px) / side;
  cv::resize(image, smaller, {}, scale, scale, cv::INTER_AREA);
  return smaller;
}

Error no_picture(const std::filesystem::path& file) {
  return input_error(file.string() + " is no picture", "run the stage that made it again");
}

}  // namespace

std::string base64(std::string_view bytes) {
  const GlibText text(g_base64_encode(reinterpret_cast<const guchar*>(bytes.data()), bytes.size()));
  return text.get();
}

std::string page_png(const std::filesystem::path& file) {
  constexpr std::uintmax_t most_bytes = 500'000;
  constexpr int side_px = 640;
  if (file.empty()) return {};
  if (std::filesystem::file_size(file) <= most_bytes) return read_file(file);
  const cv::Mat image = shrunk(cv::imread(file.string(), cv::IMREAD_COLOR), side_px);
  std::vector<unsigned char> bytes;
  if (image.empty() || !cv::imencode(".png", image, bytes)) throw no_picture(file);
  return {bytes.begin(), bytes.end()};
}

PagePicture page_picture(const std::filesystem::path& file) {
  constexpr int side_px = 1200;
  const cv::Mat image = shrunk(cv::imread(file.string(), cv::IMREAD_COLOR), side_px);
  std::vector<unsigned char> bytes;
  if (image.empty() || !cv::imencode(".jpg", image, bytes, {cv::IMWRITE_JPEG_QUALITY, 88}))
    throw no_picture(file);
  return {"data:image/jpeg;base64," + base64({reinterpret_cast<const char*>(bytes.data()), bytes.size()}),
          image.cols, image.rows};
}

std::string png_url(std::string_view png) { return "data:image/png;base64," + base64(png); }

std::string escape_xml(const std::string& text) {
  std::string escaped;
  for (const char c : clean_utf8(text)) {
    switch (c) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      case '\'':
        escaped += "&#39;";
        break;
      default:
        escaped += c;
    }
  }
  return escaped;
}

}  // namespace emmetrope::report
