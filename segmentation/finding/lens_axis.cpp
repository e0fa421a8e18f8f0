#include "segmentation/finding/lens_axis.hpp"

#include <algorithm>
#include <cmath>

#include "pipeline/base/even_points.hpp"
#include "pipeline/base/frames.hpp"
#include "segmentation/finding/blanked_region.hpp"
#include "segmentation/finding/sampling.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;

constexpr double usual_globe_radius_mm = 11.4;
constexpr double farthest_gaze_deg = 60;  ///< from straight ahead

/// The direction h degrees to the left and v degrees up from straight ahead, of a head with these axes.
Vector3d direction_at(const Eigen::Matrix3d& axes, double h, double v) { return axes * gaze_axis(h, v); }

/// Mean over a disc across an axis.
/// \param scale  of the globe, by which distance and radius are multiplied
double disc_mean(const GlobeInStack& view, double scale, const Vector3d& axis, double distance,
                 double radius) {
  const auto [u, v] = across(*view.stack, axis);
  const Sampler sampler(*view.stack);
  double sum = 0;
  int count = 0;
  for (int i = 0; i < 19; ++i) {
    const double r = i == 0 ? 0 : (i <= 6 ? 0.5 : 1.0), angle = i <= 6 ? i * pi / 3 : i * pi / 6;
    const auto value = sampler.interpolate(
        view.centre + scale * (distance * axis + radius * r * (std::cos(angle) * u + std::sin(angle) * v)));
    if (value) {
      sum += *value;
      ++count;
    }
  }
  return count > 0 ? sum / count : 0;
}

/// How well an axis meets the lens: the mean over the views of its contrast, in units of the vitreous (T2) or
/// the surround (T1).
class LensContrast {
 public:
  LensContrast(const std::vector<GlobeInStack>& views, double globe_radius_mm, Weighting weighting)
      : views_(views),
        scale_(globe_radius_mm / usual_globe_radius_mm),
        sign_(weighting == Weighting::t2 ? 1 : -1) {
    const Vector3d ahead = direction_at(axes_of_voxels(*views.front().stack), 0, 0);
    for (const GlobeInStack& view : views) {
      const double vitreous = disc_mean(view, scale_, ahead, 2.0, 4.0);
      units_.push_back(weighting == Weighting::t2
                           ? vitreous
                           : std::max(disc_mean(view, scale_, -ahead, 13.5, 8), vitreous));
    }
  }

  /// Of a lens in its usual place; the front may have been cut off.
  double usual(const Vector3d& axis) const {
    const Sides at = sides(axis, 0);
    return (at.behind + at.before) / 2;
  }

  /// Of a lens in its usual place against the side that it differs from less; 0 where a stack ends or has a gap there.
  double on_both_sides(const Vector3d& axis) const {
    for (const GlobeInStack& view : views_) {
      const Sampler sampler(*view.stack);
      for (double mm = 2; mm <= 12; mm += 0.5)
        if (!sampler.interpolate(view.centre + scale_ * mm * axis)) return 0;
    }
    const Sides at = sides(axis, 0);
    return std::min(at.behind, at.before);
  }

  /// The best of lenses up to 2 mm nearer or farther.
  double displaced(const Vector3d& axis) const {
    double best = -1e9;
    for (const double farther : {-2, -1, 0, 1, 2}) {
      const Sides at = sides(axis, farther);
      best = std::max(best, std::min(at.behind, at.before));
    }
    return best;
  }

 private:
  /// Against what lies behind the lens and before it.
  struct Sides {
    double behind, before;
  };
  /// \param farther  by how much all of them are moved along the axis
  Sides sides(const Vector3d& axis, double farther) const {
    Sides sum{0, 0};
    for (std::size_t i = 0; i < views_.size(); ++i) {
      const auto disc_at = [&](double distance, double radius) {
        return disc_mean(views_[i], scale_, axis, distance + farther, radius);
      };
      const double lens = (disc_at(6.6, 2.5) + disc_at(7.4, 2.5) + disc_at(8.2, 2.0)) / 3;
      const double per_view = sign_ / std::max(units_[i], 1e-9) / static_cast<double>(views_.size());
      sum.behind += per_view * (disc_at(3.5, 3.5) - lens);
      sum.before += per_view * (disc_at(10.4, 1.5) - lens);
    }
    return sum;
  }

