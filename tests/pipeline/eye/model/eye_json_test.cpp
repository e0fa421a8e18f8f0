#include <gmock/gmock.h>
#include <unistd.h>

#include <filesystem>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/eye/commands/describe_eye.hpp"
#include "pipeline/eye/model/eye_model.hpp"
#include "pipeline/eye/model/mesh_shape.hpp"
#include "pipeline/eye/optics/paraxial.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "tests/support/sheet.hpp"

namespace emmetrope {
namespace {

std::filesystem::path scratch(const std::string& name) {
  std::filesystem::path folder =
      std::filesystem::path(testing::TempDir()) / ("emmetrope-eye-json-" + std::to_string(::getpid())) / name;
  std::filesystem::create_directories(folder);
  return folder;
}

const char* const complete = R"({"name": "example", "reference_wavelength_nm": 555,
 "media": {"cornea": {"index": 1.376}, "aqueous": {"index": 1.336},
           "lens": {"index": 1.42, "cauchy": [1.4, 0.004, 0.0001]}, "vitreous": {"index": 1.336}},
 "surfaces": [
   {"name": "cornea_anterior", "type": "biconic", "position_mm": 0.0, "radius_mm": [7.95, 7.70], "q": [-0.23, -0.23],
    "axis_deg": 0, "semi_diameter_mm": 6.0, "decentre_mm": [0, 0], "tilt_deg": [0, 0], "medium_after": "cornea"},
   {"name": "cornea_posterior", "type": "conic", "position_mm": 0.55, "radius_mm": 6.5, "q": 0, "medium_after": "aqueous"},
   {"name": "iris", "type": "stop", "position_mm": 3.6, "diameter_mm": 4.0},
   {"name": "lens_anterior", "type": "conic", "position_mm": 3.6, "radius_mm": 10.2, "q": -3.1316, "medium_after": "lens"},
   {"name": "lens_posterior", "type": "sphere", "position_mm": 7.6, "radius_mm": -6.0, "medium_after": "vitreous"},
   {"name": "retina", "type": "sphere", "position_mm": 24.0, "radius_mm": -12.0}]})";

TEST(EyeJson, TheContractsExampleIsRead) {
  const EyeModel eye = eye_from_json(Json::parse(complete), ".");
  EXPECT_EQ(eye.surfaces.size(), 6u);
  EXPECT_EQ(eye.surface("iris").stop_diameter_mm, 4);
  EXPECT_EQ(eye.surface("cornea_anterior").semi_diameter_mm, 6);
  EXPECT_NEAR(eye.medium("lens").index_at(555, 555), 1.42, 1e-15);
  EXPECT_GT(paraxial_refraction(eye, 555).J0_D, 0.5);  // steep vertical meridian
  EXPECT_EQ(eye_from_json(to_json(eye), ".").surfaces.size(), 6u);
}

TEST(EyeJson, EverySchematicEyeSurvivesTheFile) {
  for (const std::string& name : schematic_eye_names()) {
    const EyeModel eye = make_eye(name);
    const std::filesystem::path file = scratch("schematic") / "eye.json";
    write_eye(file, eye);
    const EyeModel again = read_eye(file);
    EXPECT_EQ(to_json(again), to_json(eye)) << name;
    EXPECT_EQ(cardinal_points(again, 610).power_D, cardinal_points(eye, 610).power_D) << name;
  }
}

// The sides of the nucleus of Gullstrand's accommodated eye meet 2.3 mm from the axis, and light passes beside it.
TEST(EyeJson, ABodyWithinOneMediumMayEndWithinThePupil) {
  EyeModel eye = make_eye("gullstrand", [] {
    EyeOptions options;
    options.accommodation_parameter = 10.87;
    return options;
  }());
  for (const double pupil_mm : {4.0, 5.0, 8.0}) {
    eye.set_stop_diameter(pupil_mm);
    EXPECT_EQ(to_json(eye_from_json(to_json(eye), ".")), to_json(eye)) << pupil_mm;
  }
}

// An implant of 6 mm beneath a wide pupil: its sides would meet beyond its edge.
TEST(EyeJson, ALensMayEndWithinThePupil) {
  Json json = Json::parse(complete);
  json["surfaces"][2]["diameter_mm"] = 8;
  json["surfaces"][3] = {{"name", "lens_anterior"}, {"type", "sphere"},      {"position_mm", 3.6},
                         {"radius_mm", 14.3},       {"semi_diameter_mm", 3}, {"medium_after", "lens"}};
  json["surfaces"][4] = {{"name", "lens_posterior"}, {"type", "sphere"},      {"position_mm", 4.45},
                         {"radius_mm", -14.3},       {"semi_diameter_mm", 3}, {"medium_after", "vitreous"}};
  EXPECT_EQ(eye_from_json(json, ".").surfaces.size(), 6U);
}

