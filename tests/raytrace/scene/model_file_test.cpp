// Scenes of meshes: hits and shadows against Embree, shading against Phong's formula, models from files.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <set>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/optics/exact_trace.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "raytrace/retina/pupil_aim.hpp"
#include "raytrace/scene/model_file.hpp"
#include "raytrace/scene/scene_json.hpp"
#include "raytrace/scene/scene_model.hpp"
#include "raytrace/tracer/tracer.hpp"
#include "tests/support/embree.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope::raytrace {
namespace {

MeshObject ball(const Eigen::Vector3d& centre, double radius, int n, double specular) {
  MeshObject mesh;
  for (int j = 0; j <= n; ++j)
    for (int i = 0; i <= 2 * n; ++i) {
      const double polar = pi * j / n, around = pi * i / n;
      const Eigen::Vector3d normal(std::sin(polar) * std::cos(around), std::cos(polar),
                                   std::sin(polar) * std::sin(around));
      mesh.normals.push_back(normal);
      mesh.positions_mm.push_back(centre + radius * normal);
    }
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < 2 * n; ++i) {
      const int a = j * (2 * n + 1) + i, b = a + 2 * n + 1;
      mesh.triangles.push_back({a, b, a + 1});
      mesh.triangles.push_back({a + 1, b, b + 1});
    }
  mesh.material.colour = Eigen::Vector3d::Constant(0.8);
  mesh.material.specular = specular;
  mesh.material.shininess = 20;
  return mesh;
}

MeshObject floor_at(double y, double z, double half) {
  MeshObject mesh;
  mesh.positions_mm = {{-half, y, z - half}, {half, y, z - half}, {half, y, z + half}, {-half, y, z + half}};
  mesh.normals.assign(4, Eigen::Vector3d::UnitY());
  mesh.triangles = {{0, 2, 1}, {0, 3, 2}};
  mesh.material.colour = Eigen::Vector3d::Constant(0.5);
  return mesh;
}

Scene still_life() {
  Scene scene;
  scene.meshes = {ball({10, 5, 400}, 25, 40, 0.4), ball({-25, -5, 350}, 12, 30, 0), floor_at(-22, 400, 120)};
  scene.lights = {
      Light{false, {120, 150, 250}, Eigen::Vector3d::Constant(0.6), 250},
      Light{true, Eigen::Vector3d(-0.5, 1, -0.4).normalized(), Eigen::Vector3d::Constant(0.3), 0}};
  scene.ambient = Eigen::Vector3d::Constant(0.1);
  scene.background = Eigen::Vector3d::Constant(0.2);
  return scene;
}

