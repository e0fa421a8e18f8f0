#include "pipeline/eye/model/clean_sheet.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/model/mesh_shape.hpp"
#include "tests/support/sheet.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

/// A cornea with its formula's normals.
TriangleMesh cornea() { return testing_eye::jittered_sheet(*make_conic(7.72, -0.26), 5, 565, 3); }

std::vector<std::string> cleaned(TriangleMesh& mesh) {
  MeshFile file;
  file.mesh = mesh;
  const std::vector<std::string> not_used = clean_sheet(file);
  mesh = file.mesh;
  return not_used;
}

void expect_same(const TriangleMesh& found, const TriangleMesh& expected) {
  EXPECT_EQ(found.vertices, expected.vertices);
  EXPECT_EQ(found.normals, expected.normals);
  EXPECT_EQ(found.triangles, expected.triangles);
}

TEST(CleanSheet, LeavesACleanOneAsItIs) {
  TriangleMesh inward = cornea();
  for (Eigen::Vector3d& normal : inward.normals) normal = -normal;
  TriangleMesh without = cornea();
  without.normals.clear();
  for (const TriangleMesh& whole : {cornea(), inward, without}) {
    TriangleMesh mesh = whole;
    EXPECT_THAT(cleaned(mesh), IsEmpty());
    expect_same(mesh, whole);
  }
}

TEST(CleanSheet, EveryTrianglesOwnVerticesAreWelded) {
  TriangleMesh whole = cornea(), soup;
  whole.normals.clear();
  for (const auto& triangle : whole.triangles) {
    const int first = static_cast<int>(soup.vertices.size());
    for (const int corner : triangle) soup.vertices.push_back(whole.vertices[corner]);
    soup.triangles.push_back({first, first + 1, first + 2});
  }
  EXPECT_THAT(cleaned(soup), IsEmpty());
  EXPECT_LE(soup.vertices.size(), whole.vertices.size());
  ASSERT_EQ(soup.triangles.size(), whole.triangles.size());
  for (std::size_t t = 0; t < whole.triangles.size(); ++t)
    for (int k = 0; k < 3; ++k)
      EXPECT_EQ(soup.vertices[soup.triangles[t][k]], whole.vertices[whole.triangles[t][k]]);
}

TEST(CleanSheet, VerticesOfNoTriangleAndTrianglesThatAreThereTwiceGo) {
  const TriangleMesh whole = cornea();
  TriangleMesh mesh = whole;
  mesh.vertices.emplace_back(0.5, 0.3, -3);
  mesh.normals.emplace_back(0, 0, 1);
  for (auto [a, b, c] : whole.triangles) mesh.triangles.push_back({a, c, b});  // both sides, as some export
  cleaned(mesh);
  cleaned(mesh);
  TriangleMesh expected = whole;
  cleaned(expected);
  expect_same(mesh, expected);
}

TEST(CleanSheet, MixedWindingsAreTurned) {
  const TriangleMesh whole = cornea();
  TriangleMesh mesh = whole;
  for (std::size_t t = 0; t < mesh.triangles.size(); t += 3)
    std::swap(mesh.triangles[t][1], mesh.triangles[t][2]);
  EXPECT_THAT(cleaned(mesh), IsEmpty());
  expect_same(mesh, whole);

  TriangleMesh strip;  // Moebius's: five squares, the last one turned onto the first
  for (int k = 0; k < 5; ++k) {
    const double around = 2 * pi * k / 5, turn = pi * k / 5;
    const Eigen::Vector3d middle(4 * std::cos(around), 4 * std::sin(around), 0),
        across(std::cos(turn) * std::cos(around), std::cos(turn) * std::sin(around), std::sin(turn));
    strip.vertices.emplace_back(middle + across);
    strip.vertices.emplace_back(middle - across);
  }
  for (int k = 0; k < 5; ++k) {
    const int a = 2 * k, b = a + 1, c = k < 4 ? a + 2 : 1, d = k < 4 ? a + 3 : 0;
    strip.triangles.push_back({a, b, c});
    strip.triangles.push_back({b, d, c});
  }
  EXPECT_THAT([&] { cleaned(strip); }, testing::ThrowsMessage<Error>(HasSubstr("one-sided")));
}