std::string fault_of(const Json& json) {
  try {
    eye_from_json(json, scratch("faults"));
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), ExitStatus::input_invalid);
    return error.what();
  }
  return "accepted";
}

TEST(EyeJson, FaultsNameTheKey) {
  const Json good = Json::parse(complete);
  const auto with = [&](const auto& change) {
    Json json = good;
    change(json);
    return fault_of(json);
  };
  using testing::HasSubstr;
  EXPECT_THAT(with([](Json& j) { j["surfaces"][0]["radius"] = 7; }), HasSubstr("unknown key \"radius\""));
  EXPECT_THAT(with([](Json& j) { j["surfaces"][0]["radius"] = 7; }), HasSubstr("cornea_anterior"));
  EXPECT_THAT(with([](Json& j) { j["colour"] = "blue"; }), HasSubstr("colour"));
  EXPECT_THAT(with([](Json& j) { j["media"]["lens"]["abe"] = 50; }), HasSubstr("abe"));
  EXPECT_THAT(with([](Json& j) { j["media"]["lens"]["index"] = 0.9; }), HasSubstr("index"));
  EXPECT_THAT(with([](Json& j) { j["media"]["lens"]["abbe"] = {1.42, 50}; }), HasSubstr("second"));
  EXPECT_THAT(with([](Json& j) {
                j["media"]["vitreous"] = {{"index", 1.336}, {"abbe", {1.336, 0.9}}};
              }),
              HasSubstr("Abbe number of 10 or more"));
  EXPECT_THAT(with([](Json& j) { j["surfaces"][1]["medium_after"] = "water"; }), HasSubstr("water"));
  EXPECT_THAT(with([](Json& j) { j["surfaces"][1].erase("medium_after"); }), HasSubstr("medium_after"));
  EXPECT_THAT(with([](Json& j) { j["surfaces"][5]["medium_after"] = "lens"; }), HasSubstr("medium_after"));
  EXPECT_THAT(with([](Json& j) { j["surfaces"][2]["diameter_mm"] = -1; }), HasSubstr("diameter_mm"));
  EXPECT_THAT(with([](Json& j) { j["surfaces"][4]["position_mm"] = 1; }), HasSubstr("position_mm"));
  EXPECT_THAT(with([](Json& j) { j["surfaces"][4]["position_mm"] = nullptr; }), HasSubstr("position_mm"));
  EXPECT_THAT(with([](Json& j) { j["surfaces"][4]["name"] = "iris"; }), HasSubstr("name"));
  EXPECT_THAT(with([](Json& j) { j["reference_wavelength_nm"] = 0.555; }),
              HasSubstr("reference_wavelength_nm"));
  EXPECT_THAT(with([](Json& j) { j["surfaces"][0]["tilt_deg"] = {95, 0}; }), HasSubstr("tilt_deg"));
  EXPECT_THAT(with([](Json& j) { j["surfaces"][0]["position_mm"] = -2; }), HasSubstr("the eye's origin"));
  EXPECT_THAT(with([](Json& j) {
                j["surfaces"][0]["radius_mm"] = {-7.95, -7.7};
              }),
              HasSubstr("cornea bulges"));
  EXPECT_THAT(with([](Json& j) { j["surfaces"][5]["radius_mm"] = 12; }), HasSubstr("its radius is negative"));
  EXPECT_THAT(with([](Json& j) { j["media"]["air"] = {{"index", 1.5}}; }), HasSubstr("media.air"));
  // A lens of 0.1 mm whose sides meet 0.8 mm from the axis.
  EXPECT_THAT(with([](Json& j) {
                j["surfaces"][3]["radius_mm"] = 3;
                j["surfaces"][3]["q"] = 0;
                j["surfaces"][4]["position_mm"] = 3.7;
                j["surfaces"][4]["radius_mm"] = 30;
              }),
              HasSubstr("surfaces[4] (lens_posterior): it crosses lens_anterior"));
  EXPECT_THAT(with([](Json& j) {
                j["media"]["aqueous"]["table"] = {{0.4, 1.344}, {0.8, 1.33}};
              }),
              HasSubstr("in nm, found 0.4"));
  // n = 1.3 + 1 / (nm - 612) is 1.3 or so at both ends of light and at the reference.
  EXPECT_THAT(with([](Json& j) { j["media"]["aqueous"]["cornu"] = {1.3, 1, 612}; }), HasSubstr("at 610 nm"));
  EXPECT_THAT(with([](Json& j) {
                const Json front{{"name", "spectacle_anterior"},
                                 {"type", "sphere"},
                                 {"position_mm", -14},
                                 {"radius_mm", 80},
                                 {"medium_after", "cornea"}};
                j["surfaces"].insert(j["surfaces"].begin(), front);
              }),
              HasSubstr("no back surface"));
  EXPECT_THAT(
      with([](Json& j) {
        const Json front{
            {"name", "spectacle_front"}, {"type", "plane"}, {"position_mm", 12}, {"medium_after", "air"}};
        j["surfaces"].insert(j["surfaces"].end() - 1, front);
      }),
      HasSubstr("(spectacle_front): key \"position_mm\": a spectacle stands in front of the cornea"));
  EXPECT_THAT(with([](Json& j) {
                j["lps_from_eye"] = {{1, 0, 0, 0}, {0, 2, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};
              }),
              HasSubstr("lps_from_eye"));
  for (const char* key : {"radius_mm", "q", "position_mm", "decentre_mm"})
    EXPECT_THAT(with([&](Json& j) {
                  const Json far = 1e12;
                  j["surfaces"][0][key] = std::string(key) == "decentre_mm" ? Json{far, far} : far;
                }),
                HasSubstr(key));
  EXPECT_THAT(with([](Json& j) { j["surfaces"][0]["radius_mm"] = {7.8, 1e-300}; }), HasSubstr("radius_mm"));
  EXPECT_THAT(with([](Json& j) { j["surfaces"] = Json::array(); }), HasSubstr("surfaces"));
  EXPECT_THAT(with([](Json& j) { j.erase("media"); }), HasSubstr("media"));
  EXPECT_THAT(fault_of(Json::array()), HasSubstr("object"));
}

TEST(EyeJson, FileErrorsNameTheFile) {
  const std::filesystem::path file = scratch("file") / "bad.json";
  write_file(file,
             R"({"reference_wavelength_nm": 555, "media": {"a": {"index": 1.3}}, "surfaces": [], "x": 1})");
  try {
    read_eye(file);
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("bad.json"));
  }
}

