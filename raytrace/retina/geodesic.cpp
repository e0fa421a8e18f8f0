#include "raytrace/retina/geodesic.hpp"

#include <cmath>
#include <vector>

namespace emmetrope::raytrace {
namespace {

using Chain = std::vector<RetinaPoint>;

/// The retina as its points are seen from its centre.
class SeenFromCentre {
 public:
  explicit SeenFromCentre(const EyeModel& eye) : eye_(eye), centre_(retina_centre(eye)) {}
  std::optional<RetinaPoint> towards(const Eigen::Vector3d& place) const {
    return meet_retina(eye_, Ray{centre_, (place - centre_).normalized()});
  }

 private:
  const EyeModel& eye_;
  Eigen::Vector3d centre_;
};

/// A point between each two.
std::optional<Chain> halved(const SeenFromCentre& retina, const Chain& chain) {
  Chain finer{chain.front()};
  for (std::size_t k = 1; k < chain.size(); ++k) {
    const auto between = retina.towards((chain[k - 1].position_mm + chain[k].position_mm) / 2);
    if (!between) return std::nullopt;
    finer.push_back(*between);
    finer.push_back(chain[k]);
  }
  return finer;
}

/// Moves each point to the middle of its neighbours, along the surface.
/// \return the farthest that one moved, mm; nothing beyond the retina
std::optional<double> pull(const SeenFromCentre& retina, Chain& chain) {
  double farthest_mm = 0;
  for (std::size_t k = 1; k + 1 < chain.size(); ++k) {
    RetinaPoint& point = chain[k];
    const Eigen::Vector3d to_middle =
        (chain[k - 1].position_mm + chain[k + 1].position_mm) / 2 - point.position_mm;
    const Eigen::Vector3d along = to_middle - point.normal.dot(to_middle) * point.normal;
    const auto moved = retina.towards(point.position_mm + along);
    if (!moved) return std::nullopt;
    farthest_mm = std::max(farthest_mm, (moved->position_mm - point.position_mm).norm());
    point = *moved;
  }
  return farthest_mm;
}

/// Of the arc of a circle with these ends and normals.
double arc_mm(const RetinaPoint& a, const RetinaPoint& b) {
  const double half_angle = std::atan2(a.normal.cross(b.normal).norm(), a.normal.dot(b.normal)) / 2;
  const double chord_mm = (b.position_mm - a.position_mm).norm();
  return half_angle > 1e-6 ? chord_mm * half_angle / std::sin(half_angle) : chord_mm;
}

}  // namespace

std::optional<double> geodesic_mm(const EyeModel& eye, const Eigen::Vector3d& from,
                                  const Eigen::Vector3d& to) {
  constexpr int halvings = 5, most_pulls = 200;
  constexpr double tight_mm = 1e-5;
  if ((from - to).norm() == 0) return 0;
  const SeenFromCentre retina(eye);
  const auto first = retina.towards(from), last = retina.towards(to);
  if (!first || !last) return std::nullopt;
  Chain chain{*first, *last};
  for (int halving = 0; halving < halvings; ++halving) {
    const auto finer = halved(retina, chain);
    if (!finer) return std::nullopt;
    chain = *finer;
    std::optional<double> moved_mm = tight_mm;
    for (int k = 0; k < most_pulls && moved_mm && *moved_mm >= tight_mm; ++k) moved_mm = pull(retina, chain);
    if (!moved_mm) return std::nullopt;
  }
  double sum_mm = 0;
  for (std::size_t k = 1; k < chain.size(); ++k) sum_mm += arc_mm(chain[k - 1], chain[k]);
  return sum_mm;
}

}  // namespace emmetrope::raytrace
