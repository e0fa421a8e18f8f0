#include "segmentation/edges/edge_reader.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "pipeline/base/frames.hpp"
#include "segmentation/edges/edge_profile.hpp"
#include "segmentation/finding/blanked_region.hpp"
#include "segmentation/finding/sampling.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr int ray_count = 1500, first_ray_count = 400;  ///< of the last round, and before
constexpr double first_mm = 3, last_mm = 16.5, farthest_edge_mm = 15.5;
constexpr double lens_cone_deg = 57;  ///< rays nearer to the axis meet lens and cornea
constexpr double smoothing_mm = 0.2;
constexpr double usual_lens_mm = 8;               ///< from the globe's centre
constexpr double blanked_reach_mm = last_mm + 6;  ///< the seed may be some mm off
constexpr int fewest_rounds = 4, most_rounds = 16;
constexpr double settled_mm = 1e-3;  ///< of the centre: where it ends does not depend on where it began

/// \param up  of the head
Matrix3d axes_about(const Vector3d& outward, const Vector3d& up) {
  Matrix3d axes;
  axes.col(2) = outward;
  axes.col(0) = up.cross(outward).normalized();
  axes.col(1) = outward.cross(axes.col(0));
  return axes;
}

/// A ray from the globe's centre that is long enough to meet the wall.
struct Ray {
  Vector3d direction;
  Profile profile;
  double vitreous = 0;
};

struct Rays {
  std::vector<Ray> inside;
  int cast = 0;
};
Rays cast_rays(const Stack& stack, const BlankedRegion& blanked, const Vector3d& centre, const Vector3d& axis,
               double sign, int count) {
  constexpr double wall_reach_mm = 13.5, blank_step_mm = 0.75;
  const Sampler sampler(stack);
  const auto meets_blank = [&](const Vector3d& direction) {
    for (double mm = first_mm; mm <= wall_reach_mm; mm += blank_step_mm)
      if (blanked.holds(sampler, centre + mm * direction)) return true;
    return false;
  };
  Rays rays;
  for (const Vector3d& direction : directions_along(stack, count)) {
    if (direction.dot(axis) > std::cos(lens_cone_deg * degree)) continue;
    ++rays.cast;
    if (meets_blank(direction)) continue;
    Ray ray{direction, sample_profile(stack, {centre, direction}, first_mm, last_mm, sign, smoothing_mm)};
    if (!ray.profile.covers(wall_reach_mm)) continue;
    ray.vitreous = median_between(ray.profile, first_mm, 7.5);
    rays.inside.push_back(std::move(ray));
  }
  return rays;
}

/// The wall's step: median over the equator of the first strong rise.
double wall_step(const std::vector<Ray>& rays, const Vector3d& axis) {
  std::vector<double> steps;
  for (const Ray& ray : rays) {
    if (std::abs(ray.direction.dot(axis)) > 0.45) continue;
    if (const auto edge = first_edge(ray.profile, ray.vitreous, {}))
      steps.push_back(edge->plateau - ray.vitreous);
  }
  return quantile(steps, 0.5);
}

/// Whether a profile falls below a level between two places.
bool falls_below(const Profile& profile, double level, double from_mm, double to_mm) {
  for (std::size_t i = 0; i < profile.value.size(); ++i)
    if (profile.at_mm(i) >= from_mm && profile.at_mm(i) <= to_mm && profile.value[i] < level) return true;
  return false;
}

enum class PlaceRule { half_level, steepest, fixed_half_level };

double place_of(const Edge& edge, PlaceRule rule) {
  return rule == PlaceRule::half_level ? edge.half_level_mm
         : rule == PlaceRule::steepest ? edge.steepest_mm
                                       : edge.fixed_half_level_mm;
}

/// The edges of the rays, each with its direction.
struct WallEdges {
  std::vector<Vector3d> direction;
  std::vector<Edge> edge;
  double over_void = 0;  ///< share of them (EdgeReading::rays_over_void)

