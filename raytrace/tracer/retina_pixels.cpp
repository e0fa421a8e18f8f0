#include "raytrace/tracer/retina_pixels.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <exception>
#include <mutex>
#include <numeric>
#include <thread>

#include "pipeline/base/frames.hpp"

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

std::vector<float> in_order(const RetinaPixels& pixels, const PixelOrder& order) {
  constexpr int floats = RetinaPixels::floats_a_pixel;
  std::vector<float> values(order.pixels.size() * floats);
  for (std::size_t item = 0; item < order.items(); ++item) {
    const auto first = order.pixels.begin() + static_cast<std::ptrdiff_t>(item * order.together);
    const int inside = *std::find_if(first, first + order.together, [](int pixel) { return pixel >= 0; });
    for (int lane = 0; lane < order.together; ++lane) {
      const std::size_t place = item * order.together + lane;
      const std::size_t pixel = order.pixels[place] < 0 ? inside : order.pixels[place];
      for (int k = 0; k < floats; ++k) values[order.at(place, floats, k)] = pixels.values[pixel * floats + k];
    }
  }
  return values;
}

RetinaPixels make_pixels(const EyeModel& eye, const RetinalGrid& grid, const PupilAim& aim, int threads) {
  const std::size_t count = static_cast<std::size_t>(grid.width) * grid.height;
  RetinaPixels pixels{std::vector<float>(count * RetinaPixels::floats_a_pixel), std::vector<float>(count)};
  std::exception_ptr fault;
  std::mutex mutex;
  const auto rows = [&](int first, int step) {
    try {
      for (int row = first; row < grid.height; row += step)
        for (int column = 0; column < grid.width; ++column) {
          // The retinal image is upside down: the picture's top left is seen by the retina's lower left in
          // eye x and y.
          const double x = grid.centre_mm.x() + grid.field_x_mm * ((column + 0.5) / grid.width - 0.5);
          const double y = grid.centre_mm.y() + grid.field_y_mm * ((row + 0.5) / grid.height - 0.5);
          const RetinaPoint point = retina_point(eye, x, y);
          const AimEllipse ellipse = aim.at(x, y);
          const std::size_t index = static_cast<std::size_t>(row) * grid.width + column;
          float* p = &pixels.values[index * RetinaPixels::floats_a_pixel];
          for (int i = 0; i < 3; ++i) p[i] = static_cast<float>(point.position_mm[i]);
          for (int i = 0; i < 2; ++i) p[3 + i] = static_cast<float>(ellipse.centre_mm[i]);
          for (int i = 0; i < 4; ++i) p[5 + i] = static_cast<float>(ellipse.from_disc(i / 2, i % 2));
          for (int i = 0; i < 3; ++i) p[9 + i] = static_cast<float>(point.normal[i]);
          pixels.area_mm2[index] = static_cast<float>(pi * std::abs(ellipse.from_disc.determinant()));
        }
    } catch (...) {
      const std::lock_guard<std::mutex> lock(mutex);
      fault = std::current_exception();
    }
  };
  std::vector<std::thread> workers;
  for (int t = 1; t < threads; ++t) workers.emplace_back(rows, t, threads);
  rows(0, threads);
  for (auto& worker : workers) worker.join();
  if (fault) std::rethrow_exception(fault);
  return pixels;
}

}  // namespace emmetrope::raytrace
