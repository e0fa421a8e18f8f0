#include "pipeline/eye/surfaces/height_field.hpp"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "pipeline/eye/surfaces/band_matrix.hpp"
#include "pipeline/eye/surfaces/newton_hit.hpp"

namespace emmetrope {
namespace {

using Points = std::vector<Eigen::Vector3d>;  // x, y, depth

/// Vertices steeper than this are left out: cos 65 degrees.
constexpr double least_normal_z = 0.42;
constexpr int fewest_vertices = 12;
/// A mesh that the spline misses by more is no smooth height field.
constexpr double largest_rms_mm = 0.05;

// --- the conic

/// d = offset + g.x + S / (1 + sqrt(1 - (1 + q) T)), S = x'Cx, T = x'C^2 x.
struct Base {
  double offset = 0;
  Eigen::Vector2d tilt{0, 0};
  Eigen::Matrix2d curvature = Eigen::Matrix2d::Zero();
  double q = 0;

  using Parameters = Eigen::Matrix<double, 7, 1>;
  Parameters parameters() const {
    Parameters p;
    p << offset, tilt, curvature(0, 0), curvature(0, 1), curvature(1, 1), q;
    return p;
  }
  static Base from(const Parameters& p) {
    Base base;
    base.offset = p[0];
    base.tilt = p.segment<2>(1);
    base.curvature << p[3], p[4], p[4], p[5];
    base.q = p[6];
    return base;
  }
  /// Where the conic gets as steep as 72 degrees (a sphere) it goes on outwards by its Taylor series of
  /// second order, without a kink that a spline would ring with.
  double depth(const Eigen::Vector2d& x) const {
    constexpr double least_square = 0.1, least = 0.316227766;
    const double plane = offset + tilt.dot(x), s = x.dot(curvature * x),
                 t = (1 + q) * (curvature * x).squaredNorm();
    if (1 - t >= least_square) return plane + s / (1 + std::sqrt(1 - t));
    const double k = std::sqrt((1 - least_square) / t), on = 1 - k;  // the series' place, and from it to x
    return plane + s * (k * k / (1 + least) + k * on / least + on * on / (2 * least * least_square));
  }
};

double sum_of_squares(const Base& base, const Points& points) {
  double sum = 0;
  for (const Eigen::Vector3d& p : points) sum += std::pow(base.depth(p.head<2>()) - p.z(), 2);
  return sum;
}

/// Levenberg's method over at most 2000 of the points, from a paraboloid.
Base fit_base(const Points& all) {
  Points points;
  const std::size_t stride = 1 + all.size() / 2000;
  for (std::size_t k = 0; k < all.size(); k += stride) points.push_back(all[k]);

  Eigen::MatrixXd a(points.size(), 6);
  Eigen::VectorXd d(points.size());
  for (std::size_t k = 0; k < points.size(); ++k) {
    const double x = points[k].x(), y = points[k].y();
    a.row(k) << 1, x, y, x * x / 2, x * y, y * y / 2;
    d[k] = points[k].z();
  }
  const Eigen::VectorXd start = a.colPivHouseholderQr().solve(d);
  Base base;
  base.offset = start[0];
  base.tilt = start.segment<2>(1);
  base.curvature << start[3], start[4], start[4], start[5];
  base.q = -1;

  double value = sum_of_squares(base, points), damping = 1e-3;
  for (int iteration = 0; iteration < 40; ++iteration) {
    const Base::Parameters p = base.parameters();
    Eigen::Matrix<double, 7, 7> normal = Eigen::Matrix<double, 7, 7>::Zero();
    Base::Parameters gradient = Base::Parameters::Zero();
    std::array<Base, 7> ahead, behind;
    const Base::Parameters steps =
        (Base::Parameters() << 1e-5, 1e-5, 1e-5, 1e-6, 1e-6, 1e-6, 1e-4).finished();
    for (int k = 0; k < 7; ++k) {
      ahead[k] = Base::from(p + steps[k] * Base::Parameters::Unit(k));
      behind[k] = Base::from(p - steps[k] * Base::Parameters::Unit(k));
    }
    for (const Eigen::Vector3d& point : points) {
      const Eigen::Vector2d x = point.head<2>();
      Base::Parameters row;
      for (int k = 0; k < 7; ++k) row[k] = (ahead[k].depth(x) - behind[k].depth(x)) / (2 * steps[k]);
      normal += row * row.transpose();
      gradient += row * (base.depth(x) - point.z());
    }
    bool improved = false;
    for (int attempt = 0; attempt < 12 && !improved; ++attempt) {
      Eigen::Matrix<double, 7, 7> damped = normal;
      damped.diagonal() *= 1 + damping;
      damped.diagonal().array() += 1e-12;
      const Base candidate = Base::from(p - damped.ldlt().solve(gradient));
      const double candidate_value = sum_of_squares(candidate, points);
      if (candidate_value < value) {
        improved = value - candidate_value > 1e-9 * value;
        base = candidate;
        value = candidate_value;
        damping = std::max(damping / 10, 1e-9);
        break;
      }
      damping *= 10;
    }
    if (!improved) break;
  }
  return base;
}

// --- uniform cubic B-splines

/// Weights of the four control values of a cell at t in [0, 1], with derivatives with respect to t.
struct Weights {
  Eigen::Vector4d value, first, second;
};

Weights weights(double t) {
  const double u = 1 - t;
  Weights w;
  w.value << u * u * u / 6, (3 * t * t * t - 6 * t * t + 4) / 6, (3 * u * u * u - 6 * u * u + 4) / 6,
      t * t * t / 6;
  w.first << -u * u / 2, (3 * t * t - 4 * t) / 2, (4 * u - 3 * u * u) / 2, t * t / 2;
  w.second << u, 3 * t - 2, 3 * u - 2, t;
  return w;
}

/// First control of the cell that holds the coordinate, clamped to the grid, and the place t in it.
int cell(double coordinate, double origin, double spacing, int count, double& t) {
  const double s = (coordinate - origin) / spacing - 1;
  const int i = std::clamp(static_cast<int>(std::floor(s)), 0, count - 4);
  t = s - i;
  return i;
}

HeightField::Jet evaluate(const Eigen::Vector2d& p, const Eigen::Vector2d& origin, double spacing,
                          int columns, int rows, const std::vector<double>& controls) {
  double tx = 0, ty = 0;
  const int i = cell(p.x(), origin.x(), spacing, columns, tx), j = cell(p.y(), origin.y(), spacing, rows, ty);
  const Weights wx = weights(tx), wy = weights(ty);
  Eigen::Matrix4d c;  // row: y, column: x
  for (int row = 0; row < 4; ++row)
    for (int column = 0; column < 4; ++column)
      c(row, column) = controls[static_cast<std::size_t>(j + row) * columns + i + column];
  const Eigen::Vector4d in_x = c * wx.value, in_x1 = c * wx.first;
  HeightField::Jet jet;
  jet.depth_mm = wy.value.dot(in_x);
  jet.gradient = Eigen::Vector2d(wy.value.dot(in_x1), wy.first.dot(in_x)) / spacing;
  const double cross = wy.first.dot(in_x1);
  jet.hessian_per_mm << wy.value.dot(c * wx.second), cross, cross, wy.second.dot(in_x);
  jet.hessian_per_mm /= spacing * spacing;
  return jet;
}

struct Grid {
  Eigen::Vector2d origin;
  double spacing = 1;
  int columns = 0, rows = 0;
  std::vector<double> controls;

