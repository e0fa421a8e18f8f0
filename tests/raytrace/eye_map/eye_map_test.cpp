#include "raytrace/eye_map/eye_map.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/optics/exact_trace.hpp"
#include "pipeline/eye/optics/stop_crossing.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "raytrace/retina/pupil_aim.hpp"

namespace emmetrope::raytrace {
namespace {

EyeModel eye_at(const std::string& name, double accommodation_D, double pupil_mm) {
  EyeOptions options;
  options.accommodation_D = accommodation_D;
  options.pupil_mm = pupil_mm;
  return make_eye(name, options);
}

EyeStates states_of(const std::string& name, double largest_D) {
  return {[name](double accommodation_D) { return eye_at(name, accommodation_D, 4); }, largest_D};
}

/// T_n(x) = cos(n arccos x), not by the recurrence that the map is made with.
double chebyshev(int n, double x) { return std::cos(n * std::acos(std::clamp(x, -1.0, 1.0))); }

/// The map's sum as its header says it, term by term.
struct Place {
  double a = 0, w = 0, u = 0, v = 0;
  Eigen::Vector2d p;
};
Eigen::Vector4d ray_of(const EyeMap& map, const Place& at) {
  Eigen::Vector4d sum = Eigen::Vector4d::Zero();
  std::size_t k = 0;
  for (int l = 0; l < map.accommodations; ++l)
    for (int wave = 0; wave < map.waves; ++wave)
      for (int j = 0; j <= EyeMap::field_degree; ++j)
        for (int i = 0; i <= EyeMap::field_degree - j; ++i)
          for (int n = 0; n <= EyeMap::pupil_degree; ++n)
            for (int m = 0; m <= EyeMap::pupil_degree - n; ++m)
              for (int c = 0; c < EyeMap::outputs; ++c)
                sum[c] += map.rays[k++] * chebyshev(l, at.a) * chebyshev(wave, at.w) * chebyshev(i, at.u) *
                          chebyshev(j, at.v) * std::pow(at.p.x(), m) * std::pow(at.p.y(), n);
  return sum;
}

class Random {
 public:
  double operator()(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }

