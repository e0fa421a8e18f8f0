#include "pipeline/report/figures/cornea_map.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>

#include "pipeline/base/frames.hpp"
#include "pipeline/eye/population/population.hpp"
#include "pipeline/report/figures/chart.hpp"

namespace emmetrope::report {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double centre_hole_mm = 0.3;
constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();

/// The sphere through the mesh's vertices within a radius of the axis, by linear least squares of
/// |p|^2 = 2 c . p + (R^2 - |c|^2).
std::pair<Vector3d, double> best_sphere(const TriangleMesh& mesh, double within_mm) {
  std::vector<Vector3d> points;
  for (const auto& p : mesh.vertices)
    if (p.head<2>().norm() <= within_mm) points.push_back(p);
  if (points.size() < 8) return {Vector3d(0, 0, -7.8), 7.8};
  Eigen::MatrixXd a(points.size(), 4);
  Eigen::VectorXd b(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    a.row(static_cast<Eigen::Index>(i)) << 2 * points[i].transpose(), 1;
    b[static_cast<Eigen::Index>(i)] = points[i].squaredNorm();
  }
  const Eigen::Vector4d solution = a.colPivHouseholderQr().solve(b);
  const Vector3d centre = solution.head<3>();
  return {centre, std::sqrt(solution[3] + centre.squaredNorm())};
}

/// Cell of the grid: its centre in mm.
double coordinate(const CorneaGrid& grid, int index) {
  return (2.0 * index / (grid.side - 1) - 1) * grid.half_width_mm;
}

int first_at_or_after(const CorneaGrid& grid, double position_mm) {
  return static_cast<int>(std::ceil((position_mm / grid.half_width_mm + 1) / 2 * (grid.side - 1)));
}

void rasterise(CorneaGrid& grid, const TriangleMesh& mesh, const std::array<int, 3>& triangle,
               const Vector3d& centre, double radius) {
  const Vector3d &a = mesh.vertices[triangle[0]], &b = mesh.vertices[triangle[1]],
                 &c = mesh.vertices[triangle[2]];
  const Vector2d ab = (b - a).head<2>(), ac = (c - a).head<2>();
  const double area = ab.x() * ac.y() - ab.y() * ac.x();
  if (std::abs(area) < 1e-12) return;
  const auto [x_low, x_high] = std::minmax({a.x(), b.x(), c.x()});
  const auto [y_low, y_high] = std::minmax({a.y(), b.y(), c.y()});
  for (int row = std::max(0, first_at_or_after(grid, y_low)); row < grid.side; ++row) {
    const double y = coordinate(grid, row);
    if (y > y_high) break;
    for (int column = std::max(0, first_at_or_after(grid, x_low)); column < grid.side; ++column) {
      const double x = coordinate(grid, column);
      if (x > x_high) break;
      const double r = std::hypot(x, y);
      if (r > grid.half_width_mm) continue;
      const Vector2d ap(x - a.x(), y - a.y());
      const double v = (ap.x() * ac.y() - ap.y() * ac.x()) / area;
      const double w = (ab.x() * ap.y() - ab.y() * ap.x()) / area;
      if (v < -1e-9 || w < -1e-9 || v + w > 1 + 1e-9) continue;
      const std::size_t at = static_cast<std::size_t>(row) * grid.side + column;
      const Vector3d normal = ((1 - v - w) * mesh.normals[triangle[0]] + v * mesh.normals[triangle[1]] +
                               w * mesh.normals[triangle[2]])
                                  .normalized();
      // The facet lies under the curved surface by up to a quarter of a percent of its edge: take out the
      // sphere's part.
      const double z_facet = (1 - v - w) * a.z() + v * b.z() + w * c.z();
      const auto sphere_z = [&](double px, double py) {
        return centre.z() + std::sqrt(std::max(0.0, radius * radius - std::pow(px - centre.x(), 2) -
                                                        std::pow(py - centre.y(), 2)));
      };
      const double sphere_facet =
          (1 - v - w) * sphere_z(a.x(), a.y()) + v * sphere_z(b.x(), b.y()) + w * sphere_z(c.x(), c.y());
      const double above_sphere = z_facet - sphere_facet;
      grid.depth_mm[at] = -(sphere_z(x, y) + above_sphere);
      grid.elevation_um[at] = 1000 * above_sphere;
      // Sine of the normal's angle in the meridional plane.
      const double slope_sine = r > centre_hole_mm ? (normal.x() * x + normal.y() * y) / r : not_a_number;
      grid.axial_power_D[at] = keratometric_D_mm * slope_sine / r;
    }
  }
}

/// At the apex the axial radius is 0 / 0: the cells there take the power just outside in their meridian.
void fill_centre(CorneaGrid& grid) {
  const double just_outside_mm = centre_hole_mm + 2.5 * grid.half_width_mm / grid.side;
  const auto cell = [&](double x, double y) -> double& {
    const auto index = [&](double mm) {
      return std::lround((mm / grid.half_width_mm + 1) / 2 * (grid.side - 1));
    };
    return grid.axial_power_D[static_cast<std::size_t>(index(y) * grid.side + index(x))];
  };
  for (int row = 0; row < grid.side; ++row)
    for (int column = 0; column < grid.side; ++column) {
      const double x = coordinate(grid, column), y = coordinate(grid, row), r = std::hypot(x, y);
      if (r > centre_hole_mm) continue;
      const Vector2d outside =
          r > 0 ? Vector2d(Vector2d(x, y) / r * just_outside_mm) : Vector2d(just_outside_mm, 0);
      cell(x, y) = cell(outside.x(), outside.y());
    }
}

std::string data_block(const std::vector<double>& values, const CorneaGrid& grid) {
  std::string text = "$map << EOD\n";
  for (int row = 0; row < grid.side; ++row) {
    for (int column = 0; column < grid.side; ++column) {
      const double value = values[static_cast<std::size_t>(row) * grid.side + column];
      text += fmt::format("{:.3f} {:.3f} ", coordinate(grid, column), coordinate(grid, row));
      text += std::isfinite(value) ? fmt::format("{:.3f}\n", value) : "NaN\n";
    }
    text += "\n";
  }
  return text + "EOD\n";
}

std::string axes(const CorneaGrid& grid, bool is_right_eye) {
  return examiner_axes(grid.half_width_mm, 2, "x (mm)", "y (mm)", is_right_eye);
}

std::string line_along(double axis_deg, double length_mm, const char* style) {
  const double x = length_mm * std::cos(axis_deg * degree), y = length_mm * std::sin(axis_deg * degree);
  return fmt::format("set arrow from {:.3f},{:.3f} to {:.3f},{:.3f} nohead front {}\n", -x, -y, x, y, style);
}

std::string lines_along(const Meridians& meridians, double length_mm) {
  // gnuplot's SVG changes the dashes only with the colour, and black itself would follow the page's.
  return line_along(meridians.flat_axis_deg, length_mm, "lw 1.2 dt '-' lc rgb '#000001'") +
         line_along(meridians.steep_axis_deg, length_mm, "lw 1.2 dt solid lc rgb '#000002'");
}

}  // namespace