  HeightField::Jet at(const Eigen::Vector2d& p) const {
    return evaluate(p, origin, spacing, columns, rows, controls);
  }
};

Grid grid_over(const Points& points, double spacing, int margin) {
  Eigen::Vector2d low = points.front().head<2>(), high = low;
  for (const Eigen::Vector3d& p : points) {
    low = low.cwiseMin(p.head<2>());
    high = high.cwiseMax(p.head<2>());
  }
  Grid grid;
  grid.spacing = spacing;
  grid.origin = low - Eigen::Vector2d::Constant((1 + margin) * spacing);
  grid.columns = static_cast<int>(std::ceil((high.x() - low.x()) / spacing)) + 3 + 2 * margin;
  grid.rows = static_cast<int>(std::ceil((high.y() - low.y()) / spacing)) + 3 + 2 * margin;
  grid.controls.assign(static_cast<std::size_t>(grid.columns) * grid.rows, 0);
  return grid;
}

/// Least squares of the residuals with a weak penalty on second differences of the control values, which
/// decides where vertices do not.
void fit_residual(Grid& grid, const Points& points, const Base& base) {
  const int unknowns = grid.columns * grid.rows;
  BandMatrix normal(unknowns, 3 * grid.columns + 3);  // those at most three columns and rows away meet
  Eigen::VectorXd right = Eigen::VectorXd::Zero(unknowns);
  for (const Eigen::Vector3d& p : points) {
    double tx = 0, ty = 0;
    const int i = cell(p.x(), grid.origin.x(), grid.spacing, grid.columns, tx);
    const int j = cell(p.y(), grid.origin.y(), grid.spacing, grid.rows, ty);
    const Weights wx = weights(tx), wy = weights(ty);
    const double residual = p.z() - base.depth(p.head<2>());
    const auto index = [&](int a) { return (j + a / 4) * grid.columns + i + a % 4; };
    const auto weight = [&](int a) { return wy.value[a / 4] * wx.value[a % 4]; };
    for (int a = 0; a < 16; ++a) {
      right[index(a)] += weight(a) * residual;
      for (int b = a; b < 16; ++b) normal(index(b), index(a)) += weight(a) * weight(b);
    }
  }
  constexpr double penalty = 1e-8;  // against a vertex's weight of 1
  const auto penalise = [&](int first, int step) {
    const std::array<double, 3> w{1, -2, 1};
    for (int a = 0; a < 3; ++a)
      for (int b = a; b < 3; ++b) normal(first + b * step, first + a * step) += penalty * w[a] * w[b];
  };
  for (int j = 0; j < grid.rows; ++j)
    for (int i = 0; i < grid.columns; ++i) {
      const int index = j * grid.columns + i;
      if (i + 2 < grid.columns) penalise(index, 1);
      if (j + 2 < grid.rows) penalise(index, grid.columns);
      normal(index, index) += 1e-13;
    }
  const Eigen::VectorXd solution = std::move(normal).solve(std::move(right));
  std::copy(solution.data(), solution.data() + unknowns, grid.controls.begin());
}

/// Control values of the spline that takes the given values at its nodes, along one line; ends without
/// curvature.
void interpolate_line(double* values, int count, std::ptrdiff_t stride) {
  if (count < 3) return;
  // c_0 = f_0, c_n = f_n; (c_{k-1} + 4 c_k + c_{k+1}) / 6 = f_k
  std::vector<double> upper(count, 0), line(count);
  for (int k = 0; k < count; ++k) line[k] = values[k * stride];
  for (int k = 1; k + 1 < count; ++k) {
    const double pivot = 4 - upper[k - 1];
    upper[k] = 1 / pivot;
    line[k] = (6 * line[k] - line[k - 1]) / pivot;
  }
  for (int k = count - 2; k >= 1; --k) line[k] -= upper[k] * line[k + 1];
  for (int k = 0; k < count; ++k) values[k * stride] = line[k];
}

/// Counter-clockwise convex hull (Andrew's monotone chain).
std::vector<Eigen::Vector2d> convex_hull(const Points& points) {
  std::vector<Eigen::Vector2d> sorted;
  for (const Eigen::Vector3d& p : points) sorted.emplace_back(p.head<2>());
  std::sort(sorted.begin(), sorted.end(), [](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y();
  });
  std::vector<Eigen::Vector2d> hull;
  for (int pass = 0; pass < 2; ++pass) {
    const std::size_t start = hull.size();
    for (const Eigen::Vector2d& p : sorted) {
      while (hull.size() >= start + 2) {
        const Eigen::Vector2d a = hull.back() - hull[hull.size() - 2], b = p - hull.back();
        if (a.x() * b.y() - a.y() * b.x() > 0) break;
        hull.pop_back();
      }
      hull.push_back(p);
    }
    hull.pop_back();
    std::reverse(sorted.begin(), sorted.end());
  }
  return hull;
}

double polygon_area(const std::vector<Eigen::Vector2d>& polygon) {
  double twice = 0;
  for (std::size_t k = 0; k < polygon.size(); ++k) {
    const Eigen::Vector2d &a = polygon[k], &b = polygon[(k + 1) % polygon.size()];
    twice += a.x() * b.y() - a.y() * b.x();
  }
  return twice / 2;
}

/// Positive inside, on which side of the edge a -> b.
double inside_distance(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& p) {
  const Eigen::Vector2d edge = (b - a).normalized();
  return edge.x() * (p.y() - a.y()) - edge.y() * (p.x() - a.x());
}

/// The vertices, without those on slopes too steep for a height field.
Points gently_sloped(const TriangleMesh& mesh) {
  Points points;
  for (std::size_t k = 0; k < mesh.vertices.size(); ++k)
    if (mesh.normals.empty() || mesh.normals[k].z() >= least_normal_z)
      points.emplace_back(mesh.vertices[k].x(), mesh.vertices[k].y(), -mesh.vertices[k].z());
  return points;
}

/// Conic and residual as one spline: with the residual's knots and more between them, so that its spline is
/// reproduced exactly; a margin lets the ends' condition die away.
Grid resampled(const Base& base, const Grid& residual, double reach_mm) {
  const double knots_mm = residual.spacing;
  const double strongest_per_mm = base.curvature.cwiseAbs().maxCoeff();
  const double wanted_mm =
      std::max(reach_mm / 150, std::min({knots_mm / 2, 0.2, 1 / (30 * strongest_per_mm + 1e-9)}));
  const int split = std::max(1, static_cast<int>(std::ceil(knots_mm / wanted_mm)));
  Grid fine;
  fine.spacing = knots_mm / split;
  constexpr int margin = 8;
  fine.origin = residual.origin + Eigen::Vector2d::Constant(residual.spacing - (margin + 1) * fine.spacing);
  fine.columns = (residual.columns - 3) * split + 3 + 2 * margin;
  fine.rows = (residual.rows - 3) * split + 3 + 2 * margin;
  fine.controls.resize(static_cast<std::size_t>(fine.columns) * fine.rows);
  for (int j = 0; j < fine.rows; ++j)
    for (int i = 0; i < fine.columns; ++i) {
      const Eigen::Vector2d node = fine.origin + fine.spacing * Eigen::Vector2d(i, j);
      fine.controls[static_cast<std::size_t>(j) * fine.columns + i] =
          base.depth(node) + residual.at(node).depth_mm;
    }
  for (int j = 0; j < fine.rows; ++j)
    interpolate_line(&fine.controls[static_cast<std::size_t>(j) * fine.columns], fine.columns, 1);
  for (int i = 0; i < fine.columns; ++i) interpolate_line(&fine.controls[i], fine.rows, fine.columns);
  return fine;
}

}  // namespace

std::optional<HeightField> HeightField::fit(const TriangleMesh& mesh) {
  const Points points = gently_sloped(mesh);
  if (points.size() < fewest_vertices) return std::nullopt;
  HeightField field;
  if (!field.outline(points)) return std::nullopt;

  const Base base = fit_base(points);
  // Half as many knots as vertices, and no finer than an optical surface can want.
  const double area = polygon_area(field.outline_);
  const double knots_mm =
      std::max(1.4 * std::sqrt(area / static_cast<double>(points.size())), field.reach_ / 24);
  Grid residual = grid_over(points, knots_mm, 1);
  fit_residual(residual, points, base);
  Grid fine = resampled(base, residual, field.reach_);

  field.origin_ = fine.origin;
  field.spacing_ = fine.spacing;
  field.columns_ = fine.columns;
  field.rows_ = fine.rows;
  field.controls_ = std::move(fine.controls);
  field.base_offset_ = base.offset;
  field.base_curvature_ = base.curvature;
  field.base_q_ = base.q;
  field.measure_deviation(points);
  if (!(field.rms_deviation_um_ <= 1000 * largest_rms_mm)) return std::nullopt;
  return field;
}

bool HeightField::outline(const Points& points) {
  outline_ = convex_hull(points);
  if (outline_.size() < 3 || !(polygon_area(outline_) > 0)) return false;
  inner_reach_ = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < outline_.size(); ++k) {
    const Eigen::Vector2d &a = outline_[k], &b = outline_[(k + 1) % outline_.size()];
    reach_ = std::max(reach_, a.norm());
    inner_reach_ = std::min(inner_reach_, inside_distance(a, b, {0, 0}));
  }
  if (!(inner_reach_ > 0)) return false;
  const auto angle_rad = [](const Eigen::Vector2d& corner) { return std::atan2(corner.y(), corner.x()); };
  std::rotate(outline_.begin(),
              std::min_element(outline_.begin(), outline_.end(),
                               [&](const auto& a, const auto& b) { return angle_rad(a) < angle_rad(b); }),
              outline_.end());
  for (const Eigen::Vector2d& corner : outline_) outline_angles_rad_.push_back(angle_rad(corner));
  return true;
}

