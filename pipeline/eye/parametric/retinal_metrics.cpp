#include "pipeline/eye/parametric/retinal_metrics.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "pipeline/base/frames.hpp"
#include "pipeline/base/quadrature.hpp"

namespace emmetrope {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

/// Eyes that are measured differ from ellipsoids by waves of about 40 degrees, which this resolves.
constexpr int spokes = 16;
constexpr double ring_spacing_rad = 15 * degree;
/// For derivatives along the interface: off by 1e-4 of such a wave's own.
constexpr double step_rad = 0.01;

/// A direction with its share of a solid angle.
struct Share {
  Vector3d direction;
  double solid_angle;
};

/// Directions between two angles from the pole.
std::vector<Share> shares_between(double from_rad, double to_rad) {
  const double low = std::cos(to_rad), high = std::cos(from_rad);
  const int rings = std::max(4, static_cast<int>(std::ceil((to_rad - from_rad) / ring_spacing_rad)));
  const auto [node, weight] = gauss_legendre(rings);
  std::vector<Share> shares;
  for (int i = 0; i < rings; ++i) {
    const double eccentricity_rad = std::acos(low + (high - low) * node[i]);
    for (int k = 0; k < spokes; ++k)
      shares.push_back({retinal_direction(eccentricity_rad, 2 * pi * k / spokes),
                        (high - low) * weight[i] * 2 * pi / spokes});
  }
  return shares;
}

std::vector<Share> cap(double cap_deg) { return shares_between(0, cap_deg / 2 * degree); }

/// Two directions across.
std::array<Vector3d, 2> across(const Vector3d& direction) {
  const Vector3d first = direction.unitOrthogonal();
  return {first, direction.cross(first)};
}

Vector3d point(const InterfaceDistance& interface, const Vector3d& direction) {
  return interface(direction) * direction;
}

/// A of the quadric x'Ax + b'x = 1.
Matrix3d squares(const Quadric& c) {
  Matrix3d a;
  a << c[0], c[3], c[4], c[3], c[1], c[5], c[4], c[5], c[2];
  return a;
}

/// What the quadric's coefficients are multiplied by at a point.
Quadric terms(const Vector3d& p) {
  Quadric row;
  row << p.x() * p.x(), p.y() * p.y(), p.z() * p.z(), 2 * p.x() * p.y(), 2 * p.x() * p.z(), 2 * p.y() * p.z(),
      p;
  return row;
}

Vector3d gradient_at(const Quadric& quadric, const Vector3d& p) {
  return 2 * squares(quadric) * p + quadric.tail<3>();
}

/// Of points to the quadric, to first order.
double squared_distances(const Quadric& quadric, const std::vector<Vector3d>& points,
                         const std::vector<Share>& shares) {
  double sum = 0;
  for (std::size_t i = 0; i < points.size(); ++i)
    sum += shares[i].solid_angle * std::pow(quadric.dot(terms(points[i])) - 1, 2) /
           gradient_at(quadric, points[i]).squaredNorm();
  return sum;
}

/// Unit vector of the plane across an axis that lies in the meridian of `along`.
Vector3d in_meridian(const Vector3d& along, const Vector3d& axis) {
  return (along - along.dot(axis) * axis).normalized();
}

/// How far the interface reaches along a direction: coarse search, then a compass search.
double reach_mm(const InterfaceDistance& interface, const Vector3d& along) {
  const auto [s, t] = across(along);
  const auto coordinate = [&, s = s, t = t](double a, double b) {
    return along.dot(point(interface, (along + std::tan(a) * s + std::tan(b) * t).normalized()));
  };
  double a = 0, b = 0, best = coordinate(0, 0);
  const auto attempt = [&](double to_a, double to_b) {
    const double value = coordinate(to_a, to_b);
    if (value <= best) return false;
    a = to_a, b = to_b, best = value;
    return true;
  };
  for (int i = -2; i <= 2; ++i) {
    for (int k = -2; k <= 2; ++k) attempt(0.2 * i, 0.2 * k);
  }
  for (double step = 0.1; step > 1e-4;) {  // the reach is then right to 1e-7 mm
    if (!(attempt(a + step, b) || attempt(a - step, b) || attempt(a, b + step) || attempt(a, b - step)))
      step /= 2;
  }
  return best;
}

Vector2d towards_deg(const Vector3d& outward) {
  return Vector2d(std::atan2(outward.x(), outward.z()), std::atan2(outward.y(), outward.z())) / degree;
}

}  // namespace

InterfaceDistance vitreoretinal_interface(const ParametricEye& eye) {
  return [&eye](const Vector3d& direction) {
    const Vector3d scaled = direction.cwiseQuotient(eye.globe_semi_axes_mm).normalized();
    return (eye.retina_point(scaled) - eye.globe_centre_mm()).norm();
  };
}

