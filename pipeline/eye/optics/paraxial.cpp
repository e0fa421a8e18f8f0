#include "pipeline/eye/optics/paraxial.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "pipeline/base/error.hpp"
#include "pipeline/eye/optics/exact_trace.hpp"
#include "pipeline/eye/optics/retina_point.hpp"
#include "pipeline/eye/optics/stop_crossing.hpp"

namespace emmetrope {
namespace {

// Paraxial rays as (y, p) in two meridians, p = n dy/d(depth): 4 x 4 matrices of 2 x 2 blocks [A B; C D].
using Matrix4 = Eigen::Matrix4d;

Matrix4 blocks(const Eigen::Matrix2d& a, const Eigen::Matrix2d& b, const Eigen::Matrix2d& c,
               const Eigen::Matrix2d& d) {
  Matrix4 m;
  m << a, b, c, d;
  return m;
}

Matrix4 scalar_blocks(double a, double b, double c, double d) {
  const Eigen::Matrix2d one = Eigen::Matrix2d::Identity();
  return blocks(a * one, b * one, c * one, d * one);
}

Matrix4 shift(double reduced_mm) { return scalar_blocks(1, reduced_mm, 0, 1); }

/// One eye at one wavelength, along its axis; tilts and decentres are of second order there.
class AxialSystem {
 public:
  AxialSystem(const EyeModel& eye, double wavelength_nm, bool mean_curvatures)
      : eye_(eye), wavelength_nm_(wavelength_nm), mean_(mean_curvatures) {}

  /// Index of the medium behind surface `owner` (-1: air) at a depth behind its front vertex.
  double index(int owner, double depth_mm) const {
    if (owner < 0) return 1;
    return eye_.medium(eye_.surfaces[owner].medium_after)
        .index_at(depth_mm, 0, wavelength_nm_, eye_.reference_wavelength_nm);
  }

  /// Along the axis from one depth to another in the medium behind surface `owner`.
  Matrix4 travel(int owner, double from_mm, double to_mm) const {
    if (owner >= 0) {
      const Medium& medium = eye_.medium(eye_.surfaces[owner].medium_after);
      if (medium.gradient) return travel_gradient(owner, *medium.gradient, from_mm, to_mm);
    }
    return shift((to_mm - from_mm) / index(owner, 0));
  }

  Matrix4 refraction(int surface, int owner_before) const {
    const Surface& s = eye_.surfaces[surface];
    const double before =
        index(owner_before, owner_before < 0 ? 0 : s.position_mm - eye_.surfaces[owner_before].position_mm);
    Eigen::Matrix2d curvature = s.shape->vertex_curvature();
    if (mean_) curvature = curvature.trace() / 2 * Eigen::Matrix2d::Identity();
    const Eigen::Matrix2d one = Eigen::Matrix2d::Identity();
    return blocks(one, Eigen::Matrix2d::Zero(), -(index(surface, 0) - before) * curvature, one);
  }

  /// From `start_mm`, in air before the first surface, to `end_mm` behind the surfaces that lie before index
  /// `end`.
  Matrix4 from_air(double start_mm, int end, double end_mm) const {
    Matrix4 m = Matrix4::Identity();
    int owner = -1;
    double at = start_mm;
    for (int k = 0; k < end; ++k) {
      const Surface& s = eye_.surfaces[k];
      if (s.is_stop()) continue;
      m = refraction(k, owner) * travel(owner, at, s.position_mm) * m;
      owner = k;
      at = s.position_mm;
    }
    return travel(owner, at, end_mm) * m;
  }

  /// From a stop-like plane at `start_mm` before surface `begin` to the vertex of the last refracting
  /// surface.
  Matrix4 to_last(int begin, double start_mm) const {
    Matrix4 m = Matrix4::Identity();
    int owner = owner_before(begin);
    double at = start_mm;
    for (int k = begin; k <= last(); ++k) {
      const Surface& s = eye_.surfaces[k];
      if (s.is_stop()) continue;
      m = refraction(k, owner) * travel(owner, at, s.position_mm) * m;
      owner = k;
      at = s.position_mm;
    }
    return m;
  }

