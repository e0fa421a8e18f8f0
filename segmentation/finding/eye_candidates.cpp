#include "segmentation/finding/eye_candidates.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "pipeline/base/frames.hpp"
#include "segmentation/finding/sampling.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

constexpr double grid_mm = 1.5;
constexpr double smallest_radius_mm = 9, largest_radius_mm = 14;

/// A stack resampled to a cubic grid along its own axes.
struct Grid {
  Vector3i size;
  Vector3d origin, x, y, z;
  std::vector<float> value;

  std::size_t index(int i, int j, int k) const {
    return (static_cast<std::size_t>(k) * size.y() + j) * size.x() + i;
  }
  Vector3d position(const Vector3d& g) const {
    return origin + grid_mm * (g.x() * x + g.y() * y + g.z() * z);
  }
};

Grid resample(const Stack& stack) {
  Grid grid;
  grid.x = stack.along_row;
  grid.y = stack.along_column;
  grid.z = stack.normal;
  grid.origin = stack.slice_position.front();
  const double depth = stack.normal.dot(stack.slice_position.back() - stack.slice_position.front());
  grid.size = {static_cast<int>((stack.columns - 1) * stack.column_spacing_mm / grid_mm) + 1,
               static_cast<int>((stack.rows - 1) * stack.row_spacing_mm / grid_mm) + 1,
               static_cast<int>(depth / grid_mm) + 1};
  grid.value.assign(static_cast<std::size_t>(grid.size.prod()), 0);
  // In-plane means over the grid's spacing, so that noise and ringing of fine voxels do not vote.
  const int half_c = static_cast<int>(0.5 * grid_mm / stack.column_spacing_mm);
  const int half_r = static_cast<int>(0.5 * grid_mm / stack.row_spacing_mm);
  for (int k = 0; k < grid.size.z(); ++k) {
    for (int j = 0; j < grid.size.y(); ++j) {
      for (int i = 0; i < grid.size.x(); ++i) {
        const auto at = voxel_coordinates(stack, grid.position({double(i), double(j), double(k)}));
        // A plane missing from the stack shows its nearest neighbour here: good enough to find an eye.
        const double slice = at ? at->z() : k * grid_mm / stack.slice_spacing_mm();
        const int c = static_cast<int>(std::lround(i * grid_mm / stack.column_spacing_mm));
        const int r = static_cast<int>(std::lround(j * grid_mm / stack.row_spacing_mm));
        const int s0 = std::clamp(static_cast<int>(slice), 0, stack.slices() - 1),
                  s1 = std::min(s0 + 1, stack.slices() - 1);
        const double w = std::clamp(slice - s0, 0.0, 1.0);
        double sum = 0;
        int count = 0;
        for (int rr = std::max(0, r - half_r); rr <= std::min(stack.rows - 1, r + half_r); ++rr) {
          for (int cc = std::max(0, c - half_c); cc <= std::min(stack.columns - 1, c + half_c); ++cc) {
            sum += (1 - w) * stack.at(cc, rr, s0) + w * stack.at(cc, rr, s1);
            ++count;
          }
        }
        grid.value[grid.index(i, j, k)] = count ? static_cast<float>(sum / count) : 0;
      }
    }
  }
  return grid;
}

struct Peak {
  Vector3d position;
  double votes;
  Contrast contrast;
};

