#include "pipeline/eye/instruments/topography.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <optional>
#include <sstream>

#include "pipeline/base/csv_cells.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/even_points.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/base/typed_number.hpp"
#include "pipeline/eye/surfaces/zernike.hpp"

namespace emmetrope {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;

constexpr double fit_radius_mm = 4, irregularity_radius_mm = 3;
constexpr int departure_order = 6;
constexpr double asphericity_sigma = 0.05;
/// Coma that a conicoid (7.8 mm, Q -0.2) seems to have over 6 mm where the map's centre is 0.1 mm off the
/// apex, which instruments do not do better than, as a height.
constexpr double alignment_sigma_um = 0.3;
/// Beside toric conicoid and Zernike terms: no cornea has such a step
constexpr double largest_residual_um = 50;
const char* const map_remedy =
    "give heights above a plane, not above a best-fit sphere, in the unit that the header names; leave gaps "
    "empty";

bool is_gap(const std::string& cell) {
  std::string lower = cell;
  std::transform(lower.begin(), lower.end(), lower.begin(), [](unsigned char c) { return std::tolower(c); });
  return lower.empty() || lower == "nan";
}

double unit_mm(const std::string& name) { return name == "elevation_um" ? 1e-3 : 1; }
bool is_elevation(const std::string& name) { return name == "elevation_um" || name == "elevation_mm"; }

struct Point {
  double x, y, depth;
};

/// A cornea ends 6 mm from its apex, 3 mm deeper.
constexpr double farthest_mm = 10;
std::string why_no_cornea(const Point& point) {
  const double off_mm = std::hypot(point.x, point.y);
  if (!(off_mm <= farthest_mm)) return fmt::format("a point lies {:.3g} mm from the apex", off_mm);
  if (!(std::abs(point.depth) <= farthest_mm))
    return fmt::format("a point lies {:.3g} mm below the apex", std::abs(point.depth));
  return {};
}

ElevationMap map_of(const std::vector<Point>& points) {
  ElevationMap map;
  map.position_mm.resize(static_cast<Index>(points.size()), 2);
  map.depth_mm.resize(static_cast<Index>(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i) {
    map.position_mm.row(static_cast<Index>(i)) << points[i].x, points[i].y;
    map.depth_mm[static_cast<Index>(i)] = points[i].depth;
  }
  return map;
}

ElevationMap read_csv(const std::filesystem::path& file) {
  std::istringstream text(read_file(file));
  std::string line;
  std::getline(text, line);
  const std::vector<std::string> head = csv_cells(without_byte_order_mark(line));
  const auto fault = [&](int at, const std::string& what) {
    return input_error(fmt::format("{}, line {}: {}", file.string(), at, what),
                       "columns x_mm,y_mm,elevation_um, or a matrix with elevation_um in its first cell");
  };
  const bool columns = head.size() == 3 && head[0] == "x_mm" && head[1] == "y_mm" && is_elevation(head[2]);
  if (!columns && !is_elevation(head[0])) throw fault(1, "no header of an elevation map");
  const double unit = unit_mm(columns ? head[2] : head[0]);
  std::vector<Point> points;
  const auto add = [&](int at, double x, double y, const std::string& elevation) {
    if (is_gap(elevation)) return;
    const auto z = typed_number(elevation);
    if (!z) throw fault(at, "'" + elevation + "' is no elevation; a gap is an empty cell or nan");
    points.push_back({x, y, -unit * *z});
    if (const std::string why = why_no_cornea(points.back()); !why.empty())
      throw fault(at, fmt::format("{}; a cornea ends 6 mm from it, and {:g} mm are read", why, farthest_mm));
  };
  for (int at = 2; std::getline(text, line); ++at) {
    const std::vector<std::string> cells = csv_cells(line);
    if (cells.size() == 1 && cells[0].empty()) continue;
    if (cells.size() != head.size())
      throw fault(at, fmt::format("{} cells, the header has {}", cells.size(), head.size()));
    const auto first = typed_number(cells[0]);
    if (!first) throw fault(at, "'" + cells[0] + "' is no position in mm");
    if (columns) {
      const auto y = typed_number(cells[1]);
      if (!y) throw fault(at, "'" + cells[1] + "' is no position in mm");
      add(at, *first, *y, cells[2]);
      continue;
    }
    for (std::size_t i = 1; i < cells.size(); ++i) {
      const auto x = typed_number(head[i]);
      if (!x) throw fault(1, "'" + head[i] + "' is no position in mm");
      add(at, *x, *first, cells[i]);
    }
  }
  return map_of(points);
}

ElevationMap read_zernike(const std::filesystem::path& file) {
  const Json json = read_json(file);
  try {
    const double zone_mm = json.at("zone_mm").get<double>();
    const auto coefficients = json.at("zernike_um").get<std::vector<double>>();
    if (!(zone_mm > 0))
      throw input_error(
          fmt::format("{}: zone_mm is {:g}; it is a diameter, above 0", file.string(), zone_mm));
    if (coefficients.empty()) throw input_error(file.string() + ": zernike_um is empty");
    int order = 0;
    while (zernike_count(order) < static_cast<int>(coefficients.size())) ++order;
    VectorXd padded = VectorXd::Zero(zernike_count(order));
    for (std::size_t i = 0; i < coefficients.size(); ++i) padded[static_cast<Index>(i)] = coefficients[i];
    std::vector<Point> points;
    constexpr int steps = 24;
    for (int i = -steps; i <= steps; ++i) {
      for (int k = -steps; k <= steps; ++k) {
        const double x = static_cast<double>(i) / steps, y = static_cast<double>(k) / steps;
        if (x * x + y * y > 1) continue;
        points.push_back({x * zone_mm / 2, y * zone_mm / 2, -1e-3 * padded.dot(zernike_values(order, x, y))});
        if (const std::string why = why_no_cornea(points.back()); !why.empty())
          throw input_error(fmt::format("{}: {}; a cornea ends 6 mm from it, and {:g} mm are read",
                                        file.string(), why, farthest_mm),
                            "zone_mm is a diameter, zernike_um a height in um (OSA order, normalised)");
      }
    }
    return map_of(points);
  } catch (const nlohmann::json::exception& fault) {
    throw input_error(file.string() + ": " + fault.what(), R"(expected {"zone_mm": 8, "zernike_um": [...]})");
  }
}

/// The apex, of which all is told, is not extrapolated to: points on all sides of it, and near it.
void check_that_the_apex_is_seen(const ElevationMap& centre) {
  constexpr double farthest_mm = 1;  // a ring instrument sees nothing within the first ring
  std::array<int, 4> in_quadrant{};
  for (const auto& p : centre.position_mm.rowwise())
    in_quadrant[(p.x() < 0 ? 1U : 0U) + (p.y() < 0 ? 2U : 0U)] += 1;
  const int fewest = *std::min_element(in_quadrant.begin(), in_quadrant.end());
  const double nearest_mm = centre.position_mm.rowwise().norm().minCoeff();
  if (fewest < 5 || nearest_mm > farthest_mm)
    throw input_error(
        fmt::format("the elevation map does not surround the apex: its nearest point is {:.1f} mm from "
                    "(0, 0), the emptiest quadrant of the central 6 mm has {} points",
                    nearest_mm, fewest),
        "positions are in mm from the corneal apex; give the map on all sides of it");
}

/// Depths, whichever sign the file used: a cornea falls away from its apex on all sides.
void turn_convex(ElevationMap& map) {
  const VectorXd r2 = map.position_mm.rowwise().squaredNorm();
  const VectorXd centred = r2.array() - r2.mean();
  if (centred.dot(map.depth_mm) < 0) map.depth_mm = -map.depth_mm;
}

/// Curvature c, j0, j45, then Q, piston and two tilts.
using Fit = Eigen::Matrix<double, 7, 1>;

ParametricEye toric_conicoid(const Fit& fit) {
  ParametricEye eye;
  eye.cornea_c_per_mm = fit[0];
  eye.cornea_j0_per_mm = fit[1];
  eye.cornea_j45_per_mm = fit[2];
  eye.cornea_q = fit[3];
  return eye;
}

VectorXd depths(const Fit& fit, const Eigen::MatrixX2d& position_mm) {
  const ParametricEye eye = toric_conicoid(fit);
  VectorXd depth(position_mm.rows());
  for (Index i = 0; i < depth.size(); ++i)
    depth[i] = eye.cornea_anterior_depth_mm(position_mm(i, 0), position_mm(i, 1)) + fit[4] +
               fit.tail<2>().dot(position_mm.row(i).transpose());
  return depth;
}

ElevationMap within(const ElevationMap& map, double radius_mm) {
  std::vector<Point> points;
  for (Index i = 0; i < map.depth_mm.size(); ++i) {
    if (map.position_mm.row(i).norm() <= radius_mm)
      points.push_back({map.position_mm(i, 0), map.position_mm(i, 1), map.depth_mm[i]});
  }
  return map_of(points);
}

Fit fit_toric(const ElevationMap& map) {
  Fit fit;
  fit << 1 / 7.8, 0, 0, -0.2, 0, 0, 0;
  for (int iteration = 0; iteration < 20; ++iteration) {
    Eigen::MatrixXd jacobian(map.depth_mm.size(), 7);
    for (int p = 0; p < 7; ++p) {
      const double step = p == 3 ? 1e-4 : 1e-6;
      Fit above = fit, below = fit;
      above[p] += step;
      below[p] -= step;
      jacobian.col(p) = (depths(above, map.position_mm) - depths(below, map.position_mm)) / (2 * step);
    }
    const Fit change = jacobian.colPivHouseholderQr().solve(map.depth_mm - depths(fit, map.position_mm));
    fit += change;
    if (!fit.allFinite() || fit[0] < 0.05 || fit[0] > 0.3)
      throw input_error(
          fmt::format("the elevation map is no cornea: its mean radius would be {:.2f} mm", 1 / fit[0]),
          map_remedy);
    if (change.cwiseAbs().maxCoeff() < 1e-10) break;
  }
  return fit;
}

/// What a toric conicoid leaves of a map, as Zernike terms.
struct Departure {
  VectorXd coefficients_um;
  double rms_um = 0, rms_sigma_um = 0;
  double largest_left_um = 0;  ///< of a point, beside the terms
};

Departure depart(const ElevationMap& map, const Fit& fit, double radius_mm) {
  const VectorXd left_um = 1e3 * (map.depth_mm - depths(fit, map.position_mm));
  if (!left_um.allFinite())
    throw input_error(
        "the elevation map is no cornea: a point lies outside the conicoid that fits its centre", map_remedy);
  const auto points = static_cast<double>(left_um.size());
  MatrixXd terms(left_um.size(), zernike_count(departure_order));
  for (Index i = 0; i < left_um.size(); ++i)
    terms.row(i) =
        zernike_values(departure_order, map.position_mm(i, 0) / radius_mm, map.position_mm(i, 1) / radius_mm);
  Departure departure;
  departure.coefficients_um = terms.completeOrthogonalDecomposition().solve(left_um);
  const VectorXd smooth_um = terms * departure.coefficients_um;
  departure.rms_um = smooth_um.norm() / std::sqrt(points);
  // The noise of the points, shared by the terms.
  departure.rms_sigma_um =
      (left_um - smooth_um).norm() / std::sqrt(points) * std::sqrt(terms.cols() / points);
  departure.largest_left_um = (left_um - smooth_um).cwiseAbs().maxCoeff();
  return departure;
}

/// A cornea as a map of points spread evenly over a disc.
ElevationMap sampled(const CornealDepth& cornea, double radius_mm) {
  constexpr int count = 600;
  std::vector<Point> points;
  for (int i = 0; i < count; ++i) {
    const Vector2d at = radius_mm * sunflower_point(i, count);
    points.push_back({at.x(), at.y(), cornea(at.x(), at.y())});
  }
  return map_of(points);
}

/// The eye with what a topographer's toric part describes: an irregular cornea gives way to its best toric
/// conicoid.
ParametricEye with_toric_cornea(const ParametricEye& eye) {
  if (!eye.has_irregular_cornea()) return eye;
  const ParametricEye toric = toric_conicoid(fit_toric(sampled(anterior_cornea(eye), fit_radius_mm)));
  ParametricEye result = eye;
  for (const char* name : {"cornea_c_per_mm", "cornea_j0_per_mm", "cornea_j45_per_mm", "cornea_q"})
    result.set(name, toric.get(name));
  result.cornea_q_split = 0;
  result.cornea_zernike_um = {};
  return result;
}

VectorXd toric_functional(const ParametricEye& eye) {
  const ParametricEye toric = with_toric_cornea(eye);
  const CornealPower power = corneal_power(anterior_cornea(toric));
  return Eigen::Vector4d(power.M_D, power.J0_D, power.J45_D, toric.cornea_q);
}

double departure_mm(const Topography& topography, double x_mm, double y_mm) {
  const double radius = topography.zone_mm / 2;
  return 1e-3 * topography.departure_um.dot(zernike_values(departure_order, x_mm / radius, y_mm / radius));
}

}  // namespace

ElevationMap read_elevation_map(const std::filesystem::path& file) {
  ElevationMap map = file.extension() == ".json" ? read_zernike(file) : read_csv(file);
  if (map.depth_mm.size() < 50)
    throw input_error(fmt::format("{}: {} elevations are too few", file.string(), map.depth_mm.size()));
  turn_convex(map);
  return map;
}

Topography analyse_topography(const ElevationMap& map, double sigma_D) {
  Topography result;
  result.zone_mm = 2 * map.position_mm.rowwise().norm().maxCoeff();
  if (result.zone_mm < 2 * irregularity_radius_mm)
    throw input_error(fmt::format("the elevation map is {:.1f} mm wide, 6 mm are needed", result.zone_mm));
  const ElevationMap centre = within(map, irregularity_radius_mm);
  if (centre.depth_mm.size() < 50)
    throw input_error("the elevation map has fewer than 50 points in its central 6 mm");
  check_that_the_apex_is_seen(centre);
  const Fit fit = fit_toric(within(map, fit_radius_mm));

  result.toric.source = "topography";
  result.toric.of_eye = toric_functional;
  result.toric.value = toric_functional(toric_conicoid(fit));
  result.toric.covariance = MatrixXd::Identity(4, 4) * sigma_D * sigma_D / 2;
  result.toric.covariance(3, 3) = asphericity_sigma * asphericity_sigma;
  const Departure whole = depart(map, fit, result.zone_mm / 2);
  if (whole.largest_left_um > largest_residual_um)
    throw input_error(
        fmt::format("the elevation map is no smooth cornea: a point lies {:.0f} um off it (a gap "
                    "written as 0?)",
                    whole.largest_left_um),
        map_remedy);
  result.departure_um = whole.coefficients_um;

  const Departure irregular = depart(centre, fit_toric(centre), irregularity_radius_mm);
  result.irregularity_um = Measured::from_sigma(
      irregular.rms_um, std::hypot(irregular.rms_sigma_um, alignment_sigma_um), "topography");
  result.irregularity_um.ci95[0] = std::max(0.0, result.irregularity_um.ci95[0]);
  return result;
}

VectorXd corneal_departure_um(const CornealDepth& cornea) {
  const ElevationMap map = sampled(cornea, irregularity_radius_mm);
  return depart(map, fit_toric(map), irregularity_radius_mm).coefficients_um;
}

double irregularity_um(const CornealDepth& cornea) { return corneal_departure_um(cornea).norm(); }

CornealDepth anterior_cornea(const ParametricEye& fitted, const Topography& topography) {
  return [eye = with_toric_cornea(fitted), &topography](double x_mm, double y_mm) {
    return eye.cornea_anterior_depth_mm(x_mm, y_mm) + departure_mm(topography, x_mm, y_mm) -
           departure_mm(topography, 0, 0);
  };
}

ShapePtr anterior_cornea_shape(const ParametricEye& eye, const Topography& topography) {
  const ParametricEye::Biconic b = with_toric_cornea(eye).cornea_biconic();
  VectorXd coefficients = turned_zernike(topography.departure_um, b.steep_axis_deg * degree);
  coefficients[0] -= 1e3 * departure_mm(topography, 0, 0);  // the vertex stays the apex
  return make_zernike(b.steep_radius_mm, b.flat_radius_mm, b.steep_q, b.flat_q, b.steep_axis_deg,
                      topography.zone_mm / 2,
                      {coefficients.data(), coefficients.data() + coefficients.size()});
}

}  // namespace emmetrope
