#include "pipeline/eye/surfaces/height_field.hpp"

#include <gmock/gmock.h>

#include <array>
#include <random>

#include "pipeline/eye/model/mesh_shape.hpp"
#include "tests/support/sheet.hpp"

namespace emmetrope {
namespace {

using testing_eye::jittered_sheet;

TEST(HeightField, DerivativesAreThoseOfTheDepth) {
  const HeightField field =
      *HeightField::fit(jittered_sheet(*make_biconic(7.9, 7.6, -0.2, -0.3, 20), 5, 500, 1));
  constexpr double h = 1e-5;
  for (const auto& [x, y] : {std::pair{0.1, 0.2}, {-2.3, 3.1}, {4.0, -1.0}}) {
    const HeightField::Jet jet = field.at(x, y);
    EXPECT_NEAR(jet.gradient.x(), (field.at(x + h, y).depth_mm - field.at(x - h, y).depth_mm) / (2 * h),
                1e-8);
    EXPECT_NEAR(jet.gradient.y(), (field.at(x, y + h).depth_mm - field.at(x, y - h).depth_mm) / (2 * h),
                1e-8);
    EXPECT_NEAR(jet.hessian_per_mm(0, 0),
                (field.at(x + h, y).gradient.x() - field.at(x - h, y).gradient.x()) / (2 * h), 1e-6);
    EXPECT_NEAR(jet.hessian_per_mm(0, 1),
                (field.at(x, y + h).gradient.x() - field.at(x, y - h).gradient.x()) / (2 * h), 1e-6);
    EXPECT_NEAR(jet.hessian_per_mm(1, 1),
                (field.at(x, y + h).gradient.y() - field.at(x, y - h).gradient.y()) / (2 * h), 1e-6);
  }
}

TEST(HeightField, ControlValuesAreTheDocumentedSpline) {
  const HeightField field = *HeightField::fit(jittered_sheet(*make_sphere(7.8), 4, 300, 2));
  const double x = 1.234, y = -0.777;
  const auto weights = [](double t) -> Eigen::Vector4d {
    const double u = 1 - t;
    return Eigen::Vector4d(u * u * u, 3 * t * t * t - 6 * t * t + 4, 3 * u * u * u - 6 * u * u + 4,
                           t * t * t) /
           6;
  };
  const double s = (x - field.origin_mm().x()) / field.spacing_mm() - 1,
               r = (y - field.origin_mm().y()) / field.spacing_mm() - 1;
  const int i = static_cast<int>(std::floor(s)), j = static_cast<int>(std::floor(r));
  const Eigen::Vector4d wx = weights(s - i), wy = weights(r - j);
  double depth = 0;
  for (int b = 0; b < 4; ++b)
    for (int a = 0; a < 4; ++a)
      depth += wy[b] * wx[a] * field.controls_mm()[static_cast<std::size_t>(j + b) * field.columns() + i + a];
  EXPECT_NEAR(depth, field.at(x, y).depth_mm, 1e-12);
}

TEST(HeightField, SlopesOfConicsFromFewVertices) {
  // 565 vertices over 10 mm: 1e-6 of slope is 0.0013 arcmin of the ray behind a cornea.
  for (const ShapePtr& shape : {make_sphere(7.7), make_conic(7.72, -0.26), make_conic(10.2, -3.1316),
                                make_conic(-6, -1), make_biconic(7.95, 7.7, -0.2, -0.3, 25)}) {
    const HeightField field = *HeightField::fit(jittered_sheet(*shape, 5, 565, 3));
    EXPECT_LT(field.max_deviation_um(), 0.05);
    double square = 0;
    int count = 0;
    for (double x = -2.5; x <= 2.5; x += 0.13)
      for (double y = -2.5; y <= 2.5; y += 0.13) {
        const Eigen::Vector3d n = *shape->normal(x, y);
        square += (field.at(x, y).gradient - n.head<2>() / n.z()).squaredNorm();
        ++count;
      }
    EXPECT_LT(std::sqrt(square / count), 5e-6) << shape->to_json();
  }
}

TEST(HeightField, ReportsHowFarItPassesFromRoughVertices) {
  TriangleMesh mesh = jittered_sheet(*make_sphere(7.8), 5, 800, 4);
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0, 0.01);
  for (Eigen::Vector3d& v : mesh.vertices) v.z() += noise(random);
  const HeightField field = *HeightField::fit(mesh);
  EXPECT_GT(field.rms_deviation_um(), 4);
  EXPECT_LT(field.rms_deviation_um(), 11);
  EXPECT_GT(field.max_deviation_um(), field.rms_deviation_um());
}

TEST(HeightField, RefusesWhatIsNoHeightField) {
  TriangleMesh few = jittered_sheet(*make_sphere(7.8), 5, 9, 4);
  EXPECT_FALSE(HeightField::fit(few));
  TriangleMesh steps = jittered_sheet(*make_sphere(7.8), 5, 800, 4);
  for (std::size_t k = 0; k < steps.vertices.size(); k += 2) steps.vertices[k].z() -= 1;
  EXPECT_FALSE(HeightField::fit(steps));
  TriangleMesh beside = jittered_sheet(*make_plane(), 5, 800, 4);
  for (Eigen::Vector3d& v : beside.vertices) v.x() += 12;
  EXPECT_FALSE(HeightField::fit(beside));
}

TEST(HeightField, CoversItsOutlineAndHitsOnlyThere) {
  const HeightField field = *HeightField::fit(jittered_sheet(*make_sphere(7.8), 5, 500, 1));
  EXPECT_TRUE(field.covers(0, 0));
  EXPECT_TRUE(field.covers(3, 3));
  EXPECT_FALSE(field.covers(4.5, 4.5));
  EXPECT_TRUE(field.intersect({{3, 3, 10}, {0, 0, -1}}));
  EXPECT_FALSE(field.intersect({{4.5, 4.5, 10}, {0, 0, -1}}));
}

TEST(HeightField, CoversAnOutlineWithCornersFromEverySide) {
  // A triangle whose vertex is well off its middle.
  const std::array<Eigen::Vector2d, 3> corners{Eigen::Vector2d(4, -1), {-1, 4.5}, {-1.5, -2}};
  const auto beyond_mm = [&](const Eigen::Vector2d& p) {
    double most = -10;
    for (std::size_t k = 0; k < 3; ++k) {
      const Eigen::Vector2d along = (corners[(k + 1) % 3] - corners[k]).normalized(), to = p - corners[k];
      most = std::max(most, along.y() * to.x() - along.x() * to.y());
    }
    return most;
  };
  TriangleMesh mesh;
  for (const Eigen::Vector3d& v : jittered_sheet(*make_sphere(7.8), 5, 3000, 1).vertices)
    if (beyond_mm(v.head<2>()) <= 0) mesh.vertices.push_back(v);
  const HeightField field = *HeightField::fit(mesh);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> within(-5, 5);
  std::uniform_int_distribution<std::size_t> any(0, mesh.vertices.size() - 1);
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector2d p(within(random), within(random));
    if (beyond_mm(p) > 0) {
      EXPECT_FALSE(field.covers(p.x(), p.y())) << p.transpose();
    }
    const Eigen::Vector2d between = (mesh.vertices[any(random)] + mesh.vertices[any(random)]).head<2>() / 2;
    EXPECT_TRUE(field.covers(between.x(), between.y())) << between.transpose();
  }
}

}  // namespace
}  // namespace emmetrope
