#include "raytrace/movement/models.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace emmetrope::raytrace {
namespace {

Eigen::Vector2d place(const EyeMoment& moment) {
  return {moment.gaze.horizontal_deg, moment.gaze.vertical_deg};
}

double peak_deg_s(const Movement& movement) {
  double peak = 0;
  const auto& moments = movement.moments();
  for (std::size_t k = 1; k < moments.size(); ++k)
    peak = std::max(peak, (place(moments[k]) - place(moments[k - 1])).norm() /
                              (moments[k].time_s - moments[k - 1].time_s));
  return peak;
}

TEST(MovementModels, SaccadesLieOnTheMainSequence) {
  // Bahill, Clark and Stark 1975, Fig. 1: about 80 degrees a second for 1 degree, 400 to 450 for 10, 550 to 650 for 20.
  EXPECT_NEAR(peak_deg_s(make_movement("saccade:amplitude_deg=1", 1)), 80, 15);
  EXPECT_NEAR(peak_deg_s(make_movement("saccade:amplitude_deg=10", 1)), 425, 35);
  EXPECT_NEAR(peak_deg_s(make_movement("saccade:amplitude_deg=20", 1)), 600, 50);
  const Movement up = make_movement("saccade:amplitude_deg=8,direction_deg=90,duration_s=0.3", 1);
  EXPECT_NEAR((place(up.at(0.3)) - place(up.at(0))).y(), 8, 1e-9);
  EXPECT_NEAR(place(up.at(0.3)).x(), 0, 1e-9);
  EXPECT_EQ(place(up.at(0.05)), place(up.at(0)));
}

TEST(MovementModels, PursuitFollowsAtItsGainAfterItsLatency) {
  const Movement movement =
      make_movement("pursuit:velocity_deg_s=20,gain=0.9,latency_s=0.1,rise_s=0.05,duration_s=2", 1);
  EXPECT_NEAR(place(movement.at(0.1)).x(), 0, 1e-12);
  EXPECT_NEAR(place(movement.at(2)).x() - place(movement.at(1)).x(), 18, 1e-6);
  // A first-order rise ends up its time constant behind.
  EXPECT_NEAR(place(movement.at(2)).x(), 18 * (1.9 - 0.05), 1e-6);
}

TEST(MovementModels, DriftDiffuses) {
  // Mean squared displacement 4 D t in two dimensions; of 400 walks it is known to 5 % (chi2 of 800).
  double sum_arcmin2 = 0;
  for (int seed = 1; seed <= 400; ++seed)
    sum_arcmin2 +=
        place(make_movement("drift:diffusion_arcmin2_s=40,duration_s=0.5", seed).at(0.5)).squaredNorm() *
        3600;
  EXPECT_NEAR(sum_arcmin2 / 400, 4 * 40 * 0.5, 4 * 0.05 * 80);
}

TEST(MovementModels, MicrosaccadesComeAtTheirRateAndStayNearby) {
  const Movement movement = make_movement("microsaccades:amplitude_deg=0.3,rate_hz=1.5,duration_s=200", 5);
  int starts = 0;
  bool moving = false;
  const auto& moments = movement.moments();
  for (std::size_t k = 1; k < moments.size(); ++k) {
    const bool now = (place(moments[k]) - place(moments[k - 1])).norm() > 0;
    starts += now && !moving ? 1 : 0;
    moving = now;
    EXPECT_LT(place(moments[k]).norm(), 1.5);
  }
  // 300 expected; refractory intervals make the count's spread smaller than Poisson's 17.
  EXPECT_NEAR(starts, 300, 52);
}

TEST(MovementModels, FixationComesBackFromWhereDriftLeads) {
  // Drift alone strays by 2 sqrt(D t) = 2.3 degrees in two minutes, rms.
  const Movement movement = make_movement("fixation:duration_s=120", 3);
  for (const EyeMoment& moment : movement.moments()) EXPECT_LT(place(moment).norm(), 1.5);
}

TEST(MovementModels, TheSeedAloneDecides) {
  const auto at_end = [](std::uint64_t seed) { return place(make_movement("fixation", seed).at(2)); };
  EXPECT_EQ(at_end(1), at_end(1));
  EXPECT_NE(at_end(1), at_end(2));
}

}  // namespace
}  // namespace emmetrope::raytrace