TEST(EyeJson, AKeyThatStandsTwiceIsRefused) {
  const std::filesystem::path file = scratch("twice") / "eye.json";
  std::string text = complete;
  const std::string once = "\"position_mm\": 24.0";
  text.replace(text.find(once), once.size(), once + ", \"position_mm\": 23.0");
  write_file(file, text);
  try {
    read_eye(file);
    ADD_FAILURE() << "read";
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), ExitStatus::input_invalid);
    EXPECT_THAT(error.what(), testing::HasSubstr("position_mm"));
    EXPECT_THAT(error.what(), testing::HasSubstr("eye.json"));
  }
}

TEST(EyeJson, ASpectacleIsWhatTheHeadBears) {
  Json json = to_json(make_eye("navarro"));
  const auto plane = [](const char* name, double position_mm) {
    return Json{{"name", name}, {"type", "plane"}, {"position_mm", position_mm}, {"medium_after", "air"}};
  };
  json["surfaces"].insert(json["surfaces"].begin(), {plane("spectacle_front", -14), plane("contact", -1)});
  const EyeModel worn = eye_from_json(json, {});
  EXPECT_EQ(worn.surfaces[0].bearer, Bearer::head);
  EXPECT_EQ(worn.surfaces[1].bearer, Bearer::eye);
  EXPECT_EQ(without_spectacle(worn).surfaces.size(), worn.surfaces.size() - 1);
  EXPECT_EQ(to_json(worn), json);  // it is a matter of the name: no key of its own
}

