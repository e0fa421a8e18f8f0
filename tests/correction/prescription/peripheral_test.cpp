#include "correction/prescription/peripheral.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <array>
#include <cmath>

#include "correction/search/retinal_sharpness.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/model/eye_model.hpp"
#include "pipeline/eye/optics/paraxial.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "tests/support/random_conic_eye.hpp"

/// Refraction off the axis against Coddington's equations along the chief ray, in a plane and on conics.
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

/// A conic about the axis: r^2 = 2 R d - (1 + Q) d^2, d the depth behind its vertex.
struct ConicSurface {
  double depth_mm, radius_mm, q;  ///< radius positive where the centre lies deeper
};

double distance_to(const ChiefRay& ray, const ConicSurface& conic) {
  const double r = ray.at.x(), d = ray.at.y() - conic.depth_mm, u = ray.direction.x(), v = ray.direction.y(),
               p = 1 + conic.q;
  const double a = u * u + p * v * v, b = r * u + p * d * v - conic.radius_mm * v,
               c = r * r + p * d * d - 2 * conic.radius_mm * d, root = std::sqrt(b * b - a * c);
  const auto from_vertex = [&](double t) { return std::abs(d + t * v); };
  const double first = (-b - root) / a, second = (-b + root) / a;
  return from_vertex(first) < from_vertex(second) ? first : second;
}

void travel(ChiefRay& ray, double distance_mm) {
  ray.at += distance_mm * ray.direction;
  for (double* vergence : {&ray.tangential, &ray.sagittal})
    *vergence /= 1 - distance_mm / ray.index * *vergence;
}

/// Snell's law and Coddington's equations: n' cos^2 i' / t' = n cos^2 i / t + (n' cos i' - n cos i) / R_t, and
/// the same without squares. Of a conic R_s^2 = R^2 - Q r^2 and R_t = R_s^3 / R^2.
void refract(ChiefRay& ray, const ConicSurface& conic, double index_after) {
  const double r = ray.at.x(), d = ray.at.y() - conic.depth_mm, R = conic.radius_mm;
  Vector2d normal = Vector2d(-r, R - (1 + conic.q) * d).normalized() * (R > 0 ? 1 : -1);  // to the centre
  double sagittal_mm = std::copysign(std::sqrt(R * R - conic.q * r * r), R);
  if (normal.dot(ray.direction) < 0) normal = -normal;
  if (ray.direction.y() < 0) sagittal_mm = -sagittal_mm;  // light travels out of the eye
  const double tangential_mm = std::pow(sagittal_mm, 3) / (R * R);
  const double cosine = normal.dot(ray.direction), ratio = ray.index / index_after;
  const double cosine_after = std::sqrt(1 - ratio * ratio * (1 - cosine * cosine));
  const double bend = index_after * cosine_after - ray.index * cosine;
  ray.direction = ratio * ray.direction + (cosine_after - ratio * cosine) * normal;
  ray.tangential = (cosine * cosine * ray.tangential + bend / tangential_mm) / (cosine_after * cosine_after);
  ray.sagittal += bend / sagittal_mm;
  ray.index = index_after;
}

/// Surfaces before and behind the stop with the index behind each, from the cornea to the retina.
struct PlainEye {
  struct Interface {
    ConicSurface conic;
    double index_before, index_after;
  };
  std::vector<Interface> before_stop, behind_stop;
  double stop_mm = 0, entrance_pupil_mm = 0;
};

PlainEye plain(const EyeModel& eye) {
  PlainEye result;
  double index = 1;
  bool behind = false;
  for (const Surface& surface : eye.surfaces) {
    if (surface.is_stop()) {
      behind = true;
      result.stop_mm = surface.position_mm;
      continue;
    }
    const double after = surface.medium_after.empty() ? index : eye.medium(surface.medium_after).index;
    (behind ? result.behind_stop : result.before_stop)
        .push_back({{surface.position_mm, 1 / surface.shape->vertex_curvature()(0, 0),
                     surface.shape->asphericity().x()},
                    index,
                    after});
    index = after;
  }
  result.entrance_pupil_mm = entrance_pupil(eye, eye.reference_wavelength_nm).position_mm;
  return result;
}