TEST(CleanSheet, NormalsThatAreNotTheTrianglesGoWithAWord) {
  TriangleMesh upward = cornea();
  for (Eigen::Vector3d& normal : upward.normals) normal = {0, 0, 1};
  TriangleMesh mixed = cornea();
  for (std::size_t i = 30; i < 200; i += 3) mixed.normals[i] = -mixed.normals[i];
  // As narrow as a cornea's sheet may be: 12 degrees steep at its rim.
  TriangleMesh narrow = testing_eye::jittered_sheet(*make_sphere(7.8), 1.6, 120, 3);
  for (Eigen::Vector3d& normal : narrow.normals) normal = {0, 0, 1};
  for (TriangleMesh mesh : {upward, mixed, narrow}) {
    EXPECT_THAT(cleaned(mesh), ElementsAre(HasSubstr("normals lean")));
    EXPECT_THAT(mesh.normals, IsEmpty());
  }
}

TEST(CleanSheet, WithoutTrianglesIsRefused) {
  TriangleMesh points = cornea();
  points.triangles.clear();
  EXPECT_THAT([&] { cleaned(points); }, testing::ThrowsMessage<Error>(HasSubstr("no triangles")));
}

/// Of a file, with the triangles met: the largest angle between the surface's normals and the formula's.
double largest_error_deg(const std::filesystem::path& file) {
  const Surface surface =
      read_mesh_surface("cornea_anterior", file, std::nullopt, "cornea", MeshInterpolation::triangles);
  const ShapePtr formula = make_conic(7.72, -0.26);
  double largest = 0;
  for (double x = -3; x <= 3; x += 0.7)
    for (double y = -3; y <= 3; y += 0.7)
      largest = std::max(largest,
                         std::acos(std::min(1.0, surface.shape->normal(x, y)->dot(*formula->normal(x, y)))));
  return largest / degree;
}

TEST(CleanSheet, OfAFileItIsTheSurface) {
  const test::TemporaryFolder folder;
  const TriangleMesh mesh = cornea();
  // Flat shading, as Blender writes it: a normal a face, all corners of a vertex with another.
  std::string text;
  const auto line = [&](const char* key, const Eigen::Vector3d& v) {
    text += std::string(key) + " " + std::to_string(v.x()) + " " + std::to_string(v.y()) + " " +
            std::to_string(v.z()) + "\n";
  };
  for (const Eigen::Vector3d& v : mesh.vertices) line("v", v);
  for (const auto& [a, b, c] : mesh.triangles)
    line("vn", (mesh.vertices[b] - mesh.vertices[a]).cross(mesh.vertices[c] - mesh.vertices[a]).normalized());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    text += "f";
    for (const int corner : mesh.triangles[t])
      text += " " + std::to_string(corner + 1) + "//" + std::to_string(t + 1);
    text += "\n";
  }
  write_file(folder.path() / "flat.obj", text);
  EXPECT_LT(largest_error_deg(folder.path() / "flat.obj"), 0.2);

  TriangleMesh upward = mesh;
  for (Eigen::Vector3d& normal : upward.normals) normal = {0, 0, 1};
  write_mesh(folder.path() / "upward.ply", upward, false);
  EXPECT_LT(largest_error_deg(folder.path() / "upward.ply"), 0.2);

  TriangleMesh mixed = mesh;
  mixed.normals.clear();
  for (std::size_t t = 0; t < mixed.triangles.size(); t += 2)
    std::swap(mixed.triangles[t][1], mixed.triangles[t][2]);
  write_mesh(folder.path() / "mixed.vtp", mixed, false);
  EXPECT_LT(largest_error_deg(folder.path() / "mixed.vtp"), 0.2);
}

}  // namespace
}  // namespace emmetrope