double globe_extent_mm(const InterfaceDistance& interface, const Vector3d& along) {
  return reach_mm(interface, along) + reach_mm(interface, -along);
}

Vector3d retinal_direction(double eccentricity_rad, double meridian_rad) {
  const double across = std::sin(eccentricity_rad);
  return {across * std::cos(meridian_rad), across * std::sin(meridian_rad), -std::cos(eccentricity_rad)};
}

Quadric best_quadric(const InterfaceDistance& interface, double cap_deg) {
  const std::vector<Share> shares = cap(cap_deg);
  std::vector<Vector3d> points;
  for (const Share& share : shares) points.push_back(point(interface, share.direction));
  using Normal = Eigen::Matrix<double, 9, 9>;
  // To start with the gradient's size counts for nothing, which favours steep quadrics.
  Normal squared = Normal::Zero();
  Quadric right = Quadric::Zero();
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Quadric row = terms(points[i]);
    squared += shares[i].solid_angle * row * row.transpose();
    right += shares[i].solid_angle * row;
  }
  Quadric found = squared.ldlt().solve(right);
  // Gauss-Newton on the distances, which are what is left of the equation over the size of its gradient.
  double sum = squared_distances(found, points, shares);
  for (int round = 0; round < 100; ++round) {
    Normal normal = Normal::Zero();
    Quadric downhill = Quadric::Zero();
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Quadric row = terms(points[i]);
      const Vector3d gradient = gradient_at(found, points[i]);
      const double steepness = gradient.norm(), left = found.dot(row) - 1;
      Quadric slope = row / steepness;
      for (int k = 0; k < 9; ++k)
        slope[k] -= left / std::pow(steepness, 3) * gradient.dot(gradient_at(Quadric::Unit(k), points[i]));
      normal += shares[i].solid_angle * slope * slope.transpose();
      downhill -= shares[i].solid_angle * left / steepness * slope;
    }
    Quadric step = normal.ldlt().solve(downhill);
    double then = squared_distances(found + step, points, shares);
    for (int half = 0; half < 30 && !(then <= sum); ++half) {
      step /= 2;
      then = squared_distances(found + step, points, shares);
    }
    if (!(then <= sum)) break;
    found += step;
    sum = then;
    if (step.norm() < 1e-10 * found.norm()) break;
  }
  return found;
}

BestEllipsoid as_ellipsoid(const Quadric& quadric) {
  const Matrix3d a = squares(quadric);
  const Vector3d b = quadric.tail<3>();
  const Eigen::SelfAdjointEigenSolver<Matrix3d> eigen(a);
  Eigen::Index nearest = 0;
  eigen.eigenvectors().row(2).cwiseAbs().maxCoeff(&nearest);
  const Vector3d axis = eigen.eigenvectors().col(nearest) * (eigen.eigenvectors()(2, nearest) < 0 ? -1 : 1);
  // About its centre x'Ax = k; a hyperboloid of two sheets has k and the eigenvalue along the axis below 0. One of one
  // sheet has no vertex on its axis: a radius of 0, as ellipsoids of ever longer axes come to.
  const double k = 1 + b.dot(a.inverse() * b) / 4;
  const double along = axis.dot(a * axis);
  BestEllipsoid best;
  best.axis_deg = towards_deg(axis);
  for (const int meridian : {0, 1}) {
    const Vector3d h = in_meridian(Vector3d::Unit(meridian), axis);
    const double sideways = h.dot(a * h);
    best.vertex_radius_mm[meridian] = std::sqrt(std::max(0.0, k * along)) / sideways;
    best.q += (along / sideways - 1) / 2;
  }
  return best;
}

BestEllipsoid best_ellipsoid(const InterfaceDistance& interface, double cap_deg) {
  return as_ellipsoid(best_quadric(interface, cap_deg));
}

double retinal_area_mm2(const InterfaceDistance& interface, double cap_deg) {
  double area_mm2 = 0;
  for (const Share& share : cap(cap_deg)) {
    const double distance = interface(share.direction);
    constexpr double small_rad = 1e-4;
    double slope2 = 0;  // of the distance along the unit sphere
    for (const Vector3d& t : across(share.direction))
      slope2 +=
          std::pow((interface((share.direction + small_rad * t).normalized()) - distance) / small_rad, 2);
    area_mm2 += share.solid_angle * distance * std::sqrt(distance * distance + slope2);
  }
  return area_mm2;
}

