#include "pipeline/eye/instruments/elevation_map.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <sstream>
#include <utility>

#include "pipeline/base/checked_object.hpp"
#include "pipeline/base/csv_cells.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/typed_number.hpp"
#include "pipeline/eye/surfaces/zernike.hpp"

namespace emmetrope {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

bool is_gap(const std::string& cell) {
  std::string lower = cell;
  std::transform(lower.begin(), lower.end(), lower.begin(), [](unsigned char c) { return std::tolower(c); });
  return lower.empty() || lower == "nan";
}

double unit_mm(const std::string& name) { return name == "elevation_um" ? 1e-3 : 1; }
bool is_elevation(const std::string& name) { return name == "elevation_um" || name == "elevation_mm"; }

/// A cornea ends 6 mm from its apex, 3 mm deeper.
constexpr double farthest_mm = 10;
std::string why_no_cornea(const ElevationPoint& point) {
  const double off_mm = std::hypot(point.x_mm, point.y_mm);
  if (!(off_mm <= farthest_mm)) return fmt::format("a point lies {:.3g} mm from the apex", off_mm);
  if (!(std::abs(point.depth_mm) <= farthest_mm))
    return fmt::format("a point lies {:.3g} mm below the apex", std::abs(point.depth_mm));
  return {};
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
  std::vector<ElevationPoint> points;
  std::map<std::pair<double, double>, std::pair<int, double>> told_at;  // line and elevation
  const auto add = [&](int at, double x, double y, const std::string& elevation) {
    if (is_gap(elevation)) return;
    const auto z = typed_number(elevation);
    if (!z) throw fault(at, "'" + elevation + "' is no elevation; a gap is an empty cell or nan");
    // The middle of a polar map is there once a meridian.
    const auto [earlier, is_new] = told_at.try_emplace({x, y}, std::pair(at, *z));
    if (!is_new && earlier->second.second == *z) return;
    if (!is_new)
      throw input_error(fmt::format("{}, line {}: ({:g}, {:g}) has another elevation in line {}",
                                    file.string(), at, x, y, earlier->second.first),
                        "one map a file, one elevation a position");
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
  return elevation_map(points);
}

ElevationMap read_zernike(const std::filesystem::path& file) {
  const Json json = read_json(file);
  CheckedObject list(json, file.string());
  try {
    const double zone_mm = list.positive("zone_mm");
    const std::vector<double> coefficients = list.numbers("zernike_um");
    list.finish();
    int order = 0;
    while (zernike_count(order) < static_cast<int>(coefficients.size())) ++order;
    VectorXd padded = VectorXd::Zero(zernike_count(order));
    for (std::size_t i = 0; i < coefficients.size(); ++i) padded[static_cast<Index>(i)] = coefficients[i];
    std::vector<ElevationPoint> points;
    constexpr int steps = 24;
    for (int i = -steps; i <= steps; ++i) {
      for (int k = -steps; k <= steps; ++k) {
        const double x = static_cast<double>(i) / steps, y = static_cast<double>(k) / steps;
        if (x * x + y * y > 1) continue;
        points.push_back({x * zone_mm / 2, y * zone_mm / 2, -1e-3 * padded.dot(zernike_values(order, x, y))});
        if (const std::string why = why_no_cornea(points.back()); !why.empty())
          throw input_error(fmt::format("{}: {}; a cornea ends 6 mm from it, and {:g} mm are read",
                                        file.string(), why, farthest_mm));
      }
    }
    return elevation_map(points);
  } catch (const Error& error) {
    throw input_error(
        error.what(),
        R"(expected {"zone_mm": 8, "zernike_um": [...]}: a diameter, and heights in OSA order, )"
        "normalised; nothing else");
  }
}

/// Depths, whichever sign the file used: a cornea falls away from its apex on all sides.
void turn_convex(ElevationMap& map) {
  const VectorXd r2 = map.position_mm.rowwise().squaredNorm();
  const VectorXd centred = r2.array() - r2.mean();
  if (centred.dot(map.depth_mm) < 0) map.depth_mm = -map.depth_mm;
}

}  // namespace

ElevationMap elevation_map(const std::vector<ElevationPoint>& points) {
  ElevationMap map;
  map.position_mm.resize(static_cast<Index>(points.size()), 2);
  map.depth_mm.resize(static_cast<Index>(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i) {
    map.position_mm.row(static_cast<Index>(i)) << points[i].x_mm, points[i].y_mm;
    map.depth_mm[static_cast<Index>(i)] = points[i].depth_mm;
  }
  return map;
}

ElevationMap read_elevation_map(const std::filesystem::path& file) {
  ElevationMap map = file.extension() == ".json" ? read_zernike(file) : read_csv(file);
  if (map.depth_mm.size() < fewest_elevations)
    throw input_error(fmt::format("{}: {} elevations are too few", file.string(), map.depth_mm.size()));
  turn_convex(map);
  return map;
}

}  // namespace emmetrope
