// Device float32 against the host's float64 reference: directions of rays that leave the eye.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "pipeline/base/frames.hpp"
#include "pipeline/eye/model/mesh_shape.hpp"
#include "pipeline/eye/optics/exact_trace.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "raytrace/retina/pupil_aim.hpp"
#include "raytrace/spectacle/spectacle.hpp"
#include "raytrace/system/sheet_mesh.hpp"
#include "raytrace/tracer/tracer.hpp"

namespace emmetrope::raytrace {
namespace {

constexpr double arcmin = degree / 60;

/// Rays from random retina points of the field to random points of the stop's image.
std::vector<Ray> random_rays(const EyeModel& eye, int count) {
  RetinalGrid grid;
  const PupilAim aim(eye, grid, eye.reference_wavelength_nm);
  std::mt19937 random(7);
  const auto unit = [&] { return random() / 4294967296.0; };
  std::vector<Ray> rays;
  for (int i = 0; i < count; ++i) {
    const double x = 6 * (unit() - 0.5), y = 6 * (unit() - 0.5);
    const Eigen::Vector3d retina = retina_point(eye, x, y).position_mm;
    const AimEllipse ellipse = aim.at(x, y);
    const double rho = 0.99 * std::sqrt(unit()), angle = 2 * pi * unit();
    const Eigen::Vector2d p =
        ellipse.centre_mm + ellipse.from_disc * (rho * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
    rays.push_back({retina, (Eigen::Vector3d(p.x(), p.y(), aim.plane_z_mm()) - retina).normalized()});
  }
  return rays;
}

struct Difference {
  double direction_rms_arcmin = 0, direction_max_arcmin = 0, position_rms_um = 0;
  int reached = 0, other_state = 0;
};

Difference compare(const Tracer& tracer, const EyeModel& eye, const EyeModel& truth,
                   const TraceSettings& settings, int count) {
  const auto rays = random_rays(truth, count);
  const auto found = tracer.exit_rays(eye, rays, settings);
  const ExactTracer exact(truth, settings.wavelength_nm.value_or(truth.reference_wavelength_nm));
  Difference d;
  for (int i = 0; i < count; ++i) {
    const auto end = exact.trace_end(rays[i]);
    if (end.state != found[i].state) ++d.other_state;
    if (end.state != RayState::reached || found[i].state != RayState::reached) continue;
    ++d.reached;
    const double angle = found[i].direction.normalized().cross(end.direction).norm() / arcmin;
    d.direction_rms_arcmin += angle * angle;
    d.direction_max_arcmin = std::max(d.direction_max_arcmin, angle);
    // across the ray: where along it a point is taken does not matter
    const Eigen::Vector3d offset = found[i].position_mm - end.position_mm;
    d.position_rms_um += 1e6 * (offset - offset.dot(end.direction) * end.direction).squaredNorm();
  }
  d.direction_rms_arcmin = std::sqrt(d.direction_rms_arcmin / d.reached);
  d.position_rms_um = std::sqrt(d.position_rms_um / d.reached);
  return d;
}

class Parity : public testing::TestWithParam<std::string> {};

TEST_P(Parity, AnalyticEyeOnTheDeviceFollowsTheReference) {
  const Tracer tracer("");
  const EyeModel eye = make_eye(GetParam(), {});
  const Difference d = compare(tracer, eye, eye, {}, 20000);
  std::printf("%s: direction rms %.5f max %.5f arcmin, position rms %.4f um, reached %d, other state %d\n",
              GetParam().c_str(), d.direction_rms_arcmin, d.direction_max_arcmin, d.position_rms_um,
              d.reached, d.other_state);
  EXPECT_GT(d.reached, 19000);
  EXPECT_LE(d.other_state, 2);  // the rim of a stop, to float32
  EXPECT_LE(d.direction_rms_arcmin, 0.01);
  EXPECT_LE(d.position_rms_um, 0.05);
}
INSTANTIATE_TEST_SUITE_P(SchematicEyes, Parity,
                         testing::Values("gullstrand", "gullstrand-emsley", "le-grand", "navarro",
                                         "escudero-sanz-navarro", "arizona", "bennett-rabbetts",
                                         "liou-brennan", "atchison:-4"));

TEST(GradientLens, MayEndAtSurfacesOfOtherTiltsAndCentres) {
  const Tracer tracer("");
  for (const double toric_mm : {0.0, 0.4, 1.5}) {  // half the difference of the front's radii
    EyeModel eye = make_eye("liou-brennan", {});
    eye.surface("lens_anterior").tilt_deg = {-4, 5};
    eye.surface("lens_posterior").tilt_deg = {2, -2.5};
    eye.surface("lens_posterior").decentre_mm = {0.2, -0.1};
    if (toric_mm > 0)
      eye.surface("lens_anterior").shape = make_biconic(12 + toric_mm, 12 - toric_mm, -0.94, -0.5, 30);
    const Difference d = compare(tracer, eye, eye, {}, 20000);
    std::printf("toric by %g mm: direction rms %.5f max %.5f arcmin, position rms %.4f um\n", toric_mm,
                d.direction_rms_arcmin, d.direction_max_arcmin, d.position_rms_um);
    EXPECT_GT(d.reached, 19000);
    EXPECT_LE(d.other_state, 2);
    EXPECT_LE(d.direction_rms_arcmin, 0.01);
    EXPECT_LE(d.position_rms_um, 0.05);
  }
}

/// Every refracting surface as a sheet of 5 mm semi-diameter.
EyeModel with_sheets(EyeModel eye) {
  for (auto& surface : eye.surfaces)
    if (!surface.is_stop() && surface.name != "retina") surface.semi_diameter_mm = 5;
  return eye;
}

struct MeshCase {
  const char* eye;
  Representation representation;
  int vertices;
  double limit_arcmin;
};
class MeshAccuracyOf : public testing::TestWithParam<MeshCase> {};

TEST_P(MeshAccuracyOf, JitteredMeshesFollowTheFormulas) {
  const MeshCase& c = GetParam();
  const EyeModel eye = make_eye(c.eye, {0, {}, 4.0});
  TraceSettings settings;
  settings.representation = c.representation;
  settings.vertices = {c.vertices};
  const Difference d = compare(Tracer(""), with_sheets(eye), eye, settings, 20000);
  std::printf("%s %s %d vertices: direction rms %.4f max %.4f arcmin, position rms %.4f um, other state %d\n",
              c.eye, c.representation == Representation::smooth ? "smooth" : "triangles", c.vertices,
              d.direction_rms_arcmin, d.direction_max_arcmin, d.position_rms_um, d.other_state);
  EXPECT_LE(d.direction_rms_arcmin, c.limit_arcmin);
  EXPECT_GT(d.reached, 19900);
}
INSTANTIATE_TEST_SUITE_P(Conics, MeshAccuracyOf,
                         testing::Values(MeshCase{"navarro", Representation::triangles, 565, 0.2},
                                         MeshCase{"navarro", Representation::triangles, 1516, 0.1},
                                         MeshCase{"gullstrand", Representation::triangles, 1516, 0.1},
                                         MeshCase{"navarro", Representation::smooth, 565, 0.01},
                                         MeshCase{"navarro", Representation::smooth, 1516, 0.01},
                                         MeshCase{"gullstrand", Representation::smooth, 565, 0.01}));

TEST(MeshAccuracy, SmoothFollowsABiconicWithComaAndTrefoil) {
  EyeModel eye = make_eye("navarro", {0, {}, 4.0});
  std::vector<double> terms_um(10, 0.0);
  terms_um[6] = terms_um[7] = 5;
  eye.surface("cornea_anterior").shape = make_zernike(7.95, 7.7, -0.23, -0.2, 15, 5, terms_um);
  TraceSettings settings;
  settings.representation = Representation::smooth;
  settings.vertices = {565};
  const Difference d = compare(Tracer(""), with_sheets(eye), eye, settings, 5000);
  std::printf("irregular cornea smooth 565 vertices: direction rms %.4f max %.4f arcmin\n",
              d.direction_rms_arcmin, d.direction_max_arcmin);
  EXPECT_LE(d.direction_rms_arcmin, 0.03);
  EXPECT_GT(d.reached, 4950);
}

TEST(MeshAccuracy, TrianglesWithNormalsOfTheMeshAlone) {
  const EyeModel eye = make_eye("navarro", {0, {}, 4.0});
  EyeModel meshed = with_sheets(eye);
  for (auto& surface : meshed.surfaces) {
    if (surface.is_stop() || surface.name == "retina") continue;
    TriangleMesh sheet = sheet_mesh(*surface.shape, default_semi_diameter_mm(surface), 565, 0.25);
    sheet.normals.clear();
    surface.shape = std::make_shared<MeshShape>(sheet, MeshInterpolation::triangles);
  }
  TraceSettings settings;
  settings.representation = Representation::triangles;
  const Difference d = compare(Tracer(""), meshed, eye, settings, 20000);
  std::printf("navarro triangles 565 vertices, estimated normals: direction rms %.4f max %.4f arcmin\n",
              d.direction_rms_arcmin, d.direction_max_arcmin);
  EXPECT_LE(d.direction_rms_arcmin, 0.4);
  EXPECT_GT(d.reached, 19900);
}

TEST(Triangles, NoRayIsLostAtVerticesAndEdges) {
  // Rays parallel to the axis, from the vitreous, exactly through vertices and edge points of the last
  // surface's mesh.
  EyeModel eye = with_sheets(make_eye("gullstrand-emsley", {0, {}, 20.0}));
  TraceSettings settings;
  settings.representation = Representation::triangles;
  settings.vertices = {800};
  const Surface& last = eye.surfaces[eye.surfaces.size() - 2];
  const TriangleMesh sheet = sheet_mesh(*last.shape, default_semi_diameter_mm(last), 800, 0.25);
  std::vector<Ray> rays;
  const double z = -last.position_mm - 3;
  for (const auto& t : sheet.triangles)
    for (int e = 0; e < 3; ++e)
      for (int k = 0; k < 40; ++k) {
        const Eigen::Vector3d p =
            sheet.vertices[t[e]] + (sheet.vertices[t[(e + 1) % 3]] - sheet.vertices[t[e]]) * (k / 40.0);
        if (p.head<2>().norm() < 2.5) rays.push_back({{p.x(), p.y(), z}, Eigen::Vector3d::UnitZ()});
      }
  ASSERT_GT(rays.size(), 40000U);
  int lost = 0;
  for (const auto& exit : Tracer("").exit_rays(eye, rays, settings)) lost += exit.state != RayState::reached;
  EXPECT_EQ(lost, 0);
}

TEST(FoldedSheets, MeetTheirNearestTriangle) {
  // A posterior lens whose sheet folds back at its rim, as a segmented capsule does: no height field along
  // the axis. Rays that pass near the rim meet both leaves.
  EyeModel eye = make_eye("navarro", {0, {}, 6.0});
  Surface& lens = eye.surface("lens_posterior");
  TriangleMesh sheet;
  constexpr int rings = 40, spokes = 64;
  const auto add = [&](double r, double z) {
    for (int k = 0; k < spokes; ++k)
      sheet.vertices.emplace_back(r * std::cos(2 * pi * k / spokes), r * std::sin(2 * pi * k / spokes), z);
  };
  sheet.vertices.emplace_back(0, 0, 0);
  for (int i = 1; i <= rings; ++i) {
    const double r = 4.5 * i / rings;
    add(r, -lens.shape->depth_mm(r, 0).value());
  }
  const double rim_z = sheet.vertices.back().z();
  for (int i = 1; i <= rings / 2; ++i)
    add(4.5 - 4.0 * i / rings, rim_z + 1.0 * i / rings);  // the leaf that folds back
  for (int k = 0; k < spokes; ++k) sheet.triangles.push_back({0, 1 + k, 1 + (k + 1) % spokes});
  for (int i = 0; i + 1 < rings + rings / 2; ++i)
    for (int k = 0; k < spokes; ++k) {
      const int a = 1 + i * spokes + k, b = 1 + i * spokes + (k + 1) % spokes;
      const bool folded = i + 1 >= rings;  // both leaves look out of the eye
      sheet.triangles.push_back({a, folded ? b : a + spokes, folded ? a + spokes : b});
      sheet.triangles.push_back({b, folded ? b + spokes : a + spokes, folded ? a + spokes : b + spokes});
    }
  const auto mesh = std::make_shared<MeshShape>(sheet, MeshInterpolation::triangles);
  ASSERT_EQ(mesh->patch(), nullptr);
  lens.shape = mesh;
  const Difference d = compare(Tracer(""), eye, eye, {}, 5000);
  std::printf("folded sheet: rms %.5f max %.5f arcmin, reached %d, other state %d\n", d.direction_rms_arcmin,
              d.direction_max_arcmin, d.reached, d.other_state);
  EXPECT_GT(d.reached, 4000);
  EXPECT_LE(d.other_state, 2);
  EXPECT_LE(d.direction_rms_arcmin, 0.01);
}

TEST(Bodies, RaysBesideAnAccommodatedNucleusAreNotLost) {
  // At full accommodation Gullstrand's nucleus ends 2.3 mm from the axis, where its slope is 60 degrees.
  const EyeModel eye = make_eye("gullstrand", {10.87, {}, 6.0});
  for (const Representation way : {Representation::analytic, Representation::smooth}) {
    TraceSettings settings;
    settings.representation = way;
    const Difference d = compare(Tracer(""), eye, eye, settings, 20000);
    std::printf("gullstrand 10.87 D, 6 mm, %s: rms %.5f arcmin, reached %d, other state %d\n",
                way == Representation::smooth ? "smooth" : "analytic", d.direction_rms_arcmin, d.reached,
                d.other_state);
    EXPECT_GT(d.reached, 19900);
    EXPECT_LE(d.other_state, 2);  // the edge itself, to float32
    EXPECT_LE(d.direction_rms_arcmin, 0.01);
  }
}

}  // namespace
}  // namespace emmetrope::raytrace