  int owner_before(int surface) const {
    int k = surface - 1;
    while (k >= 0 && eye_.surfaces[k].is_stop()) --k;
    return k;
  }
  int first() const {
    int k = 0;
    while (eye_.surfaces[k].is_stop()) ++k;
    return k;
  }
  /// The last refracting surface, in front of the retina.
  int last() const { return owner_before(static_cast<int>(eye_.surfaces.size()) - 1); }
  double position(int surface) const { return eye_.surfaces[surface].position_mm; }

 private:
  /// y' = p / n0, p' = 2 n2 y with n = n0(t) + n2(t) r^2, by RK4.
  Matrix4 travel_gradient(int owner, const GradientIndex& gradient, double from_mm, double to_mm) const {
    const double front = position(owner);
    const double dispersion = index(owner, 0) - gradient.index(0, 0);
    const auto rate = [&](double depth, const Eigen::Matrix2d& m) {
      double n0 = dispersion, n2 = 0;
      for (const GradientIndex::Term& term : gradient.terms) {
        const double value = term.coefficient * std::pow(depth - front, term.depth_power);
        if (term.radius_power == 0) n0 += value;
        if (term.radius_power == 2) n2 += value;
      }
      Eigen::Matrix2d result;
      result.row(0) = m.row(1) / n0;
      result.row(1) = 2 * n2 * m.row(0);
      return result;
    };
    constexpr int steps = 400;
    const double h = (to_mm - from_mm) / steps;
    Eigen::Matrix2d m = Eigen::Matrix2d::Identity();
    for (int k = 0; k < steps; ++k) {
      const double depth = from_mm + k * h;
      const Eigen::Matrix2d k1 = rate(depth, m), k2 = rate(depth + h / 2, m + h / 2 * k1);
      const Eigen::Matrix2d k3 = rate(depth + h / 2, m + h / 2 * k2), k4 = rate(depth + h, m + h * k3);
      m += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
    }
    return scalar_blocks(m(0, 0), m(0, 1), m(1, 0), m(1, 1));
  }

