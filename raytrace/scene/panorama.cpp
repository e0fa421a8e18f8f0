#include "raytrace/scene/panorama.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "pipeline/base/frames.hpp"

namespace emmetrope::raytrace {
namespace {

using Eigen::Vector3d;

/// Of a perimeter's lines: half width, and what a line's edge takes.
constexpr double thin_deg = 0.15, bold_deg = 0.4, edge_deg = 0.09;

/// Share of ink this far from the middle of a line.
double ink(double away_deg, double half_width_deg) {
  return std::clamp((half_width_deg - std::abs(away_deg)) / edge_deg + 0.5, 0.0, 1.0);
}

/// How far from the nearest multiple of a step.
double beside(double value, double step) { return value - step * std::round(value / step); }

float perimeter_light(const Vector3d& direction) {
  const double eccentricity_deg = std::atan2(direction.head<2>().norm(), direction.z()) / degree;
  const double meridian_deg = std::atan2(direction.y(), -direction.x()) / degree;  // from the patient's right
  const double nearest_deg = 10 * std::round(eccentricity_deg / 10);
  const bool bold = std::abs(beside(nearest_deg, 30)) < 1;
  const double circle = nearest_deg > 0 ? ink(eccentricity_deg - nearest_deg, bold ? bold_deg : thin_deg) : 0;
  // As wide on the sphere wherever it is; none near the middle, where spokes would run together.
  const double spoke_deg = beside(meridian_deg, 30) * std::sin(eccentricity_deg * degree);
  const double spoke = eccentricity_deg > 2 ? ink(spoke_deg, thin_deg) : 0;
  const int quadrant = static_cast<int>(std::floor(meridian_deg / 90)) + 2;  // 2: up and to the right
  constexpr std::array<double, 4> greys{0.95, 0.75, 0.45, 0.6};
  return static_cast<float>(greys[std::clamp(quadrant, 0, 3)] * (1 - std::max(circle, spoke)));
}

/// Bilinear; columns go round, rows end at the poles.
void look_up(const Texture& picture, double column, double row, float* light) {
  const double c = column - 0.5, r = std::clamp(row - 0.5, 0.0, picture.height - 1.0);
  const int left = static_cast<int>(std::floor(c)), top = std::min(static_cast<int>(r), picture.height - 2);
  const double right_share = c - left, below_share = r - top;
  const auto at = [&](int x, int y, int channel) {
    const int wrapped = ((x % picture.width) + picture.width) % picture.width;
    return picture
        .values[(static_cast<std::size_t>(y) * picture.width + wrapped) * picture.channels + channel];
  };
  for (int k = 0; k < picture.channels; ++k) {
    const double above = (1 - right_share) * at(left, top, k) + right_share * at(left + 1, top, k),
                 below = (1 - right_share) * at(left, top + 1, k) + right_share * at(left + 1, top + 1, k);
    light[k] = static_cast<float>((1 - below_share) * above + below_share * below);
  }
}

}  // namespace

std::vector<TexturedPlane> surround(int texels, int channels,
                                    const std::function<void(const Vector3d&, float*)>& light_of) {
  const Vector3d x(1, 0, 0), y(0, 1, 0), z(0, 0, 1);
  std::vector<TexturedPlane> faces;
  for (const auto& [middle, up] :
       {std::pair(z, y), std::pair(Vector3d(-z), y), std::pair(x, y), std::pair(Vector3d(-x), y),
        std::pair(y, Vector3d(-z)), std::pair(Vector3d(-y), z)}) {
    TexturedPlane face;
    face.at_infinity = true;
    face.centre_mm = middle;
    face.up_mm = up;
    face.right_mm = middle.cross(up);
    Texture texture{texels, texels, channels,
                    std::vector<float>(std::size_t{1} * texels * texels * channels)};
    for (int row = 0; row < texels; ++row)
      for (int column = 0; column < texels; ++column) {
        const double across = 2 * (column + 0.5) / texels - 1, above = 1 - 2 * (row + 0.5) / texels;
        light_of((middle + across * face.right_mm + above * up).normalized(),
                 &texture.values[(static_cast<std::size_t>(row) * texels + column) * channels]);
      }
    face.texture = std::make_shared<const Texture>(std::move(texture));
    faces.push_back(std::move(face));
  }
  return faces;
}

std::vector<TexturedPlane> panorama(const Texture& picture) {
  const int texels = std::clamp(picture.width / 4, 16, 2048);
  return surround(texels, picture.channels, [&](const Vector3d& direction, float* light) {
    const double longitude = std::atan2(-direction.x(), direction.z()),
                 polar = std::acos(std::clamp(direction.y(), -1.0, 1.0));
    look_up(picture, (0.5 + longitude / (2 * pi)) * picture.width, polar / pi * picture.height, light);
  });
}

Scene perimeter() {
  constexpr int texels = 1024;
  Scene scene;
  scene.name = "perimeter";
  scene.planes = surround(
      texels, 1, [](const Vector3d& direction, float* light) { *light = perimeter_light(direction); });
  return scene;
}

}  // namespace emmetrope::raytrace
