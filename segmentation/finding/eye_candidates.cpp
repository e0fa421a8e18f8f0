#include "segmentation/finding/eye_candidates.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>

#include "segmentation/finding/blanked_region.hpp"
#include "segmentation/finding/radial_symmetry.hpp"
#include "segmentation/finding/sampling.hpp"
#include "segmentation/intake/canonical_stack.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;

/// Edges of the polarity along rays from the centre: radius of the largest step, or nothing.
struct RadialEdges {
  std::vector<Vector3d> points;
  std::vector<double> steps;
  int inside = 0, outside = 0, blanked = 0;
};
RadialEdges radial_edges(const Stack& stack, const Vector3d& centre, Weighting weighting,
                         const BlankedRegion& blanked) {
  constexpr double step = 0.4, from = 7.0, to = 16.0;
  const int count = static_cast<int>((to - from) / step) + 1;
  const double sign = weighting == Weighting::t2 ? -1 : 1;
  const Sampler sampler(stack);
  RadialEdges edges;
  for (const Vector3d& direction : directions_along(stack, 240)) {
    std::vector<double> profile;
    bool is_blanked = false;
    for (int i = 0; i < count; ++i) {
      const Vector3d at = centre + (from + i * step) * direction;
      const auto value = sampler.interpolate(at);
      is_blanked = value && blanked.is_blank(*value) && blanked.holds(sampler, at);
      if (!value || is_blanked) break;
      profile.push_back(*value);
    }
    // A ray that leaves the stack before the wall says nothing, nor one that ends in what was blanked.
    if (from + static_cast<double>(profile.size()) * step < 13) {
      ++(is_blanked ? edges.blanked : edges.outside);
      continue;
    }
    ++edges.inside;
    const auto step_at = [&](std::size_t i) {
      return sign * (profile[i + 2] + profile[i + 1] - profile[i - 1] - profile[i - 2]) / 2;
    };
    double largest = 0;
    std::size_t at = 0;
    for (std::size_t i = 3; i + 3 < profile.size(); ++i) {
      if (step_at(i) > largest) {
        largest = step_at(i);
        at = i;
      }
    }
    if (at == 0) continue;
    // The wall is the first step of at least 70 % of the largest one, not an orbital edge behind it.
    for (std::size_t i = 3; i < at; ++i) {
      if (step_at(i) >= 0.7 * largest && step_at(i + 1) <= step_at(i)) {
        at = i;
        break;
      }
    }
    edges.points.push_back(centre + (from + static_cast<double>(at) * step) * direction);
    edges.steps.push_back(largest);
  }
  return edges;
}

/// Least-squares sphere through points, by repeated trimming.
bool fit_sphere(const std::vector<Vector3d>& points, Vector3d& centre, double& radius) {
  std::vector<Vector3d> kept = points;
  for (int pass = 0; pass < 6; ++pass) {
    if (kept.size() < 30) return false;
    Eigen::MatrixXd a(kept.size(), 4);
    Eigen::VectorXd b(kept.size());
    for (std::size_t i = 0; i < kept.size(); ++i) {
      const Vector3d d = kept[i] - centre;
      a.row(static_cast<Eigen::Index>(i)) << 2 * d.x(), 2 * d.y(), 2 * d.z(), 1;
      b[static_cast<Eigen::Index>(i)] = d.squaredNorm();
    }
    const Eigen::Vector4d s = a.colPivHouseholderQr().solve(b);
    const double r2 = s[3] + s.head<3>().squaredNorm();
    if (!(r2 > 0)) return false;
    centre += s.head<3>();
    radius = std::sqrt(r2);
    std::vector<double> misfit;
    for (const Vector3d& p : points) misfit.push_back(std::abs((p - centre).norm() - radius));
    std::vector<double> sorted = misfit;
    const double limit = std::max(0.8, 2 * quantile(sorted, 0.5));
    kept.clear();
    for (std::size_t i = 0; i < points.size(); ++i)
      if (misfit[i] < limit) kept.push_back(points[i]);
  }
  return true;
}