 private:
  std::mt19937_64 random_{42};
};

TEST(EyeMap, IsTheExactRayFromThePlaceInTheStopThatItNames) {
  EyeMapSettings settings;
  settings.threads = 2;
  Random random;
  for (const auto& [name, largest_D] :
       {std::pair{"navarro", 8.0}, {"liou-brennan", 0.0}, {"atchison:-4", 0.0}}) {
    const EyeMap map = make_eye_map(states_of(name, largest_D), settings);
    EXPECT_LE(map.direction_rms_arcmin, 0.01) << map.note();
    for (int round = 0; round < 40; ++round) {
      const double nm = random(400, 690), accommodation_D = random(0, largest_D), pupil_mm = random(1, 6);
      // A narrower stop's centre and rim, aimed at by the search of the wavefront's chief rays.
      const EyeModel eye = eye_at(name, accommodation_D, pupil_mm);
      const Eigen::Vector2d field(random(-2.9, 2.9), random(-2.9, 2.9));
      const Eigen::Vector3d retina = retina_point(eye, field.x(), field.y()).position_mm;
      const double plane_z_mm = aim_plane_z_mm(eye, nm);
      const StopCrossing crossing(eye, nm);
      const auto aim = aim_at_stop_centre(crossing, retina, plane_z_mm);
      ASSERT_TRUE(aim);
      const double angle = random(0, 2 * pi), share = round % 2 == 0 ? 0 : 0.9;
      const Eigen::Vector2d beside =
          aim->aim_mm +
          aim->aim_from_stop * (share * pupil_mm / 2 * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
      const Eigen::Vector3d target(beside.x(), beside.y(), plane_z_mm);
      const auto stop_mm = crossing(retina, target);
      ASSERT_TRUE(stop_mm);
      const auto end = ExactTracer(eye, nm).trace_end({retina, (target - retina).normalized()});
      ASSERT_EQ(end.state, RayState::reached);

      const auto inverse_square = [](double wavelength_nm) { return std::pow(wavelength_nm, -2); };
      Place at;
      at.a = largest_D > 0 ? 2 * accommodation_D / largest_D - 1 : 0;
      at.w = 2 * (inverse_square(nm) - inverse_square(map.longest_nm)) /
                 (inverse_square(map.shortest_nm) - inverse_square(map.longest_nm)) -
             1;
      at.u = 2 * field.x() / map.field_mm;
      at.v = 2 * field.y() / map.field_mm;
      at.p = *stop_mm / (map.pupil_mm / 2);
      const Eigen::Vector4d ray = ray_of(map, at);
      const Eigen::Vector3d found = Eigen::Vector3d(ray[2], ray[3], 1).normalized();
      EXPECT_LT(found.cross(end.direction).norm() / degree * 60, 0.05) << name << ", " << nm << " nm";
      const Eigen::Vector3d offset = Eigen::Vector3d(ray[0], ray[1], 0) - end.position_mm;
      EXPECT_LT((offset - offset.dot(end.direction) * end.direction).norm(), 0.001) << name;
    }
  }
}

TEST(EyeMap, LightIsSharedAsTheRetinaSeesTheStop) {
  // Shares of parts of a whole: 1 on average over the disc. Their course shows in pictures (living_test.cpp).
  const EyeMap map = make_eye_map(states_of("navarro", 0), {});
  ASSERT_EQ(map.weights.size(), 36U);  // 6 terms of the field, 6 of the pupil
  double mean = 0;
  constexpr int steps = 40;
  int count = 0;
  for (int i = 0; i < steps; ++i)
    for (int j = 0; j < steps; ++j) {
      const double x = 2 * (i + 0.5) / steps - 1, y = 2 * (j + 0.5) / steps - 1;
      if (x * x + y * y > 1) continue;
      mean += map.weights[0] + map.weights[1] * x + map.weights[2] * x * x + map.weights[3] * y +
              map.weights[4] * x * y + map.weights[5] * y * y;
      ++count;
    }
  EXPECT_NEAR(mean / count, 1, 0.02);
}

TEST(EyeMap, PathsMeetTheSurfaces) {
  const EyeMap map = make_eye_map(states_of("navarro", 0), {});
  const EyeModel eye = eye_at("navarro", 0, 4);
  ASSERT_EQ(map.surfaces, (std::vector<std::string>{"lens_posterior", "lens_anterior", "stop",
                                                    "cornea_posterior", "cornea_anterior"}));
  // The ray along the axis through the middle of the stop meets each vertex: the constant terms less what Chebyshev
  // polynomials of even degree are at 0 (T_2(0) = -1).
  const int terms = EyeMap::terms(EyeMap::path_degree), fields = terms;
  for (std::size_t s = 0; s < map.surfaces.size(); ++s) {
    const auto z_of = [&](int field) { return map.paths[((s * fields + field) * terms) * 3 + 2]; };
    const double z = z_of(0) - z_of(2) - z_of(7);  // 1, T_2(u), T_2(v)
    const double vertex =
        map.surfaces[s] == "stop" ? eye.stop()->position_mm : eye.surface(map.surfaces[s]).position_mm;
    EXPECT_NEAR(z, -vertex, 0.01) << map.surfaces[s];
  }
}

TEST(EyeMap, RefusesWhatItCannotFollow) {
  EyeMapSettings settings;
  settings.field_mm = 22;
  EXPECT_THROW(make_eye_map(states_of("navarro", 0), settings), Error);
  EyeModel without = eye_at("navarro", 0, 4);
  without.surfaces.erase(std::find_if(without.surfaces.begin(), without.surfaces.end(),
                                      [](const Surface& surface) { return surface.is_stop(); }));
  EXPECT_THROW(make_eye_map({[&](double) { return without; }, 0}, {}), Error);
}

}  // namespace
}  // namespace emmetrope::raytrace