  std::vector<Vector3d> points(const Vector3d& centre, PlaceRule rule) const {
    std::vector<Vector3d> list;
    for (std::size_t i = 0; i < edge.size(); ++i)
      list.push_back(centre + place_of(edge[i], rule) * direction[i]);
    return list;
  }
};

EdgeRule wall_rule(double step) {
  EdgeRule rule;
  rule.last_mm = farthest_edge_mm;
  rule.least_rise = 0.4 * step;
  rule.typical_step = step;
  return rule;
}

/// Fat outshines the wall: a profile counts to 1.4 times the wall's step.
Profile clipped(Profile profile, double ceiling) {
  for (double& value : profile.value) value = std::min(value, ceiling);
  return profile;
}

WallEdges wall_edges(const std::vector<Ray>& rays, double step) {
  // Of the vitreous' signal: half way to none is as low as ringing gets.
  constexpr double of_void = 0.4, reach_mm = 3, ramp_mm = 0.4;
  WallEdges edges;
  int before_edge = 0, within = 0;
  for (const Ray& ray : rays) {
    const auto edge =
        first_edge(clipped(ray.profile, ray.vitreous + 1.4 * step), ray.vitreous, wall_rule(step));
    if (!edge) continue;
    edges.direction.push_back(ray.direction);
    edges.edge.push_back(*edge);
    const double level = of_void * ray.vitreous, mm = edge->half_level_mm;
    before_edge += falls_below(ray.profile, level, mm - reach_mm, mm - ramp_mm);
    within += falls_below(ray.profile, level, mm - 2 * reach_mm, mm - reach_mm - ramp_mm);
  }
  if (!edges.edge.empty()) edges.over_void = (before_edge - within) / static_cast<double>(edges.edge.size());
  return edges;
}

/// Mean shift of what differs from the vitreous as the wall does, in a ball of the lens' size.
Vector3d find_lens(const Stack& stack, const Vector3d& start, double vitreous, double step, double sign) {
  constexpr double lens_ball_mm = 3.5;
  const Sampler sampler(stack);
  const Matrix3d axes = axes_of_voxels(stack);
  Vector3d centre = start;
  for (int i = 0; i < 30; ++i) {
    Vector3d sum = Vector3d::Zero();
    double weights = 0;
    constexpr double grid_mm = 0.5;
    constexpr int reach = static_cast<int>(lens_ball_mm / grid_mm);
    for (int x = -reach; x <= reach; ++x)
      for (int y = -reach; y <= reach; ++y)
        for (int z = -reach; z <= reach; ++z) {
          if (grid_mm * Vector3d(x, y, z).norm() > lens_ball_mm) continue;
          const Vector3d at = grid_mm * axes * Vector3d(x, y, z);
          const auto value = sampler.interpolate(centre + at);
          if (!value) continue;
          const double weight = std::clamp(sign * *value - vitreous, 0.0, step);
          sum += weight * at;
          weights += weight;
        }
    if (weights <= 0) break;
    const Vector3d move = sum / weights;
    centre += move;
    if (move.norm() < 0.01) break;
  }
  return centre;
}

/// A profile's rises and falls, found between its extremes.
class AxialProfile {
 public:
  explicit AxialProfile(Profile profile) : profile_(std::move(profile)) {}