double vitreous_volume_mm3(const InterfaceDistance& interface, double centre_depth_mm, const LensBack& lens) {
  const double widest = lens.q > -1 ? lens.radius_mm / std::sqrt(1 + lens.q) : lens.equator_radius_mm;
  const double rim = std::min(lens.equator_radius_mm, widest);
  const double curved = rim * rim / lens.radius_mm;
  const double sagitta = curved / (1 + std::sqrt(std::max(0.0, 1 - (1 + lens.q) * curved / lens.radius_mm)));
  // On a conic r^2 = 2 R s - (1 + Q) s^2.
  const double behind_equator = pi * sagitta * sagitta * (lens.radius_mm - (1 + lens.q) * sagitta / 3);
  const double plane = centre_depth_mm - (lens.vertex_depth_mm - sagitta);  // before the globe's centre
  // Where the plane cuts the interface; within the rest it bounds the volume.
  double cut_rad = pi / 2;
  for (int round = 0; round < 8; ++round) {
    double distance = 0;
    for (int spoke = 0; spoke < spokes; ++spoke)
      distance += interface(retinal_direction(cut_rad, 2 * pi * spoke / spokes)) / spokes;
    cut_rad = pi - std::acos(std::clamp(plane / distance, -1.0, 1.0));
  }
  double volume = 0;
  for (const Share& share : shares_between(0, cut_rad))
    volume += share.solid_angle * std::pow(interface(share.direction), 3) / 3;
  const double radius2 = plane * plane * std::pow(std::tan(cut_rad), 2);
  return volume + pi * radius2 * plane / 3 - behind_equator;
}

Vector2d rim_tilt_deg(const InterfaceDistance& interface, double cap_deg) {
  // z = z0 + c x + s y over the rim, whose points are spread evenly: normal equations are diagonal but for its shape.
  Matrix3d normal = Matrix3d::Zero();
  Vector3d right = Vector3d::Zero();
  for (int k = 0; k < spokes; ++k) {
    const Vector3d p = point(interface, retinal_direction(cap_deg / 2 * degree, 2 * pi * k / spokes));
    const Vector3d row(p.x(), p.y(), 1);
    normal += row * row.transpose();
    right += row * p.z();
  }
  const Vector3d plane = normal.ldlt().solve(right);
  return towards_deg({-plane.x(), -plane.y(), 1});
}

double macular_curvature_index(const InterfaceDistance& interface) {
  constexpr int lines = 12, steps = 9;
  constexpr double half_line_mm = 4.5;
  const double step = half_line_mm / interface(-Vector3d::UnitZ()) / steps;
  double sharpest_per_mm = 0;
  for (int line = 0; line < lines; ++line) {
    const auto distance = [&](int i) { return interface(retinal_direction(i * step, line * pi / lines)); };
    std::array<double, 3> r{distance(-steps - 1), distance(-steps), 0};
    for (int i = -steps; i <= steps; ++i) {
      r[2] = distance(i + 1);
      const double slope = (r[2] - r[0]) / (2 * step), bend = (r[2] - 2 * r[1] + r[0]) / (step * step);
      const double speed2 = r[1] * r[1] + slope * slope;
      sharpest_per_mm =
          std::max(sharpest_per_mm, (speed2 + slope * slope - r[1] * bend) / (speed2 * std::sqrt(speed2)));
      r = {r[1], r[2], 0};
    }
  }
  return keratometric_D_mm * sharpest_per_mm;
}

double mean_curvature_per_mm(const InterfaceDistance& interface, const Vector3d& direction) {
  const auto [s, t] = across(direction);
  const auto at = [&, s = s, t = t](int i, int k) {
    return point(interface, (direction + step_rad * (i * s + k * t)).normalized());
  };
  const Vector3d middle = at(0, 0), left = at(-1, 0), right = at(1, 0), below = at(0, -1), above = at(0, 1);
  const double step2 = step_rad * step_rad;
  const Vector3d ps = (right - left) / (2 * step_rad), pt = (above - below) / (2 * step_rad);
  const Vector3d pss = (right - 2 * middle + left) / step2, ptt = (above - 2 * middle + below) / step2;
  const Vector3d pst = (at(1, 1) + at(-1, -1) - right - left - above - below + 2 * middle) / (2 * step2);
  Vector3d inwards = ps.cross(pt).normalized();
  if (inwards.dot(direction) > 0) inwards = -inwards;
  const double e = ps.dot(ps), f = ps.dot(pt), g = pt.dot(pt);
  return (e * inwards.dot(ptt) - 2 * f * inwards.dot(pst) + g * inwards.dot(pss)) / (2 * (e * g - f * f));
}

BestSphere best_sphere(const InterfaceDistance& interface, double cap_deg) {
  Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();  // |p|^2 = 2 m'p + (r^2 - |m|^2)
  Eigen::Vector4d right = Eigen::Vector4d::Zero();
  for (const Share& share : cap(cap_deg)) {
    const Vector3d p = point(interface, share.direction);
    const Eigen::Vector4d row(2 * p.x(), 2 * p.y(), 2 * p.z(), 1);
    normal += share.solid_angle * row * row.transpose();
    right += share.solid_angle * row * p.squaredNorm();
  }
  const Eigen::Vector4d found = normal.ldlt().solve(right);
  const Vector3d centre = found.head<3>();
  return {centre, std::sqrt(found[3] + centre.squaredNorm())};
}

}  // namespace emmetrope