/// Refractions in the plane of the field angle and across it, D, in the entrance pupil.
struct ByCoddington {
  double field_deg, tangential_D, sagittal_D;
};

/// The chief ray is known by its angle in the middle of the stop.
ByCoddington along_chief_ray(const PlainEye& eye, double angle_in_stop_rad) {
  // Inwards, to the image on the retina.
  const double index = eye.before_stop.back().index_after;
  ChiefRay in{{0, eye.stop_mm}, {std::sin(angle_in_stop_rad), std::cos(angle_in_stop_rad)}, index, 0, 0};
  for (const PlainEye::Interface& next : eye.behind_stop) {
    travel(in, distance_to(in, next.conic));
    if (&next != &eye.behind_stop.back()) refract(in, next.conic, next.index_after);
  }
  // Outwards again, as a pencil that diverges from there.
  ChiefRay out{in.at, -in.direction, in.index, 0, 0};
  bool diverges = false;
  const auto leave = [&](const PlainEye::Interface& next) {
    const double distance_mm = distance_to(out, next.conic);
    if (diverges) {
      travel(out, distance_mm);
    } else {
      out.at += distance_mm * out.direction;
      out.tangential = out.sagittal = -out.index / distance_mm;
      diverges = true;
    }
    refract(out, next.conic, next.index_before);
  };
  for (auto next = std::next(eye.behind_stop.rbegin()); next != eye.behind_stop.rend(); ++next) leave(*next);
  for (auto next = eye.before_stop.rbegin(); next != eye.before_stop.rend(); ++next) leave(*next);
  // To the wavefront's plane, which the line of sight crosses at the depth of the paraxial entrance pupil.
  travel(out, (eye.entrance_pupil_mm - out.at.y()) / out.direction.y());
  return {std::atan2(-out.direction.x(), -out.direction.y()) / degree, -1e3 * out.tangential,
          -1e3 * out.sagittal};
}

class PeripheralRefractionOf : public testing::TestWithParam<int> {};
TEST_P(PeripheralRefractionOf, IsCoddingtonsTo60Degrees) {
  const int seed = GetParam();
  const EyeModel eye = with_pupil(seed == 0 ? make_eye("navarro") : random_conic_eye(seed), 0.2);
  const PlainEye plain_eye = plain(eye);
  const std::vector<FieldPoint> field = peripheral_refraction(eye, eye.reference_wavelength_nm, 60, 9);
  int within_60 = 0;
  for (const FieldPoint& point : field) {
    const double field_deg = std::atan(std::hypot(std::tan(point.horizontal_deg * degree),
                                                  std::tan(point.vertical_deg * degree))) /
                             degree;
    if (field_deg > 60.001) continue;
    ++within_60;
    double low = 1e-6, high = 1;
    while (high - low > 1e-12) {
      const double middle = (low + high) / 2;
      (std::abs(along_chief_ray(plain_eye, middle).field_deg) < field_deg ? low : high) = middle;
    }
    const ByCoddington expected = along_chief_ray(plain_eye, low);
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
  }
  EXPECT_EQ(within_60, 53);  // of 81 directions in steps of 15 degrees
}
INSTANTIATE_TEST_SUITE_P(NavarroAndRandom, PeripheralRefractionOf, testing::Range(0, 4));

// At 31 mm the corners of a grid of 20 degrees lie beyond a retina of 12 mm.
TEST(PeripheralRefraction, LeavesOutWhatTheRetinaDoesNotSee) {
  EyeModel eye = with_pupil(make_eye("navarro"), 3);
  eye.surface("retina").position_mm = 31;
  const std::vector<FieldPoint> field = peripheral_refraction(eye, wavelength_nm, 20, 5);
  EXPECT_GT(field.size(), 16U);
  EXPECT_LE(field.size(), 25U);
}

}  // namespace
}  // namespace emmetrope::correction
