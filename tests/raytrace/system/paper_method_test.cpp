// The paper's algorithm against the float64 reference and against what its definition says of the aim.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/model/mesh_shape.hpp"
#include "pipeline/eye/optics/exact_trace.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "raytrace/scene/scene_model.hpp"
#include "raytrace/system/paper_method.hpp"
#include "raytrace/system/sheet_mesh.hpp"
#include "raytrace/tracer/tracer.hpp"

namespace emmetrope::raytrace {
namespace {

/// Plain means of the unit normals of the faces around each vertex, written out once more.
void set_mean_normals(TriangleMesh& mesh) {
  mesh.normals.assign(mesh.vertices.size(), Eigen::Vector3d::Zero());
  for (const auto& t : mesh.triangles) {
    Eigen::Vector3d n = (mesh.vertices[t[1]] - mesh.vertices[t[0]])
                            .cross(mesh.vertices[t[2]] - mesh.vertices[t[0]])
                            .normalized();
    if (n.z() < 0) n = -n;
    for (const int v : t) mesh.normals[v] += n;
  }
  for (auto& n : mesh.normals) n.normalize();
}

TEST(EveryTriangle, FollowsTheHostsHierarchy) {
  EyeModel eye = make_eye("navarro", {0, {}, 4.0});
  for (auto& surface : eye.surfaces) {
    if (surface.is_stop() || surface.name == "retina") continue;
    TriangleMesh sheet = sheet_mesh(*surface.shape, default_semi_diameter_mm(surface), 300, 0.25);
    set_mean_normals(sheet);
    surface.shape = std::make_shared<MeshShape>(sheet, MeshInterpolation::triangles);
  }
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(-1, 1);
  std::vector<Ray> rays;
  const double z = -eye.axial_length_mm();
  while (rays.size() < 2000) {
    const Eigen::Vector3d from(2 * unit(random), 2 * unit(random), z + 0.3),
        to(1.4 * unit(random), 1.4 * unit(random), -7.6);
    rays.push_back({from, (to - from).normalized()});
  }
  TraceSettings settings;
  settings.representation = Representation::every_triangle;
  const auto found = Tracer("").exit_rays(eye, rays, settings);
  const ExactTracer exact(eye, eye.reference_wavelength_nm);
  double square = 0;
  int both = 0, other_state = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const auto end = exact.trace_end(rays[i]);
    other_state += end.state != found[i].state;
    if (end.state != RayState::reached || found[i].state != RayState::reached) continue;
    square += found[i].direction.normalized().cross(end.direction).squaredNorm();
    ++both;
  }
  const double rms_arcmin = std::sqrt(square / both) / (degree / 60);
  std::printf("every triangle: rms %.5f arcmin over %d rays\n", rms_arcmin, both);
  EXPECT_GT(both, 1500);  // the stop cuts some
  EXPECT_LE(other_state, 1);
  EXPECT_LT(rms_arcmin, 0.01);
}

TEST(PaperMethod, CapLiesOverThePosteriorLens) {
  const EyeModel eye = make_eye("gullstrand", {0, {}, 4.0});
  const auto cap = aim_cap(eye, {{"lens_posterior", 0}});
  EXPECT_NEAR(cap[2], -7.2, 1e-6);
  EXPECT_NEAR(cap[3], -6.0, 1e-6);
  EXPECT_NEAR(cap[4], -(6 - std::sqrt(32.0)), 1e-6);  // 2 mm from the axis
  EXPECT_EQ(without_stop(eye).stop(), nullptr);
}

/// A chart whose brightness grows linearly across the field, so that a pixel's value is the mean place that
/// its rays reach.
Scene ramp() {
  Texture texture{512, 2, 1, {}};
  for (int row = 0; row < 2; ++row)
    for (int column = 0; column < 512; ++column) texture.values.push_back(static_cast<float>(column) / 511);
  Scene scene;
  TexturedPlane plane;
  plane.centre_mm = {0, 0, 2000};
  plane.right_mm = {-400, 0, 0};
  plane.up_mm = {0, 400, 0};
  plane.texture = std::make_shared<const Texture>(std::move(texture));
  scene.planes.push_back(plane);
  return scene;
}

TEST(PaperMethod, MeshAndFormulaSeeTheSameWithTheSameRays) {
  const EyeModel eye = make_eye("gullstrand", {0, {}, 4.0});
  TraceSettings settings;
  settings.grid = {12, 12, 3, 3, {0, 0}};
  settings.samples = 512;
  settings.wavelength_nm = 589.3;
  settings.method = Method::paper;
  settings.vertices = {800};
  settings.verbosity.quiet = true;
  const Tracer tracer("");
  const Scene scene = ramp();
  const auto mesh = tracer.trace(eye, scene, settings);
  settings.representation = Representation::analytic;
  const auto formula = tracer.trace(eye, scene, settings);
  settings.method = Method::pupil;
  const auto pupil = tracer.trace(eye, scene, settings);
  EXPECT_EQ(mesh.states.at(RayState::vignetted), 0U);
  // 800 vertices with mean normals bend single rays by about 3 arcmin rms, 0.0024 of the ramp, the mean of
  // the some hundred triangles in the pupil by a tenth of it. Random points on the cap and even ones over the
  // pupil: the beam's spread of 0.8 mm over 500 mm is 0.001 of the ramp; a cap that lies wrong by 0.1 mm
  // shows as 0.01 in the defocused part of the ramp.
  for (std::size_t i = 0; i < mesh.image.values.size(); ++i) {
    EXPECT_NEAR(mesh.image.values[i], formula.image.values[i], 2e-3);
    EXPECT_NEAR(formula.image.values[i], pupil.image.values[i], 2e-3);
  }
}

TEST(PaperMethod, RetinaAndSurfacesTakeTheirOwnVertexCounts) {
  const EyeModel eye = make_eye("gullstrand", {10.87, {}, 3.0});
  TraceSettings settings;
  settings.grid = {8, 8, 3, 3, {0, 0}};
  settings.samples = 32;
  settings.wavelength_nm = 589.3;
  settings.representation = Representation::triangles;
  settings.verbosity.quiet = true;
  const Tracer tracer("");
  const auto scene = make_scene("letters:distance_mm=92");
  settings.vertices = {973, 1516, 799, 799, 565, 723, 613};
  const auto result = tracer.trace(eye, *scene, settings);
  EXPECT_GT(result.states.at(RayState::reached), result.rays * 9 / 10);
  settings.vertices = {100, 200};
  EXPECT_THROW(tracer.trace(eye, *scene, settings), Error);
  settings.vertices = {800};
  settings.method = Method::paper;
  settings.representation = Representation::smooth;
  EXPECT_THROW(tracer.trace(eye, *scene, settings), Error);
}

}  // namespace
}  // namespace emmetrope::raytrace
