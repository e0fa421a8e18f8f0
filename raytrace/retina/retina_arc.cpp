#include "raytrace/retina/retina_arc.hpp"

#include <cmath>

#include "pipeline/base/frames.hpp"

namespace emmetrope::raytrace {
namespace {

/// The retina's section by the half plane of a meridian, by the polar angle about the retina's centre.
class Section {
 public:
  Section(const EyeModel& eye, const Eigen::Vector2d& towards)
      : eye_(eye), centre_(retina_centre(eye)), towards_(towards.normalized()) {}

  std::optional<RetinaPoint> at(double polar_rad) const {
    const Eigen::Vector2d beside = std::sin(polar_rad) * towards_;
    return meet_retina(eye_, Ray{centre_, {beside.x(), beside.y(), -std::cos(polar_rad)}});
  }
  double polar_rad(const Eigen::Vector3d& point) const {
    const Eigen::Vector3d from_centre = point - centre_;
    return std::atan2(from_centre.head<2>().norm(), -from_centre.z());
  }

 private:
  const EyeModel& eye_;
  Eigen::Vector3d centre_;
  Eigen::Vector2d towards_;
};

/// An arc's chord is shorter by (angle)^2 / 24 of itself: 5e-7.
constexpr double chord_rad = 0.2 * degree;

}  // namespace

std::optional<RetinaPoint> retina_at_arc(const EyeModel& eye, const Eigen::Vector2d& from_pole_mm) {
  const double wanted_mm = from_pole_mm.norm();
  if (wanted_mm == 0) return meet_retina(eye, Eigen::Vector2d(0, 0));
  const Section section(eye, from_pole_mm);
  std::optional<RetinaPoint> last = section.at(0);
  double polar_rad = 0;
  for (double sum_mm = 0; last && polar_rad < pi;) {
    const auto next = section.at(polar_rad + chord_rad);
    if (!next) return std::nullopt;
    const double chord_mm = (next->position_mm - last->position_mm).norm();
    if (sum_mm + chord_mm >= wanted_mm)
      return section.at(polar_rad + (wanted_mm - sum_mm) / chord_mm * chord_rad);
    sum_mm += chord_mm;
    polar_rad += chord_rad;
    last = next;
  }
  return std::nullopt;
}

std::optional<double> retina_arc_mm(const EyeModel& eye, const Eigen::Vector3d& point) {
  const Section section(eye,
                        point.head<2>().isZero(0) ? Eigen::Vector2d(1, 0) : Eigen::Vector2d(point.head<2>()));
  const double whole_rad = section.polar_rad(point);
  const int chords = static_cast<int>(std::ceil(whole_rad / chord_rad)) + 1;
  std::optional<RetinaPoint> last = section.at(0);
  double sum_mm = 0;
  for (int k = 1; k <= chords && last; ++k) {
    const auto next = section.at(whole_rad * k / chords);
    if (next) sum_mm += (next->position_mm - last->position_mm).norm();
    last = next;
  }
  if (!last) return std::nullopt;
  return sum_mm;
}

}  // namespace emmetrope::raytrace
