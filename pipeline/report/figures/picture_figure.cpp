#include "pipeline/report/figures/picture_figure.hpp"

#include <fmt/format.h>

#include "pipeline/report/figures/encoding.hpp"

namespace emmetrope::report {

Figure picture_figure(const std::filesystem::path& file, const std::string& id) {
  const PagePicture picture = page_picture(file);
  Figure figure;
  figure.id = id;
  figure.width_px = picture.width_px;
  figure.height_px = picture.height_px;
  figure.svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" xmlns:xlink=\"http://www.w3.org/1999/xlink\" viewBox=\"0 0 "
      "{0} {1}\"><image width=\"{0}\" height=\"{1}\" xlink:href=\"{2}\"/></svg>",
      figure.width_px, figure.height_px, picture.url);
  return figure;
}

}  // namespace emmetrope::report
