#include "raytrace/retina/wide_field.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/base/parallel.hpp"
#include "raytrace/retina/pupil_aim.hpp"

namespace emmetrope::raytrace {
namespace {

constexpr int meridians = 48;  // an even number
constexpr int rings = 24;
constexpr int stencil = 6;

Eigen::Vector2d towards(double meridian) {
  const double angle = 2 * pi * meridian / meridians;
  return {std::cos(angle), std::sin(angle)};
}

/// No eye sees further: degrees, and mm along a retina.
constexpr double most_deg = 125, most_mm = 40;

/// Share of a meridian's length at which a ring lies: densest where the eye sees no further.
double share_of(int ring) { return std::sin(0.5 * pi * ring / rings); }

/// Lagrange's weights of six nodes, all but what depends on the place worked out once.
class SixNodes {
 public:
  SixNodes() = default;
  explicit SixNodes(const std::array<double, stencil>& nodes) : nodes_(nodes) {
    for (int i = 0; i < stencil; ++i) {
      factors_[i] = 1;
      for (int j = 0; j < stencil; ++j)
        if (j != i) factors_[i] /= nodes[i] - nodes[j];
    }
  }
  std::array<double, stencil> weights(double at) const {
    std::array<double, stencil> result = factors_;
    double below = 1, above = 1;
    for (int i = 0; i < stencil; ++i) {
      result[i] *= below;
      result[stencil - 1 - i] *= above;
      below *= at - nodes_[i];
      above *= at - nodes_[stencil - 1 - i];
    }
    return result;
  }