/// A peak of the votes checked on its radial profiles.
bool refine(const Stack& stack, const SymmetryPeak& peak, const BlankedRegion& blanked,
            EyeCandidate& candidate) {
  candidate.weighting = peak.weighting;
  candidate.centre = peak.position;
  RadialEdges edges;
  for (int pass = 0; pass < 3; ++pass) {
    edges = radial_edges(stack, candidate.centre, peak.weighting, blanked);
    if (!fit_sphere(edges.points, candidate.centre, candidate.radius_mm)) return false;
    if ((candidate.centre - peak.position).norm() > 8) return false;
  }
  if (candidate.radius_mm < smallest_globe_mm || candidate.radius_mm > largest_globe_mm + 1) return false;
  const Sampler sampler(stack);
  int agreeing = 0;
  std::vector<double> steps, rim;
  for (std::size_t i = 0; i < edges.points.size(); ++i) {
    const Vector3d from_centre = edges.points[i] - candidate.centre;
    const double distance = from_centre.norm();
    if (std::abs(distance - candidate.radius_mm) > 1.2) continue;
    ++agreeing;
    steps.push_back(edges.steps[i]);
    constexpr double within_edge_mm = 2;
    if (const auto value = sampler.interpolate(edges.points[i] - within_edge_mm / distance * from_centre))
      rim.push_back(*value);
  }
  candidate.agreement = edges.inside > 0 ? static_cast<double>(agreeing) / edges.inside : 0;
  candidate.inside = static_cast<double>(edges.inside) / (edges.inside + edges.outside);
  candidate.blanked = static_cast<double>(edges.blanked) / (edges.inside + edges.outside + edges.blanked);

  std::vector<double> core;
  for_each_voxel_near(stack, candidate.centre, 5, [&](int c, int r, int s, const Vector3d&) {
    const double value = stack.at(c, r, s);
    if (!blanked.is_blank(value) || !blanked.holds_voxel(c, r, s)) core.push_back(value);
  });
  if (core.size() < 20) return false;
  const double spread = std::max(quantile(core, 0.84) - quantile(core, 0.16), 1e-9) / 2;
  // Air in a sinus is dark, and nothing but noise: the median of a Rayleigh magnitude is 1.8 of such spreads.
  constexpr double air_over_spread = 1.95, air_over_wall = 0.25;
  const double inside = quantile(core, 0.5), wall = inside + quantile(steps, 0.5);
  if (inside >= 0 && inside < air_over_spread * spread && inside < air_over_wall * wall) return false;
  candidate.contrast_to_spread = quantile(steps, 0.5) / spread;
  // A globe is as bright within its edge as in its middle; the fat around it, in T1 a bright ball against
  // bone and air, is not.
  return std::abs(quantile(rim, 0.5) - quantile(core, 0.5)) < 0.5 * quantile(steps, 0.5);
}

}  // namespace

std::vector<EyeCandidate> find_candidates(const Stack& stored, Zeros zeros) {
  std::vector<EyeCandidate> candidates;
  if (stored.slices() < 3) return candidates;
  const Stack stack = canonical_part(stored, stored.slice_position.front(), whole_extent_mm(stored));
  const BlankedRegion blanked = zeros == Zeros::blanked ? BlankedRegion(stack) : BlankedRegion();
  for (const SymmetryPeak& peak : symmetry_peaks(stack, blanked)) {
    EyeCandidate candidate;
    if (stack.told_weighting.value_or(peak.weighting) != peak.weighting) continue;
    if (!refine(stack, peak, blanked, candidate)) continue;
    if (candidate.agreement < 0.45 || candidate.contrast_to_spread < 1.5) continue;
    const bool known = std::any_of(candidates.begin(), candidates.end(), [&](const EyeCandidate& other) {
      return (other.centre - candidate.centre).norm() < 6 && other.score() >= candidate.score();
    });
    if (!known) candidates.push_back(candidate);
  }
  std::sort(candidates.begin(), candidates.end(),
            [](const EyeCandidate& a, const EyeCandidate& b) { return a.score() > b.score(); });
  return candidates;
}

}  // namespace emmetrope::segmentation