void HeightField::measure_deviation(const Points& points) {
  double square = 0;
  for (const Eigen::Vector3d& p : points) {
    const double deviation_um = 1000 * (at(p.x(), p.y()).depth_mm - p.z());
    max_deviation_um_ = std::max(max_deviation_um_, std::abs(deviation_um));
    square += deviation_um * deviation_um;
  }
  rms_deviation_um_ = std::sqrt(square / static_cast<double>(points.size()));
}

HeightField::Jet HeightField::at(double x_mm, double y_mm) const {
  return evaluate({x_mm, y_mm}, origin_, spacing_, columns_, rows_, controls_);
}

bool HeightField::covers(double x_mm, double y_mm) const {
  const double radius = std::hypot(x_mm, y_mm);
  if (radius <= inner_reach_) return true;
  if (radius > reach_) return false;
  // Of a convex outline about the origin only the side in the point's direction can part the two.
  const auto next =
      std::upper_bound(outline_angles_rad_.begin(), outline_angles_rad_.end(), std::atan2(y_mm, x_mm)) -
      outline_angles_rad_.begin();
  const std::size_t n = outline_.size(), k = static_cast<std::size_t>(next) % n;
  return inside_distance(outline_[(k + n - 1) % n], outline_[k], {x_mm, y_mm}) >= 0;
}

std::optional<ShapeHit> HeightField::intersect(const Ray& ray) const {
  // Newton may pass through the margin; only where it ends has to lie inside.
  const double limit = reach_ + 4 * spacing_;
  const auto sag = [&](const Eigen::Vector2d& p) -> std::optional<Sag> {
    if (p.norm() > limit) return std::nullopt;
    const Jet jet = at(p.x(), p.y());
    return Sag{jet.depth_mm, jet.gradient};
  };
  for (const double start : newton_starts(ray, base_curvature_.trace() / 2)) {
    std::optional<ShapeHit> hit = newton_hit(ray, start, sag);
    if (hit && hit->distance_mm >= -1e-9 && covers(hit->position.x(), hit->position.y())) return hit;
  }
  return std::nullopt;
}

}  // namespace emmetrope