TEST(EyeJson, APatientsMeshCorneaInASchematicEye) {
  const std::filesystem::path folder = scratch("mesh");
  const EyeModel navarro = make_eye("navarro");
  TriangleMesh cornea = testing_eye::jittered_sheet(*navarro.surface("cornea_anterior").shape, 5, 600, 1);
  // In the eye's frame, and in LPS with a transform.
  Eigen::Isometry3d lps_from_eye = Eigen::Isometry3d::Identity();
  lps_from_eye.translation() = Eigen::Vector3d(30, -70, 12);
  lps_from_eye.rotate(Eigen::AngleAxisd(1.3, Eigen::Vector3d(1, 0.2, 0).normalized()));
  write_mesh(folder / "in_eye.ply", cornea, false);
  write_mesh(folder / "in_lps.ply", transformed(lps_from_eye, cornea), true);
  double refraction[2];
  int k = 0;
  for (const char* name : {"in_eye.ply", "in_lps.ply"}) {
    EyeModel eye = navarro;
    eye.lps_from_eye = lps_from_eye;
    Json json = to_json(eye);
    json["surfaces"][0] = {
        {"name", "cornea_anterior"}, {"type", "mesh"}, {"file", name}, {"medium_after", "cornea"}};
    write_file(folder / "eye.json", json.dump());
    refraction[k++] = paraxial_refraction(read_eye(folder / "eye.json"), 589.3).M_D;
  }
  EXPECT_NEAR(refraction[0], 0, 0.01);
  EXPECT_NEAR(refraction[1], refraction[0], 1e-6);
  // The path goes on being relative to the file when the eye is written elsewhere.
  const std::filesystem::path other = scratch("mesh-elsewhere");
  write_eye(other / "eye.json", read_eye(folder / "eye.json"));
  EXPECT_THAT(read_file(other / "eye.json"), testing::HasSubstr("../mesh/in_lps.ply"));
  EXPECT_NEAR(paraxial_refraction(read_eye(other / "eye.json"), 589.3).M_D, refraction[1], 1e-9);
}

// Beside a mesh that was made anew the eye's own iris and retina would be of another eye.
TEST(EyeJson, AMeshThatWasMadeAnewIsRefused) {
  const std::filesystem::path folder = scratch("mesh-anew"), mesh = folder / "cornea.ply";
  const auto write_sheet = [&](double radius_mm) {
    write_mesh(mesh, testing_eye::jittered_sheet(*make_sphere(radius_mm), 5, 200, 1), false);
  };
  write_sheet(7.8);
  Json json = Json::parse(complete);
  json["surfaces"][0] = {
      {"name", "cornea_anterior"}, {"type", "mesh"}, {"file", "cornea.ply"}, {"medium_after", "cornea"}};
  write_eye(folder / "eye.json", eye_from_json(json, folder));
  EXPECT_EQ(read_json(folder / "eye.json")["surfaces"][0]["sha256"], sha256_of_file(mesh));
  EXPECT_NO_THROW(read_eye(folder / "eye.json"));
  write_sheet(7.7);
  EXPECT_NO_THROW(eye_from_json(json, folder));  // nothing is recorded
  try {
    read_eye(folder / "eye.json");
    FAIL() << "was read";
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), ExitStatus::input_invalid);
    EXPECT_THAT(error.what(), testing::HasSubstr("cornea.ply is not the mesh"));
    EXPECT_THAT(error.remedy(), testing::HasSubstr("emmetrope trace"));
  }
  for (const Json& wrong : {Json(7), Json(nullptr), Json(""), Json::array({"0"}), Json::object()}) {
    json["surfaces"][0]["sha256"] = wrong;
    try {
      eye_from_json(json, folder);
      ADD_FAILURE() << wrong;
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::input_invalid);
      EXPECT_THAT(error.what(), testing::HasSubstr("key \"sha256\""));
    }
  }
}

TEST(EyeJson, MeshFaultsNameTheFile) {
  const std::filesystem::path folder = scratch("mesh-faults");
  TriangleMesh cornea = testing_eye::jittered_sheet(*make_sphere(7.8), 5, 200, 1);
  write_mesh(folder / "lps.ply", cornea, true);
  for (auto& v : cornea.vertices) v.x() += 20;
  write_mesh(folder / "beside.ply", cornea, false);
  Json json = Json::parse(complete);
  const auto fault = [&](const char* file) {
    json["surfaces"][0] = {
        {"name", "cornea_anterior"}, {"type", "mesh"}, {"file", file}, {"medium_after", "cornea"}};
    try {
      eye_from_json(json, folder);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  EXPECT_THAT(fault("lps.ply"),
              testing::AllOf(testing::HasSubstr("lps.ply"), testing::HasSubstr("lps_from_eye")));
  EXPECT_THAT(fault("beside.ply"), testing::HasSubstr("crosses the axis"));
  EXPECT_THAT(fault("missing.ply"), testing::HasSubstr("missing.ply"));
}

}  // namespace
}  // namespace emmetrope