  const EyeModel& eye_;
  double wavelength_nm_;
  bool mean_;
};

/// Where the stop stands: its index in the list, depth and diameter.
struct StopPlace {
  int surface;
  double position_mm, diameter_mm;
};

StopPlace stop_place(const EyeModel& eye) {
  for (std::size_t k = 0; k < eye.surfaces.size(); ++k)
    if (eye.surfaces[k].is_stop())
      return {static_cast<int>(k), eye.surfaces[k].position_mm, eye.surfaces[k].stop_diameter_mm};
  for (std::size_t k = 0; k < eye.surfaces.size(); ++k)
    if (eye.surfaces[k].name == "lens_anterior")
      return {static_cast<int>(k), eye.surfaces[k].position_mm,
              eye.surfaces[k].semi_diameter_mm > 0 ? 2 * eye.surfaces[k].semi_diameter_mm
                                                   : std::numeric_limits<double>::quiet_NaN()};
  return {0, eye.surfaces.front().position_mm, std::numeric_limits<double>::quiet_NaN()};
}

bool is_centred(const EyeModel& eye) {
  for (const Surface& s : eye.surfaces)
    if (!(s.decentre_mm.isZero(0) && s.tilt_deg.isZero(0))) return false;
  return true;
}

/// Exact rays near the pole's line of sight: their slopes against their places in the plane of the corneal
/// vertex, across that line.
PowerVector parabasal_refraction(const EyeModel& eye, double wavelength_nm) {
  const ExactTracer tracer(without_stop(eye), wavelength_nm);
  const std::optional<RetinaPoint> pole = meet_retina(eye, {0, 0});
  if (!pole) throw no_result_error("eye '" + eye.name + "': the axis does not meet the retina");
  const Eigen::Vector3d start = pole->position_mm;
  Eigen::Vector2d chief(0, 0);  // its slope in the eye
  if (eye.stop() != nullptr) {
    const double aim_z_mm = aim_plane_z_mm(eye, wavelength_nm);
    const auto centre = aim_at_stop_centre(StopCrossing(eye, wavelength_nm), start, aim_z_mm);
    if (!centre) throw no_result_error("eye '" + eye.name + "': its line of sight does not leave it");
    chief = (centre->aim_mm - start.head<2>()) / (aim_z_mm - start.z());
  }
  const auto leaving = [&](double angle_x, double angle_y) {
    ExactTracer::End end =
        tracer.trace_end({start, Eigen::Vector3d(chief.x() + angle_x, chief.y() + angle_y, 1).normalized()});
    if (end.state != RayState::reached || end.direction.z() <= 0)
      throw no_result_error("eye '" + eye.name + "': its line of sight does not leave it");
    return end;
  };
  const ExactTracer::End base = leaving(0, 0);
  const Eigen::Vector3d centre =
      base.position_mm - base.position_mm.z() / base.direction.z() * base.direction;
  const Eigen::Vector3d x = Eigen::Vector3d::UnitY().cross(base.direction).normalized(),
                        y = base.direction.cross(x);
  Eigen::Matrix2d place, slope;
  constexpr double angle = 1e-4;
  for (int k = 0; k < 2; ++k)
    for (const int sign : {1, -1}) {
      const ExactTracer::End end = leaving(k == 0 ? sign * angle : 0, k == 1 ? sign * angle : 0);
      const double distance =
          (centre - end.position_mm).dot(base.direction) / end.direction.dot(base.direction);
      const Eigen::Vector3d offset = end.position_mm + distance * end.direction - centre;
      if (sign > 0) {
        place.col(k).setZero();
        slope.col(k).setZero();
      }
      place.col(k) += sign * Eigen::Vector2d(offset.dot(x), offset.dot(y));
      slope.col(k) += sign * Eigen::Vector2d(end.direction.dot(x), end.direction.dot(y));
    }
  return power_from_vergence(slope * place.inverse());
}

}  // namespace

PowerVector power_from_vergence(const Eigen::Matrix2d& vergence_per_mm) {
  return {500 * (vergence_per_mm(0, 0) + vergence_per_mm(1, 1)),
          500 * (vergence_per_mm(0, 0) - vergence_per_mm(1, 1)),
          500 * (vergence_per_mm(0, 1) + vergence_per_mm(1, 0))};
}

CardinalPoints cardinal_points(const EyeModel& eye, double wavelength_nm) {
  const AxialSystem system(eye, wavelength_nm, true);
  const double start = system.position(system.first()), end = system.position(system.last());
  const Matrix4 m = system.to_last(0, start);
  const double a = m(0, 0), c = m(2, 0), d = m(2, 2);
  const double n_image = system.index(system.last(), 0);
  CardinalPoints points;
  points.power_D = -1000 * c;
  points.object_focal_mm = start + d / c;
  points.object_principal_mm = start + (d - 1) / c;
  points.object_nodal_mm = points.object_focal_mm - n_image / c;
  points.image_focal_mm = end - n_image * a / c;
  points.image_principal_mm = end + n_image * (1 - a) / c;
  points.image_nodal_mm = points.image_focal_mm + 1 / c;
  return points;
}

Pupil entrance_pupil(const EyeModel& eye, double wavelength_nm) {
  const AxialSystem system(eye, wavelength_nm, true);
  const StopPlace stop = stop_place(eye);
  const double start = system.position(system.first());
  const Matrix4 m = system.from_air(start, stop.surface, stop.position_mm);
  return {start + m(0, 2) / m(0, 0), stop.diameter_mm / m(0, 0)};
}

Pupil exit_pupil(const EyeModel& eye, double wavelength_nm) {
  const AxialSystem system(eye, wavelength_nm, true);
  const StopPlace stop = stop_place(eye);
  if (stop.surface > system.last())
    return {stop.position_mm, stop.diameter_mm};  // nothing refracts behind it
  const Matrix4 m = system.to_last(stop.surface, stop.position_mm);
  const double n_image = system.index(system.last(), 0);
  return {system.position(system.last()) - n_image * m(0, 2) / m(2, 2), stop.diameter_mm / m(2, 2)};
}

PowerVector paraxial_refraction(const EyeModel& eye, double wavelength_nm) {
  if (!is_centred(eye)) return parabasal_refraction(eye, wavelength_nm);
  const AxialSystem system(eye, wavelength_nm, false);
  const int retina = static_cast<int>(eye.surfaces.size()) - 1;
  const Matrix4 m = system.from_air(0, retina, eye.axial_length_mm());
  // A y + B p = 0 on the retina for p = -L y: the vergence L that the eye focuses.
  return power_from_vergence(m.topRightCorner<2, 2>().inverse() * m.topLeftCorner<2, 2>());
}

}  // namespace emmetrope