  double value(std::size_t i) const { return profile_.value[i]; }
  std::size_t end() const { return profile_.value.size(); }
  std::size_t largest(double from_mm, double to_mm) const {
    return index_of(std::max_element(at(from_mm), at(to_mm) + 1));
  }
  std::size_t smallest(double from_mm, double to_mm) const {
    return index_of(std::min_element(at(from_mm), at(to_mm) + 1));
  }
  /// The first maximum after a place that lies so much above it.
  std::optional<std::size_t> next_maximum(std::size_t from, double above) const {
    for (std::size_t i = from; i + 1 < end(); ++i)
      if (value(i) - value(from) >= above && value(i + 1) < value(i)) return i;
    return std::nullopt;
  }
  /// Where it passes a level on the way from a low place to a high one, in either direction.
  double crossing(std::size_t low, std::size_t high, double level) const {
    const auto next = [&](std::size_t i) { return high > low ? i + 1 : i - 1; };
    std::size_t i = low;
    while (i != high && value(next(i)) < level) i = next(i);
    if (i == high) return profile_.at_mm(high);
    const double share = (level - value(i)) / (value(next(i)) - value(i));
    return profile_.at_mm(i) + share * (profile_.at_mm(next(i)) - profile_.at_mm(i));
  }
  double half_level(std::size_t low, std::size_t high) const {
    return crossing(low, high, (value(low) + value(high)) / 2);
  }

 private:
  std::vector<double>::const_iterator at(double mm) const {
    const auto steps = std::lround((mm - profile_.first_mm) / profile_.step_mm);
    return profile_.value.begin() + std::clamp(steps, 0L, static_cast<long>(end()) - 1);
  }
  std::size_t index_of(std::vector<double>::const_iterator place) const {
    return static_cast<std::size_t>(place - profile_.value.begin());
  }

  Profile profile_;
};

/// Lens and cornea along the axis, and the wall's pole by the edges about it.
std::optional<AxialEdges> read_axis(const Stack& stack, const EdgeReading& reading, const WallEdges& wall,
                                    const Vector3d& edges_from, double step, double sign) {
  constexpr double pole_cone_deg = 14, tube_radius_mm = 1, front_mm = 17, least_front_mm = 15;
  const Vector3d centre = reading.globe.centre, outward = reading.globe.axes.col(2);
  std::vector<double> depths;
  for (std::size_t i = 0; i < wall.edge.size(); ++i)
    if (wall.direction[i].dot(outward) < -std::cos(pole_cone_deg * degree))
      depths.push_back(outward.dot(edges_from + wall.edge[i].half_level_mm * wall.direction[i] - centre));
  if (depths.size() < 8) return std::nullopt;
  const Profile profile =
      sample_profile(stack, {centre, outward, tube_radius_mm}, 0, front_mm, sign, smoothing_mm);
  if (!profile.covers(least_front_mm)) return std::nullopt;
  const AxialProfile front(profile);
  const double lens_mm = reading.lens_to_centre_mm();
  const std::size_t lens = front.largest(lens_mm - 1.2, lens_mm + 1.2);
  const std::size_t behind = front.smallest(lens_mm - 5, lens_mm - 1.5);
  const std::size_t chamber = front.smallest(lens_mm + 1.5, lens_mm + 4.2);
  const auto cornea = front.next_maximum(chamber, 0.3 * step);
  const bool lens_is_seen =
      front.value(lens) - std::max(front.value(behind), front.value(chamber)) > 0.2 * step;
  if (!cornea || !lens_is_seen) return std::nullopt;
  AxialEdges edges;
  edges.inner_wall_mm = quantile(depths, 0.5);
  edges.lens_back_mm = front.half_level(behind, lens);
  edges.lens_front_mm = front.half_level(chamber, lens);
  const double top = std::min(front.value(*cornea), front.value(chamber) + 1.4 * step);
  edges.inner_cornea_mm = front.crossing(chamber, *cornea, (front.value(chamber) + top) / 2);
  return edges;
}

/// How far edges about both ends of an axis of the globe lie outside of it.
double past_ends_mm(const EdgeEllipsoid& globe, int axis, const std::vector<Vector3d>& edges) {
  constexpr double cone_deg = 15;
  constexpr std::size_t fewest = 8;
  double both_ends = 0;
  for (const double end : {-1.0, 1.0}) {
    std::vector<double> outside;
    for (const Vector3d& edge : edges) {
      const Vector3d from_centre = globe.axes.transpose() * (edge - globe.centre);
      if (end * from_centre[axis] > std::cos(cone_deg * degree) * from_centre.norm())
        outside.push_back(from_centre.norm() * (1 - 1 / from_centre.cwiseQuotient(globe.half_axes).norm()));
    }
    if (outside.size() < fewest) return 0;
    both_ends += quantile(outside, 0.5);
  }
  return std::max(both_ends, 0.0);
}

