#include "raytrace/retina/wide_field.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <random>

#include "pipeline/base/frames.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "raytrace/scene/scene.hpp"
#include "raytrace/spectacle/spectacle.hpp"
#include "raytrace/tracer/tracer.hpp"
#include "tests/support/random_conic_eye.hpp"

namespace emmetrope::raytrace {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

RetinalGrid wide_grid(Projection projection, double field_deg, int side) {
  RetinalGrid grid;
  grid.width = grid.height = side;
  grid.projection = projection;
  grid.field_deg = {field_deg, field_deg};
  return grid;
}

/// The direction of the exact ray from a retinal point through the stop's centre, found by Newton's method on the
/// ray's direction at the retina.
Vector3d exact_line_of_sight(const EyeModel& eye, const Vector3d& from, Vector3d towards) {
  const EyeModel open = without_stop(eye);
  const double stop_z_mm = -eye.stop()->position_mm;
  const auto traced = [&](const Vector2d& slope) {
    return trace_exact(open, {from, Vector3d(slope.x(), slope.y(), 1).normalized()}, 555);
  };
  const auto at_stop = [&](const RayPath& path) {
    for (const RayHit& hit : path.hits)
      if (hit.surface == "lens_anterior") {
        const double t = (stop_z_mm - hit.position_mm.z()) / hit.direction.z();
        return Vector2d((hit.position_mm + t * hit.direction).head<2>());
      }
    return Vector2d(1e3, 1e3);
  };
  Vector2d slope = (towards / towards.z()).head<2>();
  for (int round = 0; round < 20; ++round) {
    constexpr double step = 1e-5;
    const Vector2d middle = at_stop(traced(slope));
    Eigen::Matrix2d by_slope;
    by_slope << (at_stop(traced(slope + Vector2d(step, 0))) - middle) / step,
        (at_stop(traced(slope + Vector2d(0, step))) - middle) / step;
    Vector2d move = by_slope.inverse() * middle;
    while (at_stop(traced(slope - move)).norm() > middle.norm() && move.norm() > 1e-14) move /= 2;
    slope -= move;
  }
  const RayPath path = traced(slope);
  EXPECT_EQ(path.state, RayState::reached);
  EXPECT_LT(at_stop(path).norm(), 1e-9);
  return path.hits.back().direction;
}

/// Pixels of a picture look where its projection says, by exact rays.
void expect_directions(const EyeModel& eye, const RetinalGrid& grid, int points) {
  const WideField field(eye, grid, 555, 555, 2);
  const RetinaPixels pixels = field.pixels(2);
  const RetinaPoint pole = *meet_retina(eye, Vector2d(0, 0));
  const Vector3d ahead = exact_line_of_sight(eye, pole.position_mm, {0, 0, 1});
  const Eigen::Quaterniond turn = Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), ahead);
  std::mt19937 random(5);
  double worst_deg = 0, widest_deg = 0;
  for (int checked = 0; checked < points;) {
    const int column = static_cast<int>(random() % grid.width),
              row = static_cast<int>(random() % grid.height);
    const std::size_t pixel = static_cast<std::size_t>(row) * grid.width + column;
    const Vector2d centred(2 * (column + 0.5) / grid.width - 1, 2 * (row + 0.5) / grid.height - 1);
    if (centred.norm() > 1 || pixels.unseen[pixel] != 0) continue;
    const float* p = &pixels.values[pixel * RetinaPixels::floats_a_pixel];
    const Vector3d retina(p[0], p[1], p[2]), aim(p[3], p[4], field.plane_z_mm());
    Vector3d wanted;
    if (grid.projection == Projection::perspective) {
      const Vector2d tangent = std::tan(grid.field_deg.x() / 2 * degree) * centred;
      wanted = Vector3d(-tangent.x(), -tangent.y(), 1).normalized();
    } else {
      const double angle = centred.norm() * grid.field_deg.x() / 2 * degree;
      const Vector2d beside = std::sin(angle) * centred.normalized();
      wanted = {-beside.x(), -beside.y(), std::cos(angle)};
    }
    SCOPED_TRACE(testing::Message() << std::acos(wanted.z()) / degree << " degrees from the line of sight");
    const Vector3d seen = exact_line_of_sight(eye, retina, aim - retina);
    const double off_deg = std::atan2(seen.cross(turn * wanted).norm(), seen.dot(turn * wanted)) / degree;
    worst_deg = std::max(worst_deg, off_deg);
    widest_deg = std::max(widest_deg, std::acos(wanted.z()) / degree);
    ++checked;
  }
  EXPECT_LT(worst_deg, 0.02);
  if (grid.field_deg.x() >= 200) {
    EXPECT_GT(widest_deg, 98);
  }
  testing::Test::RecordProperty("worst_deg", std::to_string(worst_deg));
}

