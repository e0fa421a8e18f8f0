#include "raytrace/tracer/retina_pixels.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <numeric>

#include "pipeline/base/frames.hpp"
#include "raytrace/tracer/parallel.hpp"

namespace emmetrope::raytrace {

PixelOrder row_after_row(int width, int height) {
  PixelOrder order;
  order.pixels.resize(static_cast<std::size_t>(width) * height);
  std::iota(order.pixels.begin(), order.pixels.end(), 0);
  return order;
}

PixelOrder in_tiles(int width, int height) {
  constexpr int block = 16, apart = 4;
  PixelOrder order;
  order.together = 16;
  for (int y0 = 0; y0 < height; y0 += block)
    for (int x0 = 0; x0 < width; x0 += block)
      for (int tile = 0; tile < apart * apart; ++tile) {
        std::array<int, 16> pixels{};
        for (int lane = 0; lane < order.together; ++lane) {
          const int x = x0 + tile % apart + lane % apart * apart,
                    y = y0 + tile / apart + lane / apart * apart;
          pixels[lane] = x < width && y < height ? y * width + x : -1;
        }
        if (std::any_of(pixels.begin(), pixels.end(), [](int pixel) { return pixel >= 0; }))
          order.pixels.insert(order.pixels.end(), pixels.begin(), pixels.end());
      }
  return order;
}

std::vector<float> in_order(const std::vector<float>& values, int floats, const PixelOrder& order) {
  std::vector<float> ordered(order.pixels.size() * floats);
  for (std::size_t item = 0; item < order.items(); ++item) {
    const auto first = order.pixels.begin() + static_cast<std::ptrdiff_t>(item * order.together);
    const int inside = *std::find_if(first, first + order.together, [](int pixel) { return pixel >= 0; });
    for (int lane = 0; lane < order.together; ++lane) {
      const std::size_t place = item * order.together + lane;
      const std::size_t pixel = order.pixels[place] < 0 ? inside : order.pixels[place];
      for (int k = 0; k < floats; ++k) ordered[order.at(place, floats, k)] = values[pixel * floats + k];
    }
  }
  return ordered;
}

RetinaPixels make_pixels(const EyeModel& eye, const RetinalGrid& grid, const PupilAim& aim, int threads) {
  const std::size_t count = static_cast<std::size_t>(grid.width) * grid.height;
  RetinaPixels pixels{std::vector<float>(count * RetinaPixels::floats_a_pixel), std::vector<float>(count)};
  // The retinal image is upside down: the picture's top left is seen by the retina's lower left in eye x and
  // y.
  std::vector<double> x_mm(grid.width);
  for (int column = 0; column < grid.width; ++column)
    x_mm[column] = grid.centre_mm.x() + grid.field_x_mm * ((column + 0.5) / grid.width - 0.5);
  on_threads(threads, grid.height, [&](std::size_t row) {
    const double y_mm =
        grid.centre_mm.y() + grid.field_y_mm * ((static_cast<double>(row) + 0.5) / grid.height - 0.5);
    const std::vector<AimEllipse> ellipses = aim.along_row(y_mm, x_mm);
    for (int column = 0; column < grid.width; ++column) {
      const RetinaPoint point = retina_point(eye, x_mm[column], y_mm);
      const AimEllipse& ellipse = ellipses[column];
      const std::size_t index = row * grid.width + column;
      float* p = &pixels.values[index * RetinaPixels::floats_a_pixel];
      for (int i = 0; i < 3; ++i) p[i] = static_cast<float>(point.position_mm[i]);
      for (int i = 0; i < 2; ++i) p[3 + i] = static_cast<float>(ellipse.centre_mm[i]);
      for (int i = 0; i < 4; ++i) p[5 + i] = static_cast<float>(ellipse.from_disc(i / 2, i % 2));
      for (int i = 0; i < 3; ++i) p[9 + i] = static_cast<float>(point.normal[i]);
      pixels.area_mm2[index] = static_cast<float>(pi * std::abs(ellipse.from_disc.determinant()));
    }
  });
  return pixels;
}

}  // namespace emmetrope::raytrace
