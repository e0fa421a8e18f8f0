#include "meshing/sheet.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "meshing/mesh_check.hpp"
#include "meshing/remesh.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "tests/support/random_eye.hpp"

namespace emmetrope::meshing {
namespace {

using Eigen::Vector3d;

const NamedSheet& find(const std::vector<NamedSheet>& sheets, const std::string& name) {
  for (const NamedSheet& sheet : sheets) {
    if (sheet.name == name) return sheet;
  }
  throw std::out_of_range(name);
}

/// A flat triangulated disc with exact normals.
TriangleMesh small_disc() {
  TriangleMesh mesh;
  mesh.vertices.emplace_back(0, 0, 0);
  for (int i = 0; i < 6; ++i) {
    mesh.vertices.emplace_back(std::cos(i * pi / 3), std::sin(i * pi / 3), 0);
    mesh.triangles.push_back({0, i + 1, (i + 1) % 6 + 1});
  }
  mesh.normals.assign(7, Vector3d::UnitZ());
  return mesh;
}

std::string complaint(const TriangleMesh& mesh) {
  try {
    check_sheet(mesh);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(SheetCheck, AcceptsADisc) { EXPECT_EQ(check_sheet(small_disc()).triangles, 6); }

TEST(SheetCheck, FindsEveryDefect) {
  using testing::HasSubstr;
  TriangleMesh turned = small_disc();
  std::swap(turned.triangles[2][0], turned.triangles[2][1]);
  EXPECT_THAT(complaint(turned), HasSubstr("turned over"));

  TriangleMesh thrice = small_disc();
  thrice.vertices.emplace_back(0.5, 0.5, 1);
  thrice.normals.emplace_back(0, 0, 1);
  thrice.triangles.push_back({0, 1, 7});  // a third triangle on the edge 0-1
  EXPECT_THAT(complaint(thrice), HasSubstr("manifold"));

  TriangleMesh hole = small_disc();  // an annulus: disc without its middle, closed by a second ring
  hole.vertices[0] = {0, 0, 0};
  for (int i = 0; i < 6; ++i) {
    hole.vertices.emplace_back(2 * std::cos(i * pi / 3), 2 * std::sin(i * pi / 3), 0);
    hole.normals.emplace_back(0, 0, 1);
  }
  hole.triangles.clear();
  for (int i = 0; i < 6; ++i) {
    const int k = (i + 1) % 6;
    hole.triangles.push_back({1 + i, 7 + i, 7 + k});
    hole.triangles.push_back({1 + i, 7 + k, 1 + k});
  }
  EXPECT_THAT(complaint(hole), HasSubstr("vertex 0"));  // the middle belongs to no triangle
  hole.vertices.erase(hole.vertices.begin());
  hole.normals.erase(hole.normals.begin());
  for (auto& t : hole.triangles)
    for (int& v : t) --v;
  EXPECT_THAT(complaint(hole), HasSubstr("2 boundary loops"));

  TriangleMesh sliver = small_disc();
  sliver.vertices[2] = {std::cos(0.02), std::sin(0.02), 0};
  EXPECT_THAT(complaint(sliver), HasSubstr("sliver"));

  TriangleMesh wrong_normal = small_disc();
  wrong_normal.normals[3] = -Vector3d::UnitZ();
  EXPECT_THAT(complaint(wrong_normal), HasSubstr("normal"));
}

TEST(Sheets, RandomEyesGiveCleanSheetsOnTheirSurfaces) {
  for (unsigned seed = 0; seed < 4; ++seed) {
    const ParametricEye eye = random_eye(seed);
    for (const NamedSheet& named : make_sheets(eye)) {
      SCOPED_TRACE(named.name + ", eye " + std::to_string(seed));
      const TriangleMesh mesh = mesh_with_vertices(*named.sheet, named.paper_vertices);
      const SheetQuality quality = check_sheet(mesh);  // manifold, one rim, oriented, no slivers
      EXPECT_EQ(quality.vertices, named.paper_vertices);
      EXPECT_GT(quality.smallest_angle_deg, 25);
      EXPECT_LT(quality.largest_normal_deviation_deg, 15);
      for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
        EXPECT_LT((named.sheet->project(mesh.vertices[i]) - mesh.vertices[i]).norm(), 1e-9);
        EXPECT_NEAR(mesh.normals[i].norm(), 1, 1e-12);
        if (named.name != "retina") {
          EXPECT_GT(mesh.normals[i].z(), 0.3);  // towards the light
        }
      }
    }
  }
}

TEST(Sheets, CorneaLiesOnTheFittedBiconic) {
  const ParametricEye eye = random_eye(11);
  const auto sheets = make_sheets(eye);
  for (const Vector3d& v : mesh_with_vertices(*find(sheets, "cornea_anterior").sheet, 300).vertices)
    EXPECT_NEAR(v.z(), -eye.cornea_anterior_depth_mm(v.x(), v.y()), 1e-10);
  for (const Vector3d& v : mesh_with_vertices(*find(sheets, "cornea_posterior").sheet, 300).vertices)
    EXPECT_NEAR(v.z(), -eye.cornea_posterior_depth_mm(v.x(), v.y()), 1e-10);
}

TEST(Sheets, TiltedLensTurnsAboutItsMiddle) {
  ParametricEye eye = random_eye(12);
  eye.lens_decentre_mm = {0.2, -0.1};
  eye.lens_tilt_deg = {5, -3};
  const auto sheets = make_sheets(eye);
  const Vector3d front = find(sheets, "lens_anterior").sheet->at(0, 0);
  const Vector3d back = find(sheets, "lens_posterior").sheet->at(0, 0);
  EXPECT_NEAR((front - back).norm(), eye.lens_thickness_mm, 1e-12);
  const Vector3d middle = (front + back) / 2;
  EXPECT_NEAR(middle.x(), 0.2, 1e-12);
  EXPECT_NEAR(middle.y(), -0.1, 1e-12);
  EXPECT_NEAR(middle.z(), -eye.anterior_chamber_depth_mm - eye.lens_thickness_mm / 2, 1e-12);
  // Right-handed about +x, the front vertex (towards +z) goes to -y; then about +y by -3 degrees to -x.
  EXPECT_LT((front - back).normalized().y(), -0.05);
  EXPECT_LT((front - back).normalized().x(), -0.05);
}

TEST(Sheets, RetinaPassesTheEquatorAndItsPole) {
  const ParametricEye eye = random_eye(13);
  const TriangleMesh mesh = mesh_with_vertices(*find(make_sheets(eye), "retina").sheet, 973);
  double nearest = 1, foremost = -100;
  for (const Vector3d& v : mesh.vertices) {
    nearest = std::min(nearest, (v - Vector3d(0, 0, -eye.pole_depth_mm())).norm());
    foremost = std::max(foremost, v.z());
  }
  EXPECT_LT(nearest, 1.0);
  EXPECT_GT(foremost, eye.globe_centre_mm().z() + 2);
}

TEST(Remesh, CountsAreMetExactlyAndEdgesRoughly) {
  const auto sheets = make_sheets(random_eye(14));
  const Sheet& cornea = *find(sheets, "cornea_anterior").sheet;
  for (const int count : {60, 77, 200, 613, 2500}) {
    const SheetQuality quality = check_sheet(mesh_with_vertices(cornea, count));
    EXPECT_EQ(quality.vertices, count);
  }
  EXPECT_NEAR(check_sheet(mesh_with_edge(cornea, 0.5)).mean_edge_mm, 0.5, 0.05);
  EXPECT_THROW(mesh_with_vertices(cornea, 59), Error);
}

TEST(Remesh, SameSheetGivesSameMesh) {
  const auto sheets = make_sheets(random_eye(15));
  const TriangleMesh a = mesh_with_vertices(*find(sheets, "retina").sheet, 500);
  const TriangleMesh b = mesh_with_vertices(*find(sheets, "retina").sheet, 500);
  EXPECT_EQ(a.vertices, b.vertices);
  EXPECT_EQ(a.triangles, b.triangles);
}

}  // namespace
}  // namespace emmetrope::meshing
