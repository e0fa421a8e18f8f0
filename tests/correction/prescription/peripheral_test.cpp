#include "correction/prescription/peripheral.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <array>
#include <cmath>

#include "correction/search/retinal_sharpness.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/model/eye_model.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"

/// Refraction off the axis against Coddington's equations along the chief ray, in a plane and on spheres.
namespace emmetrope::correction {
namespace {

using Eigen::Vector2d;

constexpr double wavelength_nm = 589.3;

/// A ray in the plane of the axis (z is depth behind the cornea) and the vergences, in 1/mm, of the thin
/// pencil about it.
struct ChiefRay {
  Vector2d at, direction;
  double index, tangential, sagittal;
};

struct SphereSurface {
  double depth_mm, radius_mm;  ///< radius positive where the centre lies deeper
};

double distance_to(const ChiefRay& ray, const SphereSurface& sphere) {
  const Vector2d centre(0, sphere.depth_mm + sphere.radius_mm), from = ray.at - centre;
  const double b = from.dot(ray.direction),
               root = std::sqrt(b * b - from.squaredNorm() + sphere.radius_mm * sphere.radius_mm);
  const auto near_vertex = [&](double t) {
    return std::abs((ray.at + t * ray.direction).y() - sphere.depth_mm);
  };
  return near_vertex(-b - root) < near_vertex(-b + root) ? -b - root : -b + root;
}

void travel(ChiefRay& ray, double distance_mm) {
  ray.at += distance_mm * ray.direction;
  for (double* vergence : {&ray.tangential, &ray.sagittal})
    *vergence /= 1 - distance_mm / ray.index * *vergence;
}

/// Snell's law and Coddington's equations: n' cos^2 i' / t' = n cos^2 i / t + (n' cos i' - n cos i) / R, and
/// the same without squares.
void refract(ChiefRay& ray, const SphereSurface& sphere, double index_after) {
  Vector2d normal = (Vector2d(0, sphere.depth_mm + sphere.radius_mm) - ray.at) / sphere.radius_mm;
  double radius_mm = sphere.radius_mm;
  if (normal.dot(ray.direction) < 0) {  // light travels out of the eye
    normal = -normal;
    radius_mm = -radius_mm;
  }
  const double cosine = normal.dot(ray.direction), ratio = ray.index / index_after;
  const double cosine_after = std::sqrt(1 - ratio * ratio * (1 - cosine * cosine));
  const double power = (index_after * cosine_after - ray.index * cosine) / radius_mm;
  ray.direction = ratio * ray.direction + (cosine_after - ratio * cosine) * normal;
  ray.tangential = (cosine * cosine * ray.tangential + power) / (cosine_after * cosine_after);
  ray.sagittal += power;
  ray.index = index_after;
}

/// Refractions in the plane of the field angle and across it, D, in the entrance pupil.
struct ByCoddington {
  double field_deg, tangential_D, sagittal_D;
};

/// Gullstrand-Emsley's eye; the chief ray is known by its angle in the middle of the stop.
ByCoddington along_chief_ray(const EyeModel& eye, double angle_in_stop_rad) {
  constexpr double water = 4.0 / 3, lens = 1.416;
  const SphereSurface cornea{0, 7.8}, front{3.6, 10}, back{7.2, -6};
  const Surface& last = eye.surfaces.back();
  const SphereSurface retina{last.position_mm, 1 / last.shape->vertex_curvature()(0, 0)};
  // Inwards, to the image on the retina.
  ChiefRay in{{0, 3.6}, {std::sin(angle_in_stop_rad), std::cos(angle_in_stop_rad)}, water, 0, 0};
  refract(in, front, lens);
  travel(in, distance_to(in, back));
  refract(in, back, water);
  travel(in, distance_to(in, retina));
  // Outwards again, as a pencil that diverges from there.
  ChiefRay out{in.at, -in.direction, water, 0, 0};
  const double first_mm = distance_to(out, back);
  out.at += first_mm * out.direction;
  out.tangential = out.sagittal = -water / first_mm;
  refract(out, back, lens);
  travel(out, distance_to(out, front));
  refract(out, front, water);
  travel(out, distance_to(out, cornea));
  refract(out, cornea, 1);
  travel(out, -out.at.x() / out.direction.x());  // back to the axis, where the entrance pupil seems to be
  return {std::atan2(-out.direction.x(), -out.direction.y()) / degree, -1e3 * out.tangential,
          -1e3 * out.sagittal};
}

TEST(PeripheralRefraction, IsCoddingtons) {
  const EyeModel eye = with_pupil(make_eye("gullstrand-emsley"), 0.2);
  const std::vector<FieldPoint> field = peripheral_refraction(eye, wavelength_nm, 20, 3);
  ASSERT_EQ(field.size(), 9U);
  for (const FieldPoint& point : field) {
    const double field_deg = std::atan(std::hypot(std::tan(point.horizontal_deg * degree),
                                                  std::tan(point.vertical_deg * degree))) /
                             degree;
    double low = 1e-4, high = 0.8;
    while (high - low > 1e-9) {
      const double middle = (low + high) / 2;
      (std::abs(along_chief_ray(eye, middle).field_deg) < field_deg ? low : high) = middle;
    }
    const ByCoddington expected = along_chief_ray(eye, low);
    // The meridian of the field angle in the plane across the line of sight, whose x axis stays horizontal.
    const Eigen::Vector3d sight =
        Eigen::Vector3d(std::tan(point.horizontal_deg * degree), std::tan(point.vertical_deg * degree), 1)
            .normalized();
    const Eigen::Vector3d x = Eigen::Vector3d::UnitY().cross(sight).normalized(), y = sight.cross(x);
    const double meridian = std::atan2(-y.z(), -x.z());
    const double half_D = (expected.tangential_D - expected.sagittal_D) / 2;
    EXPECT_NEAR(point.refraction.M_D, (expected.tangential_D + expected.sagittal_D) / 2, 0.02) << field_deg;
    EXPECT_NEAR(point.refraction.J0_D, half_D * std::cos(2 * meridian), 0.02) << field_deg;
    EXPECT_NEAR(point.refraction.J45_D, half_D * std::sin(2 * meridian), 0.02) << field_deg;
    if (field_deg > 20) {
      EXPECT_GT(std::abs(half_D), 0.5);
    }
  }
}

}  // namespace
}  // namespace emmetrope::correction