/// The whole scene in Embree, and Phong's formula on the host in float64.
class Oracle {
 public:
  explicit Oracle(const Scene& scene)
      : scene_(scene), device_(rtcNewDevice(nullptr)), embree_(rtcNewScene(device_)) {
    rtcSetSceneFlags(embree_, RTC_SCENE_FLAG_ROBUST);
    for (const MeshObject& mesh : scene.meshes) {
      RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
      auto* p = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0,
                                                            RTC_FORMAT_FLOAT3, 12, mesh.positions_mm.size()));
      for (const auto& position : mesh.positions_mm)
        for (int c = 0; c < 3; ++c) *p++ = static_cast<float>(position[c]);
      auto* t = static_cast<unsigned*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0,
                                                               RTC_FORMAT_UINT3, 12, mesh.triangles.size()));
      for (const auto& triangle : mesh.triangles)
        for (const int corner : triangle) *t++ = static_cast<unsigned>(corner);
      rtcCommitGeometry(geometry);
      rtcAttachGeometry(embree_, geometry);
      rtcReleaseGeometry(geometry);
    }
    rtcCommitScene(embree_);
  }
  ~Oracle() {
    rtcReleaseScene(embree_);
    rtcReleaseDevice(device_);
  }
  Oracle(const Oracle&) = delete;
  Oracle& operator=(const Oracle&) = delete;

  double light_along(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const {
    RTCRayHit found{};
    found.ray = ray(origin, direction, 1e30);
    found.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    test::nearest_hit(embree_, found);
    if (found.hit.geomID == RTC_INVALID_GEOMETRY_ID) return scene_.background.x();
    const MeshObject& mesh = scene_.meshes[found.hit.geomID];
    const auto& t = mesh.triangles[found.hit.primID];
    const double u = found.hit.u, v = found.hit.v;
    Eigen::Vector3d n =
        ((1 - u - v) * mesh.normals[t[0]] + u * mesh.normals[t[1]] + v * mesh.normals[t[2]]).normalized();
    if (n.dot(direction) > 0) n = -n;
    const Eigen::Vector3d at = origin + found.ray.tfar * direction;
    double light = scene_.ambient.x() * mesh.material.colour.x();
    for (const Light& lamp : scene_.lights) {
      const Eigen::Vector3d away = lamp.directional ? lamp.at : Eigen::Vector3d(lamp.at - at);
      const double distance = lamp.directional ? 1e30 : away.norm();
      const Eigen::Vector3d towards = away.normalized();
      const double cosine = n.dot(towards);
      if (cosine <= 0) continue;
      RTCRay shadow = ray(at + 0.01 * n, towards, distance);
      test::find_any_hit(embree_, shadow);
      if (shadow.tfar < 0) continue;
      const double strength =
          lamp.colour.x() * (lamp.directional ? 1 : std::pow(lamp.reference_mm / distance, 2));
      const double mirrored = std::max(0.0, (direction - 2 * n.dot(direction) * n).dot(towards));
      light += strength * (mesh.material.colour.x() * cosine +
                           mesh.material.specular * std::pow(mirrored, mesh.material.shininess));
    }
    return light;
  }

 private:
  static RTCRay ray(const Eigen::Vector3d& o, const Eigen::Vector3d& d, double far) {
    RTCRay r{};
    r.org_x = static_cast<float>(o.x()), r.org_y = static_cast<float>(o.y()),
    r.org_z = static_cast<float>(o.z());
    r.dir_x = static_cast<float>(d.x()), r.dir_y = static_cast<float>(d.y()),
    r.dir_z = static_cast<float>(d.z());
    r.tfar = static_cast<float>(far);
    r.mask = ~0U;
    return r;
  }

  const Scene& scene_;
  RTCDevice device_;
  RTCScene embree_;
};

TraceSettings sharp(int pixels, double field_mm) {
  TraceSettings settings;
  settings.grid = {pixels, pixels, field_mm, field_mm, {0, 0}};
  settings.samples = 32;
  settings.wavelength_nm = 589.3;
  settings.verbosity.quiet = true;
  return settings;
}

TEST(MeshScene, AgreesWithEmbreeAndPhong) {
  // Through a pinhole every ray of a pixel is the chief ray, which the host traces.
  EyeOptions options;
  options.pupil_mm = 1e-3;
  const EyeModel eye = make_eye("navarro", options);
  const Scene scene = still_life();
  const TraceSettings settings = sharp(120, 4);
  const auto image = Tracer("").trace(eye, scene, settings).image;
  const Oracle oracle(scene);
  const PupilAim aim(eye, settings.grid, 589.3);
  const ExactTracer exact(eye, 589.3);
  int differ = 0, seen = 0;
  for (int row = 0; row < 120; ++row)
    for (int column = 0; column < 120; ++column) {
      const double x = 4 * ((column + 0.5) / 120 - 0.5), y = 4 * ((row + 0.5) / 120 - 0.5);
      const Eigen::Vector3d retina = retina_point(eye, x, y).position_mm;
      const Eigen::Vector2d p = aim.at(x, y).centre_mm;
      const auto end =
          exact.trace_end({retina, (Eigen::Vector3d(p.x(), p.y(), aim.plane_z_mm()) - retina).normalized()});
      ASSERT_EQ(end.state, RayState::reached);
      const double expected = oracle.light_along(end.position_mm, end.direction.normalized());
      seen += expected != scene.background.x();
      differ += std::abs(image.at(column, row, 1) - expected) > 2e-3;
    }
  std::printf("%d of %d pixels differ by more than 0.002, %d see a mesh\n", differ, 120 * 120, seen);
  EXPECT_GT(seen, 3000);
  // Those on an outline, a crease of the mesh or a shadow's rim, where the pinhole's width decides.
  EXPECT_LT(differ, 120 * 120 / 200);
}