TEST(WideField, PixelsOf200DegreesLookWhereExactRaysGo) {
  EyeModel eye = make_eye("navarro");
  eye.set_stop_diameter(3);
  expect_directions(eye, wide_grid(Projection::visual_angle, 200, 500), 500);
}

TEST(WideField, PixelsOfTiltedEyesLookWhereExactRaysGo) {
  for (int seed = 1; seed <= 3; ++seed)
    expect_directions(random_conic_eye(seed), wide_grid(Projection::visual_angle, 160, 300), 100);
}

TEST(WideField, PerspectiveIsInTangents) {
  expect_directions(make_eye("navarro"), wide_grid(Projection::perspective, 120, 300), 100);
}

TEST(WideField, PixelsAlongTheRetinaAreAsFarFromThePole) {
  const EyeModel eye = make_eye("navarro");  // its retina is a sphere of 12 mm
  RetinalGrid grid;
  grid.width = grid.height = 101;
  grid.field_x_mm = grid.field_y_mm = 46;
  grid.projection = Projection::retina_arc;
  const RetinaPixels pixels = WideField(eye, grid, 555, 555, 2).pixels(2);
  const Vector3d centre(0, 0, -eye.axial_length_mm() + 12);
  double furthest_mm = 0;
  for (int row = 0; row < 101; row += 5)
    for (int column = 0; column < 101; column += 5) {
      const std::size_t pixel = static_cast<std::size_t>(row) * 101 + column;
      if (pixels.unseen[pixel] != 0) continue;
      const float* p = &pixels.values[pixel * RetinaPixels::floats_a_pixel];
      const Vector3d on = Vector3d(p[0], p[1], p[2]) - centre;
      const Vector2d place = 46.0 / 101 * Vector2d(column - 50, row - 50);
      EXPECT_NEAR(on.norm(), 12, 2e-4);
      EXPECT_NEAR(12 * std::atan2(on.head<2>().norm(), -on.z()), place.norm(), 1e-3) << place.transpose();
      if (place.norm() > 0) {
        EXPECT_GT(on.head<2>().normalized().dot(place.normalized()), 1 - 1e-8);
      }
      furthest_mm = std::max(furthest_mm, place.norm());
    }
  EXPECT_GT(furthest_mm, 12 * pi / 2);  // beyond the equator
}

TEST(WideField, CornersThatTheEyeDoesNotSeeAreMarked) {
  const EyeModel eye = make_eye("navarro");
  const RetinaPixels pixels =
      WideField(eye, wide_grid(Projection::visual_angle, 200, 64), 555, 555, 2).pixels(2);
  EXPECT_TRUE(pixels.is_unseen(0));
  EXPECT_FALSE(pixels.is_unseen(32 * 64 + 32));
}

TEST(WideField, EndsAtTheRimOfASpectacle) {
  const EyeModel eye = with_spectacle(make_eye("navarro"), parse_spectacle("-8/0x0@12"));
  const RetinalGrid grid = wide_grid(Projection::visual_angle, 200, 200);
  const RetinaPixels pixels = WideField(eye, grid, 555, 555, 2).pixels(2);
  const ExactTracer exact(without_stop(eye), 555);
  int seen = 0;
  for (int column = 0; column < 200; ++column) {
    const std::size_t pixel = 100 * 200 + column;
    if (pixels.is_unseen(pixel)) continue;
    ++seen;
    // Towards the middle of what is aimed at: through the lens.
    const float* p = &pixels.values[pixel * RetinaPixels::floats_a_pixel];
    const Vector3d retina(p[0], p[1], p[2]), aim(p[3], p[4], aim_plane_z_mm(eye, 555));
    const RayPath path = exact.trace({retina, (aim - retina).normalized()});
    EXPECT_EQ(path.hits.back().surface, "spectacle_front") << column;
  }
  EXPECT_GT(seen, 120);
  EXPECT_LT(seen, 170);
}

