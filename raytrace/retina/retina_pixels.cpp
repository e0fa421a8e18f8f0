#include "raytrace/retina/retina_pixels.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <numeric>

#include "pipeline/base/frames.hpp"
#include "pipeline/base/parallel.hpp"

namespace emmetrope::raytrace {
namespace {

constexpr int side = 4;  // pixels of a tile, and the least that they are apart

}  // namespace

PixelOrder row_after_row(int width, int height) {
  PixelOrder order;
  order.pixels.resize(static_cast<std::size_t>(width) * height);
  std::iota(order.pixels.begin(), order.pixels.end(), 0);
  return order;
}

std::vector<int> block_edges(int pixels) {
  const int fours = (pixels + 3) / 4, blocks = std::max(1, fours / 4);
  std::vector<int> edges;
  for (int block = 0; block <= blocks; ++block)
    edges.push_back(std::min(pixels, 4 * static_cast<int>(1LL * fours * block / blocks)));
  return edges;
}

PixelOrder in_tiles(int width, int height) {
  const std::vector<int> columns = block_edges(width), rows = block_edges(height);
  const auto apart = [](int first, int end) { return std::max(side, (end - first + side - 1) / side); };
  PixelOrder order;
  order.together = side * side;
  for (std::size_t j = 0; j + 1 < rows.size(); ++j)
    for (std::size_t i = 0; i + 1 < columns.size(); ++i) {
      const int across = apart(columns[i], columns[i + 1]), down = apart(rows[j], rows[j + 1]);
      for (int tile = 0; tile < across * down; ++tile) {
        std::array<int, std::size_t{side} * side> pixels{};
        for (int lane = 0; lane < order.together; ++lane) {
          const int x = columns[i] + tile % across + lane % side * across,
                    y = rows[j] + tile / across + lane / side * down;
          pixels[lane] = x < columns[i + 1] && y < rows[j + 1] ? y * width + x : -1;
        }
        if (std::any_of(pixels.begin(), pixels.end(), [](int pixel) { return pixel >= 0; }))
          order.pixels.insert(order.pixels.end(), pixels.begin(), pixels.end());
      }
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
  RetinaPixels pixels{
      std::vector<float>(count * RetinaPixels::floats_a_pixel), std::vector<float>(count), {}};
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