TEST(MeshScene, PlanesAndMeshesHideEachOther) {
  const EyeModel eye = make_eye("navarro", {});
  const auto with_plane_at = [&](double z, bool at_infinity) {
    Scene scene;
    scene.meshes = {ball({0, 0, 500}, 50, 20, 0)};
    scene.ambient = Eigen::Vector3d::Constant(0.5);  // shows 0.4
    TexturedPlane plane;
    plane.centre_mm = {0, 0, at_infinity ? 1 : z};
    plane.at_infinity = at_infinity;
    plane.texture = std::make_shared<const Texture>(Texture{2, 2, 1, {0.9F, 0.9F, 0.9F, 0.9F}});
    scene.planes = {plane};
    return Tracer("").trace(eye, scene, sharp(3, 0.05)).image.at(1, 1, 1);
  };
  EXPECT_NEAR(with_plane_at(400, false), 0.9, 1e-3);
  EXPECT_NEAR(with_plane_at(600, false), 0.4, 1e-3);
  EXPECT_NEAR(with_plane_at(0, true), 0.4, 1e-3);
}

TEST(MeshScene, TurnsWithGaze) {
  // An eye that looks at a ball sees it where one that looks ahead sees one ahead.
  const EyeModel eye = make_eye("navarro", {});
  TraceSettings settings = sharp(40, 3);
  Scene ahead, aside;
  ahead.ambient = aside.ambient = Eigen::Vector3d::Constant(0.1);
  ahead.background = aside.background = Eigen::Vector3d::Zero();
  const Eigen::Vector3d centre(0, 0, -13.5),
      direction = Eigen::Vector3d(std::tan(12 * degree), std::tan(-7 * degree), 1).normalized();
  ahead.meshes = {ball(centre + Eigen::Vector3d(0, 0, 413.5), 15, 60, 0)};
  aside.meshes = {ball(centre + 413.5 * direction, 15, 60, 0)};
  const auto expected = Tracer("").trace(eye, ahead, settings).image;
  settings.pose.gaze.horizontal_deg = 12;
  settings.pose.gaze.vertical_deg = -7;
  const auto found = Tracer("").trace(eye, aside, settings).image;
  double most = 0;
  for (std::size_t i = 0; i < found.values.size(); ++i)
    most = std::max(most, static_cast<double>(std::abs(found.values[i] - expected.values[i])));
  EXPECT_LT(most, 0.001);  // the ball's facets lie elsewhere
}

class ModelFile : public ::testing::Test {
 protected:
  std::filesystem::path write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_.path() / name, std::ios::binary) << text;
    return folder_.path() / name;
  }
  test::TemporaryFolder folder_;
};

const char* const quad_obj =
    "mtllib quad.mtl\nv -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl paint\n"
    "f 1/1 2/2 3/3 4/4\n";