/// Votes of all edges for centres of bright or dark balls.
std::vector<Peak> vote(const Grid& grid) {
  const Vector3i n = grid.size;
  std::vector<double> magnitudes;
  const auto gradient = [&](int i, int j, int k) {
    return Vector3d(grid.value[grid.index(i + 1, j, k)] - grid.value[grid.index(i - 1, j, k)],
                    grid.value[grid.index(i, j + 1, k)] - grid.value[grid.index(i, j - 1, k)],
                    grid.value[grid.index(i, j, k + 1)] - grid.value[grid.index(i, j, k - 1)]);
  };
  for (int k = 1; k + 1 < n.z(); ++k)
    for (int j = 1; j + 1 < n.y(); ++j)
      for (int i = 1; i + 1 < n.x(); ++i) magnitudes.push_back(gradient(i, j, k).norm());
  if (magnitudes.empty()) return {};
  const double strong = quantile(magnitudes, 0.90), weak = quantile(magnitudes, 0.70);
  if (!(strong > 0)) return {};

  std::array<std::vector<float>, 2> votes;  // dark balls (T1), bright balls (T2)
  for (auto& volume : votes) volume.assign(grid.value.size(), 0);
  for (int k = 1; k + 1 < n.z(); ++k) {
    for (int j = 1; j + 1 < n.y(); ++j) {
      for (int i = 1; i + 1 < n.x(); ++i) {
        const Vector3d g = gradient(i, j, k);
        const double magnitude = g.norm();
        if (magnitude < weak) continue;
        const Vector3d towards_bright = g / magnitude;
        const auto weight = static_cast<float>(std::min(magnitude / strong, 1.0));
        for (const int polarity : {0, 1}) {
          for (double radius = smallest_radius_mm; radius <= largest_radius_mm; radius += 1) {
            const Vector3d target =
                Vector3d(i, j, k) + (polarity ? 1 : -1) * radius / grid_mm * towards_bright;
            const Vector3i t = (target.array() + 0.5).floor().cast<int>();
            if ((t.array() < 0).any() || (t.array() >= n.array()).any()) continue;
            votes[polarity][grid.index(t.x(), t.y(), t.z())] += weight;
          }
        }
      }
    }
  }

  std::vector<Peak> peaks;
  for (const int polarity : {0, 1}) {
    // Box means over 5 voxels an axis: votes for one eye spread over about 5 mm.
    std::vector<float> smooth = votes[polarity], line;
    const std::array<std::size_t, 3> stride{1, static_cast<std::size_t>(n.x()),
                                            static_cast<std::size_t>(n.x()) * n.y()};
    for (int axis = 0; axis < 3; ++axis) {
      std::vector<float> next(smooth.size(), 0);
      for (int k = 0; k < n.z(); ++k)
        for (int j = 0; j < n.y(); ++j)
          for (int i = 0; i < n.x(); ++i) {
            const Vector3i at(i, j, k);
            const std::size_t here = grid.index(i, j, k);
            float sum = 0;
            for (int o = -2; o <= 2; ++o) {
              const int c = at[axis] + o;
              if (c >= 0 && c < n[axis])
                sum +=
                    smooth[here + static_cast<std::ptrdiff_t>(o) * static_cast<std::ptrdiff_t>(stride[axis])];
            }
            next[here] = sum;
          }
      smooth = std::move(next);
    }
    std::vector<std::size_t> order(smooth.size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
    const std::size_t top = std::min<std::size_t>(order.size(), 4000);
    std::partial_sort(
        order.begin(), order.begin() + static_cast<std::ptrdiff_t>(top), order.end(),
        [&](std::size_t a, std::size_t b) { return smooth[a] != smooth[b] ? smooth[a] > smooth[b] : a < b; });
    int taken = 0;
    for (std::size_t o = 0; o < top && taken < 10; ++o) {
      const std::size_t at = order[o];
      const int i = static_cast<int>(at % n.x()), j = static_cast<int>(at / n.x() % n.y()),
                k = static_cast<int>(at / n.x() / n.y());
      const Vector3d position = grid.position({double(i), double(j), double(k)});
      const bool known = std::any_of(peaks.begin(), peaks.end(), [&](const Peak& p) {
        return (p.contrast == Contrast::t2) == (polarity == 1) && (p.position - position).norm() < 10;
      });
      if (known) continue;
      peaks.push_back({position, smooth[at], polarity ? Contrast::t2 : Contrast::t1});
      ++taken;
    }
  }
  return peaks;
}

std::vector<Vector3d> directions(int count) {
  std::vector<Vector3d> list;
  for (int i = 0; i < count; ++i) {
    const double z = 1 - (2.0 * i + 1) / count, r = std::sqrt(1 - z * z),
                 angle = i * pi * (3 - std::sqrt(5.0));
    list.push_back({r * std::cos(angle), r * std::sin(angle), z});
  }
  return list;
}

/// Edges of the polarity along rays from the centre: radius of the largest step, or nothing.
struct RadialEdges {
  std::vector<Vector3d> points;
  std::vector<double> steps;
  int inside = 0, outside = 0;
};
RadialEdges radial_edges(const Stack& stack, const Vector3d& centre, Contrast contrast) {
  constexpr double step = 0.4, from = 7.0, to = 16.0;
  const int count = static_cast<int>((to - from) / step) + 1;
  const double sign = contrast == Contrast::t2 ? -1 : 1;
  RadialEdges edges;
  for (const Vector3d& direction : directions(240)) {
    std::vector<double> profile;
    for (int i = 0; i < count; ++i) {
      const auto value = interpolate(stack, centre + (from + i * step) * direction);
      if (!value) break;
      profile.push_back(*value);
    }
    // A ray that leaves the stack before the wall says nothing.
    if (from + static_cast<double>(profile.size()) * step < 13) {
      ++edges.outside;
      continue;
    }
    ++edges.inside;
    double largest = 0;
    int at = -1;
    for (std::size_t i = 3; i + 3 < profile.size(); ++i) {
      const double change = sign * (profile[i + 2] + profile[i + 1] - profile[i - 1] - profile[i - 2]) / 2;
      if (change > largest) {
        largest = change;
        at = static_cast<int>(i);
      }
    }
    if (at < 0) continue;
    // The wall is the first step of at least 70 % of the largest one, not an orbital edge behind it.
    for (int i = 3; i < at; ++i) {
      const double change = sign * (profile[i + 2] + profile[i + 1] - profile[i - 1] - profile[i - 2]) / 2;
      const double next = sign * (profile[i + 3] + profile[i + 2] - profile[i] - profile[i - 1]) / 2;
      if (change >= 0.7 * largest && next <= change) {
        at = i;
        break;
      }
    }
    edges.points.push_back(centre + (from + at * step) * direction);
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
bool refine(const Stack& stack, const Peak& peak, EyeCandidate& candidate) {
  candidate.contrast = peak.contrast;
  candidate.centre = peak.position;
  RadialEdges edges;
  for (int pass = 0; pass < 3; ++pass) {
    edges = radial_edges(stack, candidate.centre, peak.contrast);
    if (!fit_sphere(edges.points, candidate.centre, candidate.radius_mm)) return false;
    if ((candidate.centre - peak.position).norm() > 8) return false;
  }
  if (candidate.radius_mm < smallest_radius_mm || candidate.radius_mm > largest_radius_mm + 1) return false;
  int agreeing = 0;
  std::vector<double> steps, rim;
  for (std::size_t i = 0; i < edges.points.size(); ++i) {
    const Vector3d from_centre = edges.points[i] - candidate.centre;
    const double distance = from_centre.norm();
    if (std::abs(distance - candidate.radius_mm) > 1.2) continue;
    ++agreeing;
    steps.push_back(edges.steps[i]);
    constexpr double within_edge_mm = 2;
    if (const auto value = interpolate(stack, edges.points[i] - within_edge_mm / distance * from_centre))
      rim.push_back(*value);
  }
  candidate.agreement = edges.inside > 0 ? static_cast<double>(agreeing) / edges.inside : 0;
  candidate.inside = static_cast<double>(edges.inside) / (edges.inside + edges.outside);

  std::vector<double> core;
  for_each_voxel_near(stack, candidate.centre, 5,
                      [&](int c, int r, int s, const Vector3d&) { core.push_back(stack.at(c, r, s)); });
  if (core.size() < 20) return false;
  const double spread = std::max(quantile(core, 0.84) - quantile(core, 0.16), 1e-9) / 2;
  candidate.contrast_to_spread = quantile(steps, 0.5) / spread;
  // A globe is as bright within its edge as in its middle; the fat around it, in T1 a bright ball against
  // bone and air, is not.
  return std::abs(quantile(rim, 0.5) - quantile(core, 0.5)) < 0.5 * quantile(steps, 0.5);
}

}  // namespace

std::vector<EyeCandidate> find_candidates(const Stack& stack) {
  std::vector<EyeCandidate> candidates;
  if (stack.slices() < 3) return candidates;
  for (const Peak& peak : vote(resample(stack))) {
    EyeCandidate candidate;
    if (!refine(stack, peak, candidate)) continue;
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

Gaze find_gaze(const std::vector<GlobeInStack>& views, double globe_radius_mm, Contrast contrast) {
  const double size = globe_radius_mm / 11.4;
  const double sign = contrast == Contrast::t2 ? 1 : -1;
  // Mean over a disc across the axis, at a distance from the globe's centre.
  const auto disc = [&](const GlobeInStack& view, const Vector3d& axis, double distance, double radius) {
    const Vector3d u = axis.unitOrthogonal(), v = axis.cross(u);
    double sum = 0;
    int count = 0;
    for (int i = 0; i < 19; ++i) {
      const double r = i == 0 ? 0 : (i <= 6 ? 0.5 : 1.0), angle = i <= 6 ? i * pi / 3 : i * pi / 6;
      const auto value = interpolate(
          *view.stack,
          view.centre + size * (distance * axis + radius * r * (std::cos(angle) * u + std::sin(angle) * v)));
      if (value) {
        sum += *value;
        ++count;
      }
    }
    return count > 0 ? sum / count : 0;
  };
  const Vector3d ahead = -Vector3d::UnitY();
  std::vector<double> units;
  for (const GlobeInStack& view : views) {
    const double vitreous = disc(view, ahead, 2.0, 4.0);
    units.push_back(contrast == Contrast::t2 ? vitreous : std::max(disc(view, -ahead, 13.5, 8), vitreous));
  }
  // Of the lens against what lies behind it and before it, with all of them moved along the axis.
  struct Contrasts {
    double behind, before;
  };
  const auto contrasts = [&](const Vector3d& axis, double farther) {
    Contrasts sum{0, 0};
    for (std::size_t i = 0; i < views.size(); ++i) {
      const auto disc_at = [&](double distance, double radius) {
        return disc(views[i], axis, distance + farther, radius);
      };
      const double lens = (disc_at(6.6, 2.5) + disc_at(7.4, 2.5) + disc_at(8.2, 2.0)) / 3;
      const double per_view = sign / std::max(units[i], 1e-9) / static_cast<double>(views.size());
      sum.behind += per_view * (disc_at(3.5, 3.5) - lens);
      sum.before += per_view * (disc_at(10.4, 1.5) - lens);
    }
    return sum;
  };
  const auto usual = [&](const Vector3d& axis) {
    const Contrasts at = contrasts(axis, 0);
    return (at.behind + at.before) / 2;  // the front may have been cut off
  };
  const auto displaced = [&](const Vector3d& axis) {
    double best = -1e9;
    for (const double farther : {-2, -1, 0, 1, 2}) {
      const Contrasts at = contrasts(axis, farther);
      best = std::max(best, std::min(at.behind, at.before));
    }
    return best;
  };
  const auto direction = [](double h, double v) {
    return Vector3d(std::sin(h * degree) * std::cos(v * degree), -std::cos(h * degree) * std::cos(v * degree),
                    std::sin(v * degree));
  };
  struct Found {
    Vector3d axis;
    double score;
  };
  const auto search = [&](const std::function<double(const Vector3d&)>& score) {
    double best_h = 0, best_v = 0, best = -1e9;
    const auto about = [&](double centre_h, double centre_v, double reach, double step) {
      for (double h = centre_h - reach; h <= centre_h + reach + 1e-9; h += step) {
        for (double v = centre_v - reach; v <= centre_v + reach + 1e-9; v += step) {
          if (std::hypot(h, v) > 60) continue;
          const double s = score(direction(h, v));
          if (s > best) {
            best = s;
            best_h = h;
            best_v = v;
          }
        }
      }
    };
    about(0, 0, 56, 4);
    about(best_h, best_v, 3, 1);
    return Found{direction(best_h, best_v), best};
  };
  const Found found = search(usual);
  Gaze gaze{found.axis, found.score, {}};
  if (contrast == Contrast::t1) {
    const Vector3d other = search(displaced).axis;
    if (other.dot(found.axis) < std::cos(10 * degree)) gaze.other_axis = other;
  }
  return gaze;
}

}  // namespace emmetrope::segmentation
