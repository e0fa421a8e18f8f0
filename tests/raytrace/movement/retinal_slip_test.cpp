#include "raytrace/movement/retinal_slip.hpp"

#include <gtest/gtest.h>

#include "pipeline/base/frames.hpp"
#include "pipeline/eye/optics/paraxial.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "tests/support/plain_eye.hpp"

namespace emmetrope::raytrace {
namespace {

/// Through straight ahead, from `from` to the other side within a tenth of a second.
Movement turning(const Gaze& from) {
  EyeMoment first, last;
  first.gaze = from;
  last.time_s = 0.1;
  last.gaze = {-from.horizontal_deg, -from.vertical_deg};
  return {"turn", {first, last}};
}

TEST(RetinalSlip, IsTheGazesTurnTimesTheNodalDistance) {
  const EyeModel eye = make_eye("navarro");
  const auto slip = retinal_slip(eye, {}, turning({-1, 0}), Laterality::od, 0.05, {0, 0}, 589.3);
  ASSERT_TRUE(slip);
  // 20 degrees a second to the left: what is there runs to the right, its image to the left (+x).
  EXPECT_NEAR(slip->direction_deg_s.x(), -20, 0.01);
  EXPECT_NEAR(slip->direction_deg_s.y(), 0, 1e-9);
  const double nodal_mm = eye.axial_length_mm() - cardinal_points(eye, 589.3).image_nodal_mm;
  EXPECT_NEAR(slip->image_mm_s.x(), 20 * degree * nodal_mm, 0.002 * 20 * degree * nodal_mm);
}

TEST(RetinalSlip, OffTheAxisIsThatOfPlainRays) {
  const EyeModel eye = make_eye("navarro");
  const Eigen::Vector2d at(0, 5);
  const auto slip = retinal_slip(eye, {}, turning({0, -1}), Laterality::od, 0.05, at, 589.3);
  ASSERT_TRUE(slip);
  // The object turns at 20 degrees a second wherever it stands in the plane of the turn.
  EXPECT_NEAR(slip->direction_deg_s.norm(), 20, 0.01);
  // Lines of sight of points that close along the retina turn by so many radians a millimetre.
  const PlainEye plain(eye, 589.3);
  const PlainPupil below(plain, at - Eigen::Vector2d(0, 0.01), 3),
      above(plain, at + Eigen::Vector2d(0, 0.01), 3);
  const double apart_mm =
      (plain.retina(at + Eigen::Vector2d(0, 0.01)) - plain.retina(at - Eigen::Vector2d(0, 0.01))).norm();
  const double rad_a_mm = std::asin(below.sight.cross(above.sight).norm()) / apart_mm;
  EXPECT_NEAR(slip->image_mm_s.norm(), 20 * degree / rad_a_mm, 0.003 * 20 * degree / rad_a_mm);
}

}  // namespace
}  // namespace emmetrope::raytrace