TEST_F(ModelFile, ObjPlyAndGltfAreRead) {
  write("quad.mtl", "newmtl paint\nKd 0.2 0.4 0.6\nKs 0.5 0.5 0.5\nNs 40\n");
  const auto obj = read_model(write("quad.obj", quad_obj));
  ASSERT_EQ(obj.size(), 1U);
  EXPECT_EQ(obj[0].triangles.size(), 2U);
  EXPECT_NEAR(obj[0].material.colour.z(), 0.6, 1e-6);
  EXPECT_NEAR(obj[0].material.specular, 0.5, 1e-6);
  EXPECT_NEAR(obj[0].material.shininess, 40, 1e-4);
  EXPECT_EQ(obj[0].texture_coordinates.size(), obj[0].positions_mm.size());
  EXPECT_NEAR(std::abs(obj[0].normals[0].z()), 1, 1e-6);

  const auto ply = read_model(write("three.ply",
                                    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty "
                                    "float y\nproperty float z\nproperty uchar red\n"
                                    "property uchar green\nproperty uchar blue\nelement face 1\nproperty "
                                    "list uchar int vertex_indices\nend_header\n"
                                    "0 0 0 255 0 188\n1 0 0 255 0 188\n0 1 0 255 0 188\n3 0 1 2\n"));
  ASSERT_EQ(ply.at(0).triangles.size(), 1U);
  EXPECT_NEAR(ply[0].colours.at(0).x(), 1, 1e-6);
  EXPECT_NEAR(ply[0].colours.at(0).z(), 0.5029, 1e-3);  // sRGB 188

  // one triangle: three float32 corners, base64
  const auto gltf =
      read_model(write("three.gltf", R"({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
    "nodes": [{"mesh": 0, "translation": [0, 0, 2]}], "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
    "materials": [{"pbrMetallicRoughness": {"baseColorFactor": [0.25, 0.5, 0.75, 1]}}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}],
    "bufferViews": [{"buffer": 0, "byteLength": 36}],
    "buffers": [{"byteLength": 36, "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]})"));
  ASSERT_EQ(gltf.at(0).triangles.size(), 1U);
  EXPECT_NEAR(gltf[0].positions_mm[0].z(), 2, 1e-6);  // the node's place
  EXPECT_NEAR(gltf[0].material.colour.y(), 0.5, 1e-6);
}

TEST_F(ModelFile, IsPlacedAsAFrontViewShowsIt) {
  write("arrow.obj", "v 0 0 0\nv 2 0 0\nv 0 1 0\nv 0 0 0.5\nf 1 2 3\nf 1 2 4\n");
  const Scene scene =
      read_scene(write("scene.json", R"({"objects": [{"type": "mesh", "file": "arrow.obj", "scale": 10,
      "position_mm": [1, 2, 300]}]})"));
  Eigen::AlignedBox3d box;
  for (const auto& p : scene.meshes.at(0).positions_mm) box.extend(p);
  EXPECT_LT((box.min() - Eigen::Vector3d(-19, 2, 295)).norm(),
            1e-9);  // x to the patient's right, z towards the patient
  EXPECT_LT((box.max() - Eigen::Vector3d(1, 12, 300)).norm(), 1e-9);
}

TEST_F(ModelFile, ASceneKnowsTheFilesItWasReadFrom) {
  write("quad.mtl", "newmtl paint\nKd 1 1 1\nmap_Kd skin.png\n");
  write("quad.obj", quad_obj);
  for (const char* name : {"skin.png", "print.png"})
    write_png(folder_.path() / name, {2, 2, 1, {0, 1, 1, 0}});
  const Scene scene = read_scene(write("scene.json", R"({"objects": [
    {"type": "mesh", "file": "quad.obj", "position_mm": [0, 0, 500]},
    {"type": "plane", "picture": "print.png", "centre_mm": [0, 0, 900], "right_mm": [-10, 0, 0], "up_mm": [0, 10, 0]}]})"));
  std::set<std::string> names;
  for (const auto& file : scene.files) names.insert(file.filename().string());
  EXPECT_EQ(names, (std::set<std::string>{"quad.obj", "quad.mtl", "skin.png", "print.png"}));
}

// Assimp alone reads "3 0 1.7 2" as the vertices 0, 1, 0.
TEST_F(ModelFile, PlyFacesNameWholeVertices) {
  const auto model = [&](const std::string& face) {
    return write(
        "face.ply",
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
        "0 0 0\n1 0 0\n1 1 0\n0 1 0\n" +
            face + "\n");
  };
  EXPECT_EQ(read_model(model("4 0 1 2 3")).at(0).triangles.size(), 2U);
  for (const char* face : {"3 0 1 2.7", "3 0 1.7 2", "3.5 0 1 2 3", "3 0 1 two", "3 0 1 -1", "3 0 1 4"}) try {
      read_model(model(face));
      ADD_FAILURE() << face;
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::input_invalid) << face;
      EXPECT_NE(std::string(error.what()).find("face.ply"), std::string::npos) << error.what();
      EXPECT_EQ(error.remedy(), "copy or export the file again") << face;
    }
}

