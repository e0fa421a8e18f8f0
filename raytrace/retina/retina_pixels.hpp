#pragma once
#include <vector>

#include "pipeline/eye/model/eye_model.hpp"
#include "raytrace/picture/trace_settings.hpp"
#include "raytrace/retina/pupil_aim.hpp"

namespace emmetrope::raytrace {

/// What the kernels know of every pixel: retina point, aim ellipse and normal, `floats_a_pixel` each (PIXEL
/// in kernels/trace.cl), row after row from the picture's top; and the area of the ellipse.
struct RetinaPixels {
  static constexpr int floats_a_pixel = 12;
  std::vector<float> values;
  std::vector<float> area_mm2;
  std::vector<char> unseen;  ///< where the eye sees nothing; empty where it sees all of the picture
  bool is_unseen(std::size_t pixel) const { return !unseen.empty() && unseen[pixel] != 0; }
};

/// The order in which work-items take pixels: `together` pixels each.
struct PixelOrder {
  int together = 1;
  std::vector<int> pixels;  ///< of every place; -1 beyond the picture's edge
  std::size_t items() const { return pixels.size() / together; }
  /// Value k of `values` that a work-item has for the pixel at a place.
  std::size_t at(std::size_t place, int values, int k) const {
    return (place / together * values + k) * together + place % together;
  }
};
PixelOrder row_after_row(int width, int height);
/// Where the blocks of a side of so many pixels begin, and where the last one ends: 16 pixels each, or 20 (28
/// of a short side) where 16 does not divide the side, so that few lanes of a tile are left without a pixel.
std::vector<int> block_edges(int pixels);
/// Sixteen pixels of a block together, evenly spread over it: at least four apart.
PixelOrder in_tiles(int width, int height);

/// Values of pixels that stand row after row, in another order; places beyond the edge repeat a pixel of the
/// picture.
std::vector<float> in_order(const std::vector<float>& values, int floats_a_pixel, const PixelOrder& order);

/// \throw Error (input_invalid) when the retina does not fill the grid
RetinaPixels make_pixels(const EyeModel& eye, const RetinalGrid& grid, const PupilAim& aim, int threads);

}  // namespace emmetrope::raytrace
