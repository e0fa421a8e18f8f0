#pragma once
#include <Eigen/Dense>
#include <cmath>
#include <vector>

#include "pipeline/eye/model/eye_model.hpp"

/// A second tracer for tests, which shares nothing with the program's: rays out of an eye of centred conics, by the
/// quadratic formula.
namespace emmetrope {

struct PlainRay {
  Eigen::Vector3d at, direction;
  double opl_mm = 0;
  Eigen::Vector2d in_stop{0, 0};
};

class PlainEye {
 public:
  PlainEye(const EyeModel& eye, double wavelength_nm) {
    double index = 1;
    for (const Surface& surface : eye.surfaces) {
      if (surface.is_stop()) {
        surfaces_.push_back({surface.position_mm, 0, 0, index, index});
        stop_radius_mm = surface.stop_diameter_mm / 2;
        stop_centre_mm_ = surface.decentre_mm;
        continue;
      }
      const double after =
          surface.medium_after.empty()
              ? index
              : eye.medium(surface.medium_after).index_at(wavelength_nm, eye.reference_wavelength_nm);
      surfaces_.push_back({surface.position_mm, 1 / surface.shape->vertex_curvature()(0, 0),
                           surface.shape->asphericity().x(), index, after});
      index = after;
    }
  }

  /// The retina behind its equator.
  Eigen::Vector3d retina(const Eigen::Vector2d& at) const {
    const PlainSurface& retina = surfaces_.back();
    const double R = retina.radius_mm, p = 1 + retina.q, r2 = at.squaredNorm();
    return {at.x(), at.y(), -retina.depth_mm - r2 / (R * (1 + std::sqrt(1 - p * r2 / (R * R))))};
  }

  PlainRay leave(const Eigen::Vector3d& from, const Eigen::Vector2d& slope) const {
    PlainRay ray{from, Eigen::Vector3d(slope.x(), slope.y(), 1).normalized()};
    for (auto next = std::next(surfaces_.rbegin()); next != surfaces_.rend(); ++next) {
      if (next->radius_mm == 0) {
        const double t = (-next->depth_mm - ray.at.z()) / ray.direction.z();
        ray.in_stop = (ray.at + t * ray.direction).head<2>() - stop_centre_mm_;
        continue;
      }
      refract(ray, *next);
    }
    return ray;
  }

  double stop_radius_mm = 0;

 private:
  struct PlainSurface {
    double depth_mm, radius_mm, q, index_before, index_behind;
  };

  static void refract(PlainRay& ray, const PlainSurface& surface) {
    // x^2 + y^2 + (1 + Q) d^2 - 2 R d = 0 with d = -z - depth.
    const double p = 1 + surface.q, R = surface.radius_mm, d = -ray.at.z() - surface.depth_mm,
                 v = -ray.direction.z();
    const Eigen::Vector2d r = ray.at.head<2>(), u = ray.direction.head<2>();
    const double a = u.squaredNorm() + p * v * v, b = r.dot(u) + p * d * v - R * v,
                 c = r.squaredNorm() + p * d * d - 2 * R * d, root = std::sqrt(b * b - a * c);
    const double first = (-b - root) / a, second = (-b + root) / a;
    const bool plane = std::isinf(R);
    const double t = plane ? -d / v : std::abs(d + first * v) < std::abs(d + second * v) ? first : second;
    ray.at += t * ray.direction;
    ray.opl_mm += t * surface.index_behind;
    const double depth = -ray.at.z() - surface.depth_mm;
    Eigen::Vector3d normal = plane ? Eigen::Vector3d(0, 0, 1)
                                   : Eigen::Vector3d(ray.at.x(), ray.at.y(), R - p * depth).normalized();
    if (normal.dot(ray.direction) < 0) normal = -normal;
    const double ratio = surface.index_behind / surface.index_before, cosine = normal.dot(ray.direction);
    ray.direction = ratio * ray.direction +
                    (std::sqrt(1 - ratio * ratio * (1 - cosine * cosine)) - ratio * cosine) * normal;
  }

  std::vector<PlainSurface> surfaces_;
  Eigen::Vector2d stop_centre_mm_{0, 0};
};

/// One retinal point's light in the plane across its line of sight, which it crosses at a depth.
class PlainPupil {
 public:
  PlainPupil(const PlainEye& eye, const Eigen::Vector2d& at, double plane_depth_mm)
      : eye_(eye), source_(eye.retina(at)), slope_(-source_.head<2>() / (-4.0 - source_.z())) {
    const PlainRay chief = towards({0, 0});
    sight = chief.direction;
    centre_ = chief.at + (-plane_depth_mm - chief.at.z()) / sight.z() * sight;
    x_ = Eigen::Vector3d::UnitY().cross(sight).normalized();
    y_ = sight.cross(x_);
    chief_opl_mm_ = in_plane({0, 0}).opl_mm;
  }

  struct Place {
    Eigen::Vector2d at, slope;
    double opl_mm = 0, wavefront_um = 0;
  };
  Place in_plane(const Eigen::Vector2d& in_stop) const {
    const PlainRay ray = towards(in_stop);
    const double t = (centre_ - ray.at).dot(sight) / ray.direction.dot(sight);
    const Eigen::Vector3d offset = ray.at + t * ray.direction - centre_;
    Place place{
        {offset.dot(x_), offset.dot(y_)}, {ray.direction.dot(x_), ray.direction.dot(y_)}, ray.opl_mm + t};
    place.wavefront_um = 1000 * (chief_opl_mm_ - place.opl_mm);
    return place;
  }
  /// How much of the plane an element of the stop covers.
  double magnification(const Eigen::Vector2d& in_stop) const {
    constexpr double h = 1e-4;
    Eigen::Matrix2d by_stop;
    for (int k = 0; k < 2; ++k) {
      const Eigen::Vector2d step = h * Eigen::Vector2d::Unit(k);
      by_stop.col(k) = (in_plane(in_stop + step).at - in_plane(in_stop - step).at) / (2 * h);
    }
    return std::abs(by_stop.determinant());
  }
  Eigen::Vector2d tangential() const { return Eigen::Vector2d(x_.z(), y_.z()).normalized(); }

  Eigen::Vector3d sight;

 private:
  /// The ray through a place of the stop, by Newton's method on its slope at the retina.
  PlainRay towards(const Eigen::Vector2d& in_stop) const {
    Eigen::Vector2d slope = slope_;
    PlainRay ray = eye_.leave(source_, slope);
    constexpr double h = 1e-6;
    for (int round = 0; round < 20 && (ray.in_stop - in_stop).norm() > 1e-11; ++round) {
      Eigen::Matrix2d by_slope;
      for (int k = 0; k < 2; ++k)
        by_slope.col(k) =
            (eye_.leave(source_, slope + h * Eigen::Vector2d::Unit(k)).in_stop - ray.in_stop) / h;
      slope += by_slope.inverse() * (in_stop - ray.in_stop);
      ray = eye_.leave(source_, slope);
    }
    return ray;
  }

  const PlainEye& eye_;
  Eigen::Vector3d source_;
  Eigen::Vector2d slope_;
  Eigen::Vector3d centre_, x_, y_;
  double chief_opl_mm_ = 0;
};

}  // namespace emmetrope
