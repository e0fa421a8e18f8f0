// Where rays meet the triangles of an eye's surface: the device's walk and the host's hierarchy against
// Embree.
#include <gtest/gtest.h>

#include <random>

#include "pipeline/eye/model/mesh_shape.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "raytrace/system/sheet_mesh.hpp"
#include "raytrace/tracer/tracer.hpp"
#include "tests/support/embree.hpp"

namespace emmetrope::raytrace {
namespace {

/// Distance to the nearest triangle by Embree, infinite where there is none.
std::vector<double> embree_distances(const TriangleMesh& mesh, const std::vector<Ray>& rays) {
  RTCDevice device = rtcNewDevice(nullptr);
  RTCScene scene = rtcNewScene(device);
  rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* p = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0,
                                                        RTC_FORMAT_FLOAT3, 12, mesh.vertices.size()));
  for (const auto& vertex : mesh.vertices)
    for (int c = 0; c < 3; ++c) *p++ = static_cast<float>(vertex[c]);
  auto* t = static_cast<unsigned*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0,
                                                           RTC_FORMAT_UINT3, 12, mesh.triangles.size()));
  for (const auto& triangle : mesh.triangles)
    for (const int corner : triangle) *t++ = static_cast<unsigned>(corner);
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene, geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(scene);
  std::vector<double> distances;
  for (const Ray& ray : rays) {
    RTCRayHit found{};
    const Eigen::Vector3f o = ray.origin.cast<float>(), d = ray.direction.cast<float>();
    found.ray.org_x = o.x(), found.ray.org_y = o.y(), found.ray.org_z = o.z();
    found.ray.dir_x = d.x(), found.ray.dir_y = d.y(), found.ray.dir_z = d.z();
    found.ray.tfar = std::numeric_limits<float>::infinity();
    found.ray.mask = ~0U;
    found.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    test::nearest_hit(scene, found);
    distances.push_back(found.ray.tfar);
  }
  rtcReleaseScene(scene);
  rtcReleaseDevice(device);
  return distances;
}

TEST(EyeMesh, RaysMeetTheTrianglesThatEmbreeFinds) {
  // An eye that is a cornea alone, so that a ray leaves it where it meets the mesh.
  EyeModel eye = make_eye("gullstrand-emsley");
  const auto inner = [](const Surface& s) { return s.name != "retina" && s.name != "cornea_anterior"; };
  eye.surfaces.erase(std::remove_if(eye.surfaces.begin(), eye.surfaces.end(), inner), eye.surfaces.end());
  ASSERT_EQ(eye.surfaces.size(), 2U);
  Surface& cornea = eye.surfaces.front();
  const TriangleMesh sheet = sheet_mesh(*make_conic(7.8, -0.3), 5.5, 1516, 0.25);
  cornea.shape = std::make_shared<MeshShape>(sheet, MeshInterpolation::triangles);

  std::mt19937 random(11);
  std::uniform_real_distribution<double> unit(-1, 1);
  std::vector<Ray> rays;
  while (rays.size() < 40000) {
    const Eigen::Vector3d retina(3 * unit(random), 3 * unit(random), -23),
        front(5 * unit(random), 5 * unit(random), -1);
    if (front.head<2>().norm() < 5) rays.push_back({retina, (front - retina).normalized()});
  }
  const std::vector<double> expected = embree_distances(sheet, rays);
  TraceSettings settings;
  settings.representation = Representation::triangles;
  const std::vector<ExitRay> walked = Tracer("").exit_rays(eye, rays, settings);
  const auto& shape = dynamic_cast<const MeshShape&>(*cornea.shape);
  constexpr double float32_mm = 23 * 6e-8 * 8;  // some roundings over the ray's length
  int met = 0;
  for (std::size_t k = 0; k < rays.size(); ++k) {
    ASSERT_TRUE(std::isfinite(expected[k]));
    const auto hit = shape.intersect_triangles(rays[k]);
    ASSERT_TRUE(hit);
    EXPECT_NEAR(hit->distance_mm, expected[k], float32_mm);
    if (walked[k].state == RayState::tir) continue;
    ASSERT_EQ(walked[k].state, RayState::reached);
    EXPECT_NEAR((walked[k].position_mm - rays[k].origin).dot(rays[k].direction), expected[k], float32_mm);
    ++met;
  }
  EXPECT_GT(met, 39000);
}

}  // namespace
}  // namespace emmetrope::raytrace