 private:
  std::array<double, stencil> nodes_{}, factors_{};
};

/// Of meridians, from the first of the six on.
const SixNodes& six_meridians() {
  static const SixNodes nodes({0, 1, 2, 3, 4, 5});
  return nodes;
}

/// Of rings, from every ring that may be the first of the six on.
const SixNodes& six_rings(int first) {
  static const auto all = [] {
    std::array<SixNodes, rings - stencil + 2> nodes;
    for (int k = 0; k < static_cast<int>(nodes.size()); ++k) {
      std::array<double, stencil> shares{};
      for (int i = 0; i < stencil; ++i) shares[i] = share_of(k + i);
      nodes[k] = SixNodes(shares);
    }
    return nodes;
  }();
  return all[first];
}

/// The first of six nodes about a place.
int first_node(double at) { return static_cast<int>(std::floor(at)) - (stencil / 2 - 1); }

/// Nodes of a perspective picture lie evenly in visual angle too.
RetinalGrid grid_of_nodes(RetinalGrid grid) {
  if (grid.projection == Projection::perspective) grid.projection = Projection::visual_angle;
  return grid;
}

Eigen::Vector2d place_of_node(const RetinalGrid& grid, const Eigen::Vector2d& place) {
  if (grid.projection != Projection::perspective || place.isZero(0)) return place;
  return std::atan(place.norm()) / degree * place.normalized();
}

int wrapped(int meridian) { return ((meridian % meridians) + meridians) % meridians; }

}  // namespace

WideField::WideField(const EyeModel& eye, const RetinalGrid& grid, double wavelength_nm,
                     double place_wavelength_nm, int threads)
    : grid_(grid),
      half_(half_of(grid)),
      points_(eye, grid_of_nodes(grid), place_wavelength_nm),
      crossing_(eye, wavelength_nm),
      plane_z_mm_(aim_plane_z_mm(eye, wavelength_nm)),
      limits_(meridians),
      nodes_(std::size_t{meridians} * rings) {
  const std::optional<Values> centre = exact({0, 0});
  if (!centre)
    throw input_error("eye \"" + eye.name + "\": no ray from the field's centre reaches the stop",
                      "use another --fovea, or look with emmetrope ray where rays end");
  centre_ = *centre;
  // As far as the picture reaches where the eye sees all of that, else as far as it sees anything: an edge that is
  // partly the picture's and partly the eye's would be hard to interpolate.
  const double corner = place_of_node(grid, half_).norm();
  std::atomic<bool> sees_all{corner <= (grid.is_angular() ? most_deg : most_mm)};
  on_threads(threads, meridians, [&](std::size_t meridian) {
    if (sees_all && !exact(corner * towards(static_cast<double>(meridian)))) sees_all = false;
  });
  on_threads(threads, meridians, [&](std::size_t meridian) {
    const Eigen::Vector2d along = towards(static_cast<double>(meridian));
    double& limit = limits_[meridian];
    limit = sees_all ? corner : seen_until(along);
    for (int ring = 1; ring <= rings; ++ring) {
      const std::optional<Values> values = exact(limit * share_of(ring) * along);
      if (values) {
        nodes_[meridian * rings + ring - 1] = *values;
        continue;
      }
      // Grazing rays are hard to find: the field ends before them.
      limit *= share_of(ring) - 0.5 * (share_of(ring) - share_of(ring - 1));
      ring = 0;
    }
  });
}

std::optional<WideField::Values> WideField::exact(const Eigen::Vector2d& place) const {
  const std::optional<RetinaPoint> point = points_.at(place);
  const auto ellipse = point ? aim_ellipse(crossing_, point->position_mm, plane_z_mm_) : std::nullopt;
  if (!ellipse) return std::nullopt;
  Values values;
  values << point->position_mm, ellipse->centre_mm, ellipse->from_disc(0, 0), ellipse->from_disc(0, 1),
      ellipse->from_disc(1, 0), ellipse->from_disc(1, 1), point->normal;
  return values;
}

double WideField::seen_until(const Eigen::Vector2d& along) const {
  constexpr int steps = 24, halvings = 10;
  const double most = grid_.is_angular() ? most_deg : most_mm;
  double seen = 0, unseen = most;
  for (int k = 1; k <= steps; ++k) {
    const double next = most * k / steps;
    if (!exact(next * along)) {
      unseen = next;
      break;
    }
    seen = next;
  }
  for (int k = 0; k < halvings; ++k) {
    const double middle = 0.5 * (seen + unseen);
    (exact(middle * along) ? seen : unseen) = middle;
  }
  return seen;
}

const WideField::Values& WideField::node(int meridian, int ring) const {
  if (ring == 0) return centre_;
  return nodes_[static_cast<std::size_t>(wrapped(meridian)) * rings + ring - 1];
}

std::optional<WideField::Values> WideField::between_nodes(const Eigen::Vector2d& place) const {
  const double meridian = std::atan2(place.y(), place.x()) / (2 * pi) * meridians;
  const int first_meridian = first_node(meridian);
  const auto across = six_meridians().weights(meridian - first_meridian);
  double limit = 0, least = INFINITY, most = 0;
  for (int i = 0; i < stencil; ++i) {
    const double there = limits_[wrapped(first_meridian + i)];
    limit += across[i] * there;
    least = std::min(least, there);
    most = std::max(most, there);
  }
  // Six points may swing beyond what they go through.
  limit = std::clamp(limit, least, most);
  const double share = place.norm() / limit;
  if (!(share <= 1)) return std::nullopt;
  const int first_ring = std::clamp(first_node(std::asin(share) * 2 * rings / pi), 0, rings - stencil + 1);
  const auto along = six_rings(first_ring).weights(share);
  Values values = Values::Zero();
  for (int j = 0; j < stencil; ++j)
    for (int i = 0; i < stencil; ++i)
      values += across[i] * along[j] * node(first_meridian + i, first_ring + j);
  return values;
}

RetinaPixels WideField::pixels(int threads) const {
  const std::size_t width = grid_.width, count = width * grid_.height;
  RetinaPixels pixels{std::vector<float>(count * RetinaPixels::floats_a_pixel), std::vector<float>(count),
                      std::vector<char>(count)};
  on_threads(threads, grid_.height, [&](std::size_t row) {
    for (std::size_t column = 0; column < width; ++column) {
      const Eigen::Vector2d share((static_cast<double>(column) + 0.5) / grid_.width,
                                  (static_cast<double>(row) + 0.5) / grid_.height);
      const Eigen::Vector2d place = half_.cwiseProduct(2 * share - Eigen::Vector2d::Ones());
      const auto seen = between_nodes(place_of_node(grid_, place));
      const std::size_t index = row * width + column;
      const Values& values = seen ? *seen : centre_;
      pixels.unseen[index] = !seen;
      std::copy_n(values.data(), RetinaPixels::floats_a_pixel,
                  &pixels.values[index * RetinaPixels::floats_a_pixel]);
      Eigen::Matrix2d from_disc;
      from_disc << values[5], values[6], values[7], values[8];
      pixels.area_mm2[index] = static_cast<float>(pi * std::abs(from_disc.determinant()));
    }
  });
  return pixels;
}

}  // namespace emmetrope::raytrace