  const std::vector<GlobeInStack>& views_;
  double scale_, sign_;
  std::vector<double> units_;
};

struct ScoredAxis {
  Vector3d axis;
  double score;
};
/// The best axis on a grid of 4 degrees about straight ahead, refined to 1 degree.
/// \param axes  of the voxels
template <typename Score>
ScoredAxis best_axis(const Eigen::Matrix3d& axes, const Score& score) {
  double best_h = 0, best_v = 0, best = -1e9;
  const auto search_about = [&](double centre_h, double centre_v, double reach, double step) {
    for (double h = centre_h - reach; h <= centre_h + reach + 1e-9; h += step) {
      for (double v = centre_v - reach; v <= centre_v + reach + 1e-9; v += step) {
        if (std::hypot(h, v) > farthest_gaze_deg) continue;
        const double s = score(direction_at(axes, h, v));
        if (s > best) {
          best = s;
          best_h = h;
          best_v = v;
        }
      }
    }
  };
  search_about(0, 0, 56, 4);
  search_about(best_h, best_v, 3, 1);
  return {direction_at(axes, best_h, best_v), best};
}

bool is_front_blanked(const std::vector<GlobeInStack>& views) {
  return std::all_of(views.begin(), views.end(), [](const GlobeInStack& view) {
    constexpr double reach_mm = 20;
    return BlankedRegion(*view.stack, view.centre, reach_mm)
        .holds_front(*view.stack, view.centre, direction_at(axes_of_voxels(*view.stack), 0, 0));
  });
}

}  // namespace

double from_ahead_deg(const Vector3d& axis_lps) {
  return std::acos(std::clamp(-axis_lps.y(), -1.0, 1.0)) / degree;
}

LensAxis find_lens_axis(const std::vector<GlobeInStack>& views, double globe_radius_mm, Weighting weighting) {
  const Eigen::Matrix3d axes = axes_of_voxels(*views.front().stack);
  if (is_front_blanked(views)) return {direction_at(axes, 0, 0), 0};
  const LensContrast contrast(views, globe_radius_mm, weighting);
  const ScoredAxis usual = best_axis(axes, [&](const Vector3d& axis) { return contrast.usual(axis); });
  LensAxis found{usual.axis, usual.score};
  if (weighting == Weighting::t1) {
    const Vector3d other =
        best_axis(axes, [&](const Vector3d& axis) { return contrast.displaced(axis); }).axis;
    if (other.dot(found.axis) < std::cos(10 * degree)) found.other_axis = other;
  }
  return found;
}

std::optional<Vector3d> find_lens_elsewhere(const std::vector<GlobeInStack>& views, double globe_radius_mm,
                                            Weighting weighting) {
  if (is_front_blanked(views)) return std::nullopt;
  constexpr int count = 2000;  // about, 4.5 degrees apart
  constexpr double same_lens_deg = 45, least_contrast = 0.2, least_ratio = 2;
  const LensContrast contrast(views, globe_radius_mm, weighting);
  std::vector<ScoredAxis> axes;
  for (const Vector3d& axis : mirrored_directions(count))
    axes.push_back({axis, contrast.on_both_sides(axis)});
  const auto is_less = [](const ScoredAxis& a, const ScoredAxis& b) { return a.score < b.score; };
  const ScoredAxis best = *std::max_element(axes.begin(), axes.end(), is_less);
  if (from_ahead_deg(best.axis) < farthest_gaze_deg) return std::nullopt;
  double elsewhere = 0;
  for (const ScoredAxis& other : axes)
    if (other.axis.dot(best.axis) < std::cos(same_lens_deg * degree))
      elsewhere = std::max(elsewhere, other.score);
  if (best.score < std::max(least_contrast, least_ratio * elsewhere)) return std::nullopt;
  return best.axis;
}

}  // namespace emmetrope::segmentation
