#include "pipeline/eye/model/mesh_shape.hpp"

#include <gmock/gmock.h>

#include <random>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "tests/support/meshed_eye.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope {
namespace {

using testing_eye::exit_error_arcmin;
using testing_eye::jittered_sheet;
using testing_eye::meshed;
TEST(MeshShape, SmoothIsAsGoodAsTheFormulaOnConics) {
  const EyeModel eye = make_eye("navarro");
  EXPECT_LT(exit_error_arcmin(eye, meshed(eye, 565, MeshInterpolation::smooth, true)), 0.01);
  EXPECT_LT(exit_error_arcmin(eye, meshed(eye, 1516, MeshInterpolation::smooth, false)), 0.01);
}

TEST(MeshShape, SmoothFollowsAnIrregularCornea) {
  EyeModel eye = make_eye("navarro");
  std::vector<double> terms(10, 0.0);
  terms[6] = 5;
  terms[7] = 5;
  eye.surface("cornea_anterior").shape = make_zernike(7.95, 7.7, -0.23, -0.2, 15, 5, terms);
  EXPECT_LT(exit_error_arcmin(eye, meshed(eye, 565, MeshInterpolation::smooth, true)), 0.03);
}

TEST(MeshShape, TrianglesConvergeWithTheirNormals) {
  const EyeModel eye = make_eye("navarro");
  EXPECT_LT(exit_error_arcmin(eye, meshed(eye, 565, MeshInterpolation::triangles, true)), 0.2);
  EXPECT_LT(exit_error_arcmin(eye, meshed(eye, 1516, MeshInterpolation::triangles, true)), 0.1);
  EXPECT_LT(exit_error_arcmin(eye, meshed(eye, 565, MeshInterpolation::triangles, false)), 0.4);
}

TEST(MeshShape, NoRayIsLostAtVerticesAndEdges) {
  const ShapePtr sphere = make_sphere(7.8);
  const TriangleMesh mesh = jittered_sheet(*sphere, 5, 800, 9);
  const MeshShape shape(make_mesh_surface("s", mesh, "").shape
                            ? transformed(
                                  [&] {
                                    Eigen::Isometry3d shift = Eigen::Isometry3d::Identity();
                                    shift.translation().z() = make_mesh_surface("s", mesh, "").position_mm;
                                    return shift;
                                  }(),
                                  mesh)
                            : mesh,
                        MeshInterpolation::triangles);
  std::mt19937 random(2);
  std::uniform_real_distribution<double> unit(0, 1);
  int lost = 0;
  for (int k = 0; k < 30000; ++k) {
    const auto& t = shape.mesh().triangles[random() % shape.mesh().triangles.size()];
    const Eigen::Vector3d &a = shape.mesh().vertices[t[0]], &b = shape.mesh().vertices[t[1]];
    const Eigen::Vector3d target = k % 2 == 0 ? a : Eigen::Vector3d(a + unit(random) * (b - a));
    if (target.head<2>().norm() > 4.5) continue;  // the outline has only one side
    const Eigen::Vector3d origin(unit(random) - 0.5, unit(random) - 0.5, k % 3 == 0 ? 15.0 : -15.0);
    if (!shape.intersect_triangles({origin, (target - origin).normalized()})) ++lost;
  }
  EXPECT_EQ(lost, 0);
}

TEST(MeshShape, HierarchyFindsTheNearestTriangle) {
  const TriangleMesh mesh = jittered_sheet(*make_conic(-6, -1), 4, 300, 3);
  const TriangleHierarchy hierarchy(mesh);
  std::mt19937 random(4);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (int k = 0; k < 500; ++k) {
    const Ray ray{{4 * unit(random), 4 * unit(random), 6},
                  Eigen::Vector3d(unit(random), unit(random), -1.5).normalized()};
    const auto hit = hierarchy.nearest(ray);
    double best = 1e9;
    for (const auto& t : mesh.triangles) {
      const Eigen::Vector3d a = mesh.vertices[t[0]], b = mesh.vertices[t[1]], c = mesh.vertices[t[2]];
      const Eigen::Vector3d n = (b - a).cross(c - a);
      const double s = n.dot(a - ray.origin) / n.dot(ray.direction);
      const Eigen::Vector3d p = ray.origin + s * ray.direction;
      if (s >= 0 && n.dot((b - a).cross(p - a)) >= 0 && n.dot((c - b).cross(p - b)) >= 0 &&
          n.dot((a - c).cross(p - c)) >= 0)
        best = std::min(best, s);
    }
    ASSERT_EQ(hit.has_value(), best < 1e8);
    if (hit) {
      EXPECT_NEAR(hit->distance_mm, best, 1e-9);
    }
  }
}

TEST(MeshShape, MaxNormalsAreExactOnASphere) {
  TriangleMesh mesh = jittered_sheet(*make_sphere(7.8), 5, 300, 6);
  const std::vector<Eigen::Vector3d> exact = mesh.normals;
  estimate_normals(mesh);
  double worst = 0;
  for (std::size_t k = 0; k < exact.size(); ++k)
    if (mesh.vertices[k].head<2>().norm() < 4) worst = std::max(worst, (mesh.normals[k] - exact[k]).norm());
  EXPECT_LT(worst, 1e-12);
}

/// The sheet's vertices lie on the sphere, its facets within it by some micrometres, whose vertex is 3 mm deep.
TEST(MeshShape, ItsVertexIsTheSurfacesNotAFacets) {
  for (const int seed : {3, 4, 5, 6}) {
    TriangleMesh mesh = jittered_sheet(*make_sphere(7.8), 5, 300, seed);
    for (Eigen::Vector3d& vertex : mesh.vertices) vertex.z() -= 3;
    const Surface smooth = make_mesh_surface("cornea_anterior", mesh, "");
    EXPECT_NEAR(smooth.position_mm, 3, 2e-5) << seed;
    EXPECT_NEAR(*smooth.shape->depth_mm(0, 0), 0, 1e-9);
    const Surface faceted = make_mesh_surface("cornea_anterior", mesh, "", MeshInterpolation::triangles);
    EXPECT_GT(faceted.position_mm, 3 + 1e-3);
    EXPECT_NEAR(*faceted.shape->depth_mm(0, 0), 0, 1e-9);
  }
}

TEST(MeshShape, NormalsTurnOutward) {
  TriangleMesh mesh = jittered_sheet(*make_sphere(-12), 6, 300, 6);
  for (auto& t : mesh.triangles) std::swap(t[0], t[1]);
  for (auto& n : mesh.normals) n = -n;
  const Surface surface = make_mesh_surface("retina", mesh, "");
  EXPECT_GT(surface.shape->normal(1, 1)->z(), 0);
  EXPECT_NEAR(surface.shape->vertex_curvature()(0, 0), -1.0 / 12, 1e-4);
}

TEST(MeshShape, AGlobeBeyondItsEquatorIsMetOnTheRightSide) {
  // A sphere open only in front: rays from the pupil meet its back, also where it is no height field.
  TriangleMesh globe;
  const int rings = 60, spokes = 80;
  const double radius = 12;
  globe.vertices.emplace_back(0, 0, 0);
  for (int i = 1; i <= rings; ++i)
    for (int k = 0; k < spokes; ++k) {
      const double polar = 2.4 * i / rings, angle = 2 * pi * (k + 0.5 * (i % 2)) / spokes;
      globe.vertices.emplace_back(radius * std::sin(polar) * std::cos(angle),
                                  radius * std::sin(polar) * std::sin(angle), radius * (1 - std::cos(polar)));
    }
  for (int k = 0; k < spokes; ++k) globe.triangles.push_back({0, 1 + k, 1 + (k + 1) % spokes});
  for (int i = 1; i < rings; ++i)
    for (int k = 0; k < spokes; ++k) {
      const int a = 1 + (i - 1) * spokes + k, b = 1 + (i - 1) * spokes + (k + 1) % spokes;
      const int c = 1 + i * spokes + k, d = 1 + i * spokes + (k + 1) % spokes;
      globe.triangles.push_back({a, c, b});
      globe.triangles.push_back({b, c, d});
    }
  const Surface surface = make_mesh_surface("retina", globe, "");
  const auto& shape = dynamic_cast<const MeshShape&>(*surface.shape);
  ASSERT_NE(shape.patch(), nullptr);
  EXPECT_LT(shape.patch()->max_deviation_um(), 1);
  const Eigen::Vector3d centre(0, 0, radius);
  for (const double angle_deg : {0.0, 20.0, 40.0, 55.0, 75.0, 85.0}) {
    const double a = angle_deg * degree;
    const Ray ray{{0, 0, 20}, Eigen::Vector3d(std::sin(a) * 0.8, std::sin(a) * 0.6, -std::cos(a))};
    const std::optional<ShapeHit> hit = shape.intersect(ray);
    if (20 - radius < radius * std::cos(pi - 2.4) && angle_deg > 80) continue;
    ASSERT_TRUE(hit) << angle_deg;
    EXPECT_NEAR((hit->position - centre).norm(), radius, 0.02) << angle_deg;
  }
}

TEST(MeshShape, SheetsInAnotherUnitAreRefused) {
  for (const double factor : {1e-3, 1e3}) {
    TriangleMesh mesh = jittered_sheet(*make_sphere(7.8), 5, 300, 6);
    for (auto& v : mesh.vertices) v *= factor;
    EXPECT_THROW(make_mesh_surface("cornea", mesh, ""), Error) << factor;
  }
}

TEST(MeshShape, OfAFileInAnotherSpaceIsRefused) {
  const test::TemporaryFolder folder;
  const std::filesystem::path file = folder.path() / "cornea.obj";
  write_mesh(file, jittered_sheet(*make_sphere(7.8), 5, 300, 6), true);
  std::string text = read_file(file);
  write_file(file, text.replace(text.find("SPACE=LPS"), 9, "SPACE=RAS"));
  EXPECT_THAT([&] { read_mesh_surface("cornea", file, Eigen::Isometry3d::Identity(), ""); },
              testing::ThrowsMessage<Error>(testing::HasSubstr("cornea.obj: the mesh says SPACE=RAS")));
}

// A point beside the sheet bent the smooth surface.
TEST(MeshShape, OfAFileAVertexOfNoTriangleIsNoPartOf) {
  const test::TemporaryFolder folder;
  TriangleMesh mesh = jittered_sheet(*make_sphere(7.8), 5, 300, 6);
  const auto curvature = [&] {
    write_mesh(folder.path() / "cornea.ply", mesh, false);
    return read_mesh_surface("cornea", folder.path() / "cornea.ply", std::nullopt, "")
        .shape->vertex_curvature();
  };
  const Eigen::Matrix2d expected = curvature();
  mesh.vertices.emplace_back(0.5, 0.3, -0.3);
  mesh.normals.emplace_back(0, 0, 1);
  EXPECT_EQ(curvature(), expected);
}

TEST(MeshShape, SheetsThatMissTheAxisAreRefused) {
  TriangleMesh mesh = jittered_sheet(*make_sphere(7.8), 5, 300, 6);
  for (auto& v : mesh.vertices) v.x() += 9;
  EXPECT_THROW(make_mesh_surface("cornea", mesh, ""), Error);
}

}  // namespace
}  // namespace emmetrope