TEST(WideField, APictureOf200DegreesShowsThePerimeter) {
  EyeModel eye = make_eye("navarro");
  eye.set_stop_diameter(1);
  TraceSettings settings;
  settings.grid = wide_grid(Projection::visual_angle, 200, 200);
  settings.samples = 32;
  settings.wavelength_nm = 555;
  const TraceResult result = Tracer("").trace(eye, *make_scene("perimeter"), settings);
  const auto light = [&](double eccentricity_deg, double meridian_deg) {
    const int column = static_cast<int>(100 + eccentricity_deg * std::cos(meridian_deg * degree)),
              row = static_cast<int>(100 - eccentricity_deg * std::sin(meridian_deg * degree));
    EXPECT_FALSE(result.unseen[200 * row + column] != 0) << eccentricity_deg << ' ' << meridian_deg;
    return result.image.at(column, row, 0);
  };
  // Counter-clockwise from the patient's right.
  for (const double eccentricity_deg : {15.0, 45.0, 75.0, 95.0}) {  // blurred by the lines beside at the last
    EXPECT_NEAR(light(eccentricity_deg, 45), 0.45, 0.03);
    EXPECT_NEAR(light(eccentricity_deg, 135), 0.6, 0.03);
    EXPECT_NEAR(light(eccentricity_deg, 225), 0.95, 0.03);
    EXPECT_NEAR(light(eccentricity_deg, 315), 0.75, 0.03);
  }
  for (const double circle_deg : {30.0, 60.0}) {  // drawn on 0.95; bold ones are nearly as wide as a pixel
    float darkest = 1;
    for (const double beside_deg : {-1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5})
      darkest = std::min(darkest, light(circle_deg + beside_deg, 225));
    EXPECT_LT(darkest, 0.7);
  }
  EXPECT_NE(result.unseen[0], 0);
  EXPECT_EQ(result.image.at(0, 0, 0), 0);
}

// A spectral picture has one point of the retina a pixel; light of another colour only goes through the pupil otherwise.
TEST(WideField, PixelsOfEveryColourLieAtThePlacesOfOne) {
  const EyeModel eye = make_eye("navarro");
  const RetinalGrid grid = wide_grid(Projection::visual_angle, 80, 16);
  const RetinaPixels one = WideField(eye, grid, 555, 555, 2).pixels(2),
                     blue = WideField(eye, grid, 420, 555, 2).pixels(2),
                     own = WideField(eye, grid, 420, 420, 2).pixels(2);
  double aims_apart_mm = 0, own_apart_mm = 0;
  for (std::size_t pixel = 0; pixel < 256; ++pixel) {
    const std::size_t at = pixel * RetinaPixels::floats_a_pixel;
    for (std::size_t k = 0; k < 3; ++k) {
      EXPECT_NEAR(blue.values[at + k], one.values[at + k], 1e-6);
      own_apart_mm = std::max<double>(own_apart_mm, std::abs(own.values[at + k] - one.values[at + k]));
    }
    aims_apart_mm = std::max<double>(aims_apart_mm, std::abs(blue.values[at + 3] - one.values[at + 3]));
  }
  EXPECT_GT(own_apart_mm, 0.01);
  EXPECT_GT(aims_apart_mm, 1e-4);
}

TEST(WideField, APictureByArcsHasItsMiddleAtTheFovea) {
  const EyeModel eye = make_eye("navarro");
  RetinalGrid grid = wide_grid(Projection::retina_arc, 4, 2);
  grid.field_x_mm = grid.field_y_mm = 4;
  grid.centre_mm = {8, 3};
  const auto middle = FieldPoints(eye, grid, 555).at({0, 0});
  ASSERT_TRUE(middle);
  EXPECT_LT((middle->position_mm.head<2>() - grid.centre_mm).norm(), 1e-4);
}

}  // namespace
}  // namespace emmetrope::raytrace
