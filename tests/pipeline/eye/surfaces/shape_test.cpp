#include "pipeline/eye/surfaces/shape.hpp"

#include <gmock/gmock.h>

#include <random>

#include "pipeline/base/checked_object.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"

namespace emmetrope {
namespace {

ShapePtr from_json(const Json& json) {
  CheckedObject object(json, "test");
  return shape_from_json(object.text("type"), object);
}

std::vector<ShapePtr> all_shapes() {
  std::vector<double> coma_and_trefoil(15, 0.0);
  coma_and_trefoil[6] = 5;
  coma_and_trefoil[7] = -5;
  coma_and_trefoil[12] = 2;
  return {make_plane(),
          make_sphere(7.7),
          make_sphere(-6),
          make_conic(7.72, -0.26),
          make_conic(10.2, -3.1316),
          make_conic(-6, -1),
          make_conic(-8.1, 0.96),
          make_biconic(7.95, 7.7, -0.23, -0.1, 30),
          make_biconic(-12.9, -12.7, 0.27, 0.25, 0),
          make_ellipsoid({11.5, 11.2, 12.1}, 15),
          make_ellipsoid({11.5, 11.2, -12.1}, 0),
          make_zernike(7.8, 7.6, -0.2, -0.3, 70, 4, coma_and_trefoil)};
}

TEST(Shape, SphereHasTheClosedFormSag) {
  EXPECT_NEAR(*make_sphere(7.7)->depth_mm(3, 4), 7.7 - std::sqrt(7.7 * 7.7 - 25), 1e-14);
  EXPECT_NEAR(*make_sphere(-12)->depth_mm(3, 4), -(12 - std::sqrt(144 - 25)), 1e-14);
  EXPECT_FALSE(make_sphere(7.7)->depth_mm(6, 6).has_value());
}

TEST(Shape, BiconicWithEqualMeridiansIsTheConicInEveryDirection) {
  const ShapePtr conic = make_conic(7.72, -0.26), biconic = make_biconic(7.72, 7.72, -0.26, -0.26, 33);
  for (double angle = 0; angle < 2 * pi; angle += 0.1) {
    const double x = 4 * std::cos(angle), y = 4 * std::sin(angle);
    EXPECT_NEAR(*biconic->depth_mm(x, y), *conic->depth_mm(x, y), 1e-14);
  }
}

TEST(Shape, BiconicCarriesItsFirstRadiusInTheMeridianOfItsAxis) {
  const ShapePtr biconic = make_biconic(8, 7, -0.2, -0.4, 30);
  const double c = std::cos(30 * degree), s = std::sin(30 * degree);
  EXPECT_NEAR(*biconic->depth_mm(2 * c, 2 * s), *make_conic(8, -0.2)->depth_mm(2, 0), 1e-14);
  EXPECT_NEAR(*biconic->depth_mm(-2 * s, 2 * c), *make_conic(7, -0.4)->depth_mm(2, 0), 1e-14);
}

TEST(Shape, EllipsoidIsTheBiconicOfItsVertex) {
  // R = b^2/a, Q = b^2/a^2 - 1 in each meridian of an ellipsoid with half axes (b_x, b_y, a).
  const ShapePtr ellipsoid = make_ellipsoid({11.5, 11.2, 12.1}, 0);
  for (const auto& [b, x, y] : {std::tuple{11.5, 3.0, 0.0}, {11.2, 0.0, 3.0}})
    EXPECT_NEAR(*ellipsoid->depth_mm(x, y),
                *make_conic(b * b / 12.1, b * b / (12.1 * 12.1) - 1)->depth_mm(x, y), 1e-13);
}

TEST(Shape, NormalAndVertexCurvatureAreDerivativesOfTheDepth) {
  constexpr double h = 1e-4;
  for (const ShapePtr& shape : all_shapes()) {
    const auto d = [&](double x, double y) { return *shape->depth_mm(x, y); };
    for (const auto& [x, y] : {std::pair{0.0, 0.0}, {1.0, -2.0}, {2.5, 1.5}}) {
      const Eigen::Vector3d expected =
          Eigen::Vector3d((d(x + h, y) - d(x - h, y)) / (2 * h), (d(x, y + h) - d(x, y - h)) / (2 * h), 1)
              .normalized();
      EXPECT_LT((*shape->normal(x, y) - expected).norm(), 1e-8) << shape->to_json();
    }
    Eigen::Matrix2d curvature;
    const double cross = (d(h, h) - d(h, -h) - d(-h, h) + d(-h, -h)) / (4 * h * h);
    curvature << (d(h, 0) - 2 * d(0, 0) + d(-h, 0)) / (h * h), cross, cross,
        (d(0, h) - 2 * d(0, 0) + d(0, -h)) / (h * h);
    EXPECT_LT((shape->vertex_curvature() - curvature).norm(), 1e-6) << shape->to_json();
  }
}

TEST(Shape, HitsLieOnTheSurfaceFromBothSides) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> place(-3, 3);
  for (const ShapePtr& shape : all_shapes())
    for (int k = 0; k < 200; ++k) {
      const Eigen::Vector2d aim(place(random), place(random));
      const Eigen::Vector3d target(aim.x(), aim.y(), -*shape->depth_mm(aim.x(), aim.y()));
      const bool inward = k % 2 == 0;
      const Eigen::Vector3d origin =
          target + Eigen::Vector3d(place(random) / 6, place(random) / 6, inward ? 3.0 : -3.0);
      const Ray ray{origin, (target - origin).normalized()};
      const std::optional<ShapeHit> hit = shape->intersect(ray);
      ASSERT_TRUE(hit) << shape->to_json() << k;
      EXPECT_LT((hit->position - target).norm(), 1e-11) << shape->to_json() << k;
      EXPECT_NEAR(hit->distance_mm, (target - origin).norm(), 1e-11);
      EXPECT_LT((hit->normal - *shape->normal(aim.x(), aim.y())).norm(), 1e-11);
    }
}

TEST(Shape, OnlyTheSheetOfTheVertexIsMet) {
  // Into the back of a sphere's far half: the vertex's half is met, from inside.
  const std::optional<ShapeHit> hit = make_sphere(-12)->intersect({{0, 0, 30}, {0, 0, -1}});
  ASSERT_TRUE(hit);
  EXPECT_NEAR(hit->position.z(), 0, 1e-12);
  EXPECT_FALSE(make_sphere(7.7)->intersect({{8, 0, 5}, {0, 0, -1}}));
  EXPECT_FALSE(make_plane()->intersect({{0, 0, 1}, {0, 0, 1}}));  // half lines do not look back
}

TEST(Shape, JsonReadsBackToTheSameSurface) {
  for (const ShapePtr& shape : all_shapes()) {
    const ShapePtr again = from_json(shape->to_json());
    EXPECT_EQ(again->to_json(), shape->to_json());
    EXPECT_EQ(*again->depth_mm(1.2, -0.7), *shape->depth_mm(1.2, -0.7));
  }
}

TEST(Shape, ImpossibleValuesNameTheirKey) {
  const auto message = [](const Json& json) -> std::string {
    try {
      from_json(json);
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::input_invalid);
      return error.what();
    }
    return "accepted";
  };
  EXPECT_THAT(message({{"type", "sphere"}, {"radius_mm", 0}}), testing::HasSubstr("radius_mm"));
  EXPECT_THAT(message({{"type", "sphere"}}), testing::HasSubstr("radius_mm"));
  EXPECT_THAT(message({{"type", "conic"}, {"radius_mm", "7"}}), testing::HasSubstr("radius_mm"));
  EXPECT_THAT(message({{"type", "biconic"}, {"radius_mm", {7, 8, 9}}}), testing::HasSubstr("radius_mm"));
  EXPECT_THAT(message({{"type", "ellipsoid"}, {"semi_axes_mm", {7, -8, 9}}}),
              testing::HasSubstr("semi_axes_mm"));
  EXPECT_THAT(message({{"type", "torus"}}), testing::HasSubstr("torus"));
}

TEST(Shape, TurnsAboutItsAxis) {
  const double turn_deg = 25, c = std::cos(turn_deg * degree), s = std::sin(turn_deg * degree);
  const ShapePtr shapes[] = {make_plane(), make_conic(7.8, -0.2), make_ellipsoid({11, 12, -10}, 10),
                             make_biconic(7.6, 8, -0.3, -0.1, 170),
                             make_zernike(7.6, 8, -0.3, -0.1, 40, 3, {0, 1, 2, 3, 4, 5, 6, 7})};
  for (const ShapePtr& shape : shapes) {
    const ShapePtr turned = turned_about_axis(shape, turn_deg);
    EXPECT_EQ(turned->type(), shape->type());
    EXPECT_EQ(turned->formula().index(), shape->formula().index());
    EXPECT_EQ(turned->asphericity(), shape->asphericity());
    const double x = 1.3, y = -0.6;
    EXPECT_NEAR(turned->depth_mm(c * x - s * y, s * x + c * y).value(), shape->depth_mm(x, y).value(), 1e-12)
        << shape->type();
  }
}

}  // namespace
}  // namespace emmetrope