TEST_F(ModelFile, BadScenesNameFileAndKey) {
  write("quad.mtl", "newmtl paint\n");
  write("quad.obj", quad_obj);
  write("broken.ply", "ply\nformat ascii 1.0\nelement vertex 9\n");
  write("short.ply",
        "ply\nformat ascii 1.0\nelement vertex 9\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n");
  write("binary.ply",
        "ply\nformat binary_little_endian 1.0\nelement vertex 90\nproperty float x\nproperty float "
        "y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\nabc");
  write("index.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n");
  write("short.gltf", R"({"asset": {"version": "2.0"}, "meshes": [)");
  write("empty.obj", "v 0 0 0\n");
  write("point.obj", "v 1 1 1\nv 1 1 1\nv 1 1 1\nf 1 2 3\n");
  const std::string glb = std::string("glTF\2\0\0\0\x1c\0\0\0\x08\0\0\0JSON{}      ", 28);
  write("whole.glb", glb);
  write("one-short.glb", glb.substr(0, 27));
  write("long.glb",
        std::string("glTF\2\0\0\0\x1c\0\0\0\xf4\1\0\xc1JSON{}      ", 28));  // 3 GB of JSON are promised
  const std::string mesh = R"({"objects": [{"type": "mesh", "file": "quad.obj", "position_mm": [0, 0, 300])";
  const auto fails = [&](const std::string& json, const std::string& says) {
    try {
      read_scene(write("scene.json", json));
      ADD_FAILURE() << json;
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find(says), std::string::npos) << error.what();
      EXPECT_NE(error.status(), ExitStatus::fault);
    }
  };
  fails(mesh + R"(, "scale": 1, "size_mm": 3}]})", "scale");
  fails(mesh + R"(, "scale": -1}]})", "scale");
  fails(R"({"objects": [{"type": "mesh", "file": "point.obj", "size_mm": 9, "position_mm": [0, 0, 300]}]})",
        "size_mm");
  fails(mesh + R"(, "gloss": 1}]})", "gloss");
  fails(mesh + R"(, "motion_mm": [0, 0, 600]}]})", "from the eye");
  fails(R"({"objects": [{"type": "mesh", "file": "quad.obj", "position_mm": [0, 0, 0.5]}]})", "position_mm");
  fails(mesh + R"(, "colour": [2, 0, 0]}]})", "colour");
  fails(mesh + R"(}], "lights": [{"type": "point", "position_mm": [0, 0, 0]}]})", "reference_mm");
  fails(mesh + R"(}], "lights": [{"type": "spot", "position_mm": [0, 0, 0]}]})", "lights[0]: type");
  fails(mesh + R"(}], "lights": [{"direction": [0, 0, 1]}]})", "lights[0]");
  fails(mesh + R"(}], "lights": [{"type": "directional", "direction": [0, 0, 0]}]})", "direction");
  const std::string unlit = R"({"objects": [{"type": "plane", "chart": "grid", "centre_mm": [0, 0, 300],
                                "right_mm": [-9, 0, 0], "up_mm": [0, 9, 0]}], )";
  fails(unlit + R"("lights": [{"type": "directional", "direction": [0, 0, 1]}]})", "key \"lights\"");
  fails(unlit + R"("ambient": [0, 0, 0]})", "key \"ambient\"");
  for (const char* file : {"none.obj", "broken.ply", "short.ply", "binary.ply", "index.obj", "short.gltf",
                           "empty.obj", "scene.json"})
    fails(R"({"objects": [{"type": "mesh", "position_mm": [0, 0, 1], "file": ")" + std::string(file) +
              R"("}]})",
          file);
  const auto with_model = [](const std::string& file) {
    return R"({"objects": [{"type": "mesh", "position_mm": [0, 0, 1], "file": ")" + file + R"("}]})";
  };
  for (const char* file : {"one-short.glb", "long.glb"})
    fails(with_model(file), "ends before what its header promises");
  fails(with_model("whole.glb"), "cannot be read");  // it is whole, and empty
  fails(with_model(std::string(5000, 'x') + ".obj"), "there is no file");
}

}  // namespace
}  // namespace emmetrope::raytrace
