#include "raytrace/retina/pupil_polynomial.hpp"

#include <algorithm>
#include <cmath>

#include "pipeline/base/frames.hpp"

namespace emmetrope::raytrace {

std::vector<Eigen::Vector2d> disc_points(int rings, int spokes) {
  std::vector<Eigen::Vector2d> points;
  for (int i = 0; i < rings; ++i)
    for (int j = 0; j < spokes; ++j) {
      const double radius = std::sin(pi / 2 * (i + 0.5) / rings), angle = 2 * pi * (j + 0.3 * i) / spokes;
      points.emplace_back(radius * std::cos(angle), radius * std::sin(angle));
    }
  return points;
}

Eigen::VectorXd powers(const Eigen::Vector2d& p, int degree) {
  Eigen::VectorXd row((degree + 1) * (degree + 2) / 2);
  int k = 0;
  double y = 1;
  for (int j = 0; j <= degree; ++j, y *= p.y()) {
    double xy = y;
    for (int i = 0; i <= degree - j; ++i, xy *= p.x()) row[k++] = xy;
  }
  return row;
}

std::vector<double> chebyshev_nodes(int count) {
  std::vector<double> nodes(count);
  for (int i = 0; i < count; ++i) nodes[i] = std::cos(pi * (i + 0.5) / count);
  return nodes;
}

Place place_of(double share, int nodes, int tiles) {
  Place place;
  place.tile = std::clamp(static_cast<int>(share * tiles), 0, tiles - 1);
  const double x = 2 * (share * tiles - place.tile) - 1;
  const auto at = chebyshev_nodes(nodes);
  place.weights.setOnes(nodes);
  for (int i = 0; i < nodes; ++i)
    for (int j = 0; j < nodes; ++j)
      if (j != i) place.weights[i] *= (x - at[j]) / (at[i] - at[j]);
  return place;
}

Eigen::Vector2d field_point(const RetinalGrid& grid, double share_x, double share_y) {
  return grid.centre_mm +
         Eigen::Vector2d(grid.field_x_mm * (share_x - 0.5), grid.field_y_mm * (share_y - 0.5));
}

Ray aimed_ray(const Eigen::Vector3d& retina, double plane_z_mm, const AimEllipse& ellipse,
              const Eigen::Vector2d& disc) {
  const Eigen::Vector2d p = ellipse.centre_mm + ellipse.from_disc * disc;
  return {retina, (Eigen::Vector3d(p.x(), p.y(), plane_z_mm) - retina).normalized()};
}

}  // namespace emmetrope::raytrace
