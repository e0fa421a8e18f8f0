#include "raytrace/tracer/retina_pixels.hpp"

#include <Eigen/LU>
#include <exception>
#include <mutex>
#include <thread>

#include "pipeline/base/frames.hpp"

namespace emmetrope::raytrace {

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