double across_mm(const EdgeEllipsoid& globe) { return globe.half_axes[0] + globe.half_axes[1]; }

}  // namespace

std::optional<EdgeReading> read_edges(const Stack& stack, const EdgeSeed& seed, Weighting weighting) {
  const double sign = weighting == Weighting::t1 ? 1 : -1;
  EdgeReading reading;
  reading.globe.centre = seed.globe_centre;
  Vector3d axis = seed.axis;
  const Vector3d up = axes_of_voxels(stack).col(2);
  const BlankedRegion blanked = blanked_front(stack, seed.globe_centre, seed.axis, blanked_reach_mm);
  reading.front_is_blanked = blanked.holds_front(stack, seed.globe_centre, seed.axis);
  double step = 0;
  bool has_settled = false;
  for (int round = 0; round < most_rounds; ++round) {
    const bool is_last = has_settled || round == most_rounds - 1;
    const Rays rays =
        cast_rays(stack, blanked, reading.globe.centre, axis, sign, is_last ? ray_count : first_ray_count);
    if (rays.inside.size() < 100) return std::nullopt;
    step = wall_step(rays.inside, axis);
    if (!(step > 0)) return std::nullopt;
    const WallEdges edges = wall_edges(rays.inside, step);
    if (edges.edge.size() < 100) return std::nullopt;
    reading.rays_inside = static_cast<double>(rays.inside.size()) / rays.cast;
    reading.rays_with_edge = static_cast<double>(edges.edge.size()) / static_cast<double>(rays.inside.size());
    if (weighting == Weighting::t1) reading.rays_over_void = edges.over_void;
    EdgeEllipsoid start;
    start.centre = reading.globe.centre;
    start.axes = axes_about(axis, up);
    const Vector3d from = reading.globe.centre;
    reading.globe = fit_ellipsoid(edges.points(from, PlaceRule::half_level), start);
    if (reading.globe.kept_share == 0) return std::nullopt;
    if (is_last) {
      const std::vector<Vector3d> points = edges.points(from, PlaceRule::half_level);
      reading.wider_mm = past_ends_mm(reading.globe, 0, points);
      reading.higher_mm = past_ends_mm(reading.globe, 1, points);
      for (const PlaceRule rule : {PlaceRule::steepest, PlaceRule::fixed_half_level}) {
        const EdgeEllipsoid other = fit_ellipsoid(edges.points(from, rule), start);
        reading.rule_spread_mm =
            std::max(reading.rule_spread_mm, std::abs(across_mm(other) - across_mm(reading.globe)));
      }
    }
    std::vector<double> levels;
    for (const Ray& ray : rays.inside) levels.push_back(ray.vitreous);
    const double vitreous = quantile(levels, 0.5);
    reading.lens_centre = reading.globe.centre + usual_lens_mm * axis;
    if (!reading.front_is_blanked)
      reading.lens_centre = find_lens(stack, reading.lens_centre, vitreous, step, sign);
    axis = (reading.lens_centre - reading.globe.centre).normalized();
    has_settled = round + 2 >= fewest_rounds && (reading.globe.centre - from).norm() < settled_mm;
    reading.wall_contrast = step / std::max(std::abs(vitreous), 1e-9);
    if (!is_last) continue;
    if (!reading.front_is_blanked) reading.axial = read_axis(stack, reading, edges, from, step, sign);
    break;
  }
  reading.half_axes_along_voxels_mm = reading.globe.half_axes;
  reading.globe = along(axes_about(reading.globe.axes.col(2), Vector3d::UnitZ()), reading.globe);
  return reading;
}

}  // namespace emmetrope::segmentation