CorneaGrid cornea_grid(const TriangleMesh& mesh_in_eye, double half_width_mm, int side) {
  CorneaGrid grid;
  grid.side = side;
  grid.half_width_mm = half_width_mm;
  const std::size_t count = static_cast<std::size_t>(side) * side;
  grid.depth_mm.assign(count, not_a_number);
  grid.axial_power_D.assign(count, not_a_number);
  grid.elevation_um.assign(count, not_a_number);
  const auto [centre, radius] = best_sphere(mesh_in_eye, half_width_mm);
  grid.best_sphere_radius_mm = radius;
  if (mesh_in_eye.normals.size() == mesh_in_eye.vertices.size())
    for (const auto& triangle : mesh_in_eye.triangles) rasterise(grid, mesh_in_eye, triangle, centre, radius);
  fill_centre(grid);
  return grid;
}

bool draw_axial_power(Figure& figure, const CorneaGrid& grid, const std::optional<Meridians>& meridians,
                      bool is_right_eye) {
  // The absolute 1.5 D scale of the topographers, so that two maps compare by colour.
  return draw_chart(
      figure, data_block(grid.axial_power_D, grid) + axes(grid, is_right_eye) +
                  "set cbrange [36:51]\nset cbtics 3\nset cblabel 'Axial power (D)'\n"
                  "set palette maxcolors 10 defined (0 '#2c2a80', 2 '#2b83c6', 4 '#31b57b', 5 '#a6d96a', 6 "
                  "'#f3e04a', 8 '#ee7f1b', 10 '#a50f15')\n" +
                  (meridians ? lines_along(*meridians, grid.half_width_mm) : std::string()) +
                  "plot $map using 1:2:3 with image\n");
}

bool draw_elevation(Figure& figure, const CorneaGrid& grid, bool is_right_eye) {
  return draw_chart(figure,
                    data_block(grid.elevation_um, grid) + axes(grid, is_right_eye) +
                        "set cbrange [-40:40]\nset cbtics 20\nset cblabel 'Elevation (\u00b5m)'\n"
                        "set palette maxcolors 16 defined (-40 '#2166ac', -10 '#92c5de', 0 '#f7f7f7', 10 "
                        "'#f4a582', 40 '#b2182b')\n"
                        "plot $map using 1:2:3 with image\n");
}

}  // namespace emmetrope::report
