#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <iterator>
#include <map>
#include <regex>
#include <sstream>

#include "meshing/stage.hpp"
#include "pipeline/base/case_folder.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/base/measured.hpp"
#include "pipeline/eye/model/eye_model.hpp"
#include "pipeline/eye/model/mesh_shape.hpp"
#include "tests/support/random_eye.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope::meshing {
namespace {

namespace fs = std::filesystem;

/// A case in which segmentation has finished.
class MeshStage : public testing::Test {
 protected:
  void SetUp() override {
    for (const Laterality eye : both_eyes) {
      eyes_[eye] = random_eye(eye == Laterality::od ? 40 : 41);
      eyes_[eye].lps_from_eye.translation().x() = eye == Laterality::od ? -31 : 31;
      write_fit(eye);
    }
    write_json(folder() / "segmentation" / "stage.json",
               {{"verdict", {{"status", 0}, {"reasons", Json::array()}}}});
    write_json(folder() / "case.json", {{"subject", {{"age_years", 60}}}});
    options_.case_folder = folder();
  }

  /// \param withheld  "fit" or "cornea", and why
  void write_fit(Laterality eye, const Json& withheld = Json::object(), const Json& edges = nullptr) {
    const bool is_refused = withheld.contains("fit") && edges.is_null();
    fs::create_directories(folder() / "segmentation" / to_string(eye));
    write_json(folder() / "segmentation" / to_string(eye) / "fit.json",
               {{"laterality", to_string(eye)},
                {"eye", to_json(eyes_[eye])},
                {"head_roll_deg", 4.0},
                {"withheld", withheld},
                {"edges", edges},
                {"status", withheld.empty() ? "measured"
                           : is_refused     ? "refused"
                                            : "partial"}});
  }

  const fs::path& folder() const { return temporary_.path(); }
  fs::path mesh(const char* eye, const std::string& file) const { return folder() / "meshing" / eye / file; }

  test::TemporaryFolder temporary_;
  std::map<Laterality, ParametricEye> eyes_;
  MeshingOptions options_;
  InstrumentFlags instruments_;
};

TEST_F(MeshStage, WritesFiveSheetsInLpsForEachEye) {
  options_.formats = {"stl", "gii"};
  const Answer answer = make_meshes(options_, {});
  EXPECT_EQ(answer.status, ExitStatus::done);
  const std::map<std::string, std::size_t> counts{{"cornea_anterior", 613},
                                                  {"cornea_posterior", 723},
                                                  {"lens_anterior", 565},
                                                  {"lens_posterior", 1516},
                                                  {"retina", 973}};
  for (const Laterality eye : both_eyes) {
    for (const auto& [name, count] : counts) {
      const MeshFile file = read_mesh(mesh(to_string(eye), name + ".ply"));
      EXPECT_TRUE(file.says_lps);
      EXPECT_EQ(file.mesh.vertices.size(), count);
      ASSERT_EQ(file.mesh.normals.size(), count);
      EXPECT_EQ(read_mesh(mesh(to_string(eye), name + ".stl")).mesh.triangles.size(),
                file.mesh.triangles.size());
    }
    const MeshFile cornea = read_mesh(mesh(to_string(eye), "cornea_anterior.ply"));
    const Eigen::Isometry3d eye_from_lps = eyes_[eye].lps_from_eye.inverse();
    for (const Eigen::Vector3d& vertex : cornea.mesh.vertices) {
      const Eigen::Vector3d v = eye_from_lps * vertex;
      EXPECT_NEAR(v.z(), -eyes_[eye].cornea_anterior_depth_mm(v.x(), v.y()), 1e-9);
    }
  }
}

TEST_F(MeshStage, BiometryHasEveryKeyWithValueIntervalAndSource) {
  make_meshes(options_, {});
  const Json json = read_json(mesh("od", "biometry.json"));
  for (const char* pointer : {"/axial_length_mm",
                              "/optical_axial_length_mm",
                              "/corneal_thickness_mm",
                              "/anterior_chamber_depth_mm",
                              "/lens_thickness_mm",
                              "/lens_anterior_radius_mm",
                              "/lens_posterior_radius_mm",
                              "/globe_width_mm",
                              "/globe_height_mm",
                              "/globe_depth_mm",
                              "/retina/vertex_radius_mm/horizontal",
                              "/retina/vertex_radius_120_mm/vertical",
                              "/retina/q_120",
                              "/retina/q_240",
                              "/retina/axis_120_deg/horizontal",
                              "/retina/axis_240_deg/vertical",
                              "/retina/tilt_deg/horizontal",
                              "/retina/volume_mm3",
                              "/retina/area_mm2",
                              "/retina/staphyloma_index",
                              "/keratometry/flat/radius_mm",
                              "/keratometry/flat/power_D",
                              "/keratometry/flat/axis_deg",
                              "/keratometry/steep/radius_mm",
                              "/keratometry/steep/power_D",
                              "/keratometry/steep/axis_deg",
                              "/keratometry/cylinder_D",
                              "/keratometry/asphericity_q",
                              "/astigmatism/M_D",
                              "/astigmatism/J0_D",
                              "/astigmatism/J45_D",
                              "/astigmatism/irregularity_um",
                              "/astigmatism/section_2p3mm/vertical_mm",
                              "/astigmatism/section_2p3mm/horizontal_mm",
                              "/cornea_zernike_um/12",
                              "/interpupillary_distance_mm"}) {
    SCOPED_TRACE(pointer);
    const auto m = json.at(Json::json_pointer(pointer)).get<Measured>();
    EXPECT_LT(m.ci95[0], m.ci95[1]);
    EXPECT_LE(m.ci95[0], m.value);
    EXPECT_GE(m.ci95[1], m.value);
  }
  EXPECT_EQ(json["laterality"], "od");
  EXPECT_EQ(json["head_roll_deg"], 4.0);
  EXPECT_EQ(json["cornea_zernike_um"].size(), 28U);
  const double between = (eyes_[Laterality::od].lps_from_eye * eyes_[Laterality::od].globe_centre_mm() -
                          eyes_[Laterality::os].lps_from_eye * eyes_[Laterality::os].globe_centre_mm())
                             .norm();
  EXPECT_NEAR(json["interpupillary_distance_mm"]["value"], between, 1e-12);
  const Json warnings = read_json(folder() / "meshing" / "stage.json")["warnings"];
  EXPECT_THAT(warnings.dump(), testing::HasSubstr("rolled by 4.0 degrees"));
}

TEST_F(MeshStage, SaysWhereALengthEnds) {
  const std::string said = make_meshes(options_, {}).text;
  const Json biometry = read_json(mesh("od", "biometry.json"));
  for (const auto& [name, key] : {std::pair("axial length, optical", "optical_axial_length_mm"),
                                  {"  to the inner retina", "axial_length_mm"}})
    EXPECT_THAT(said, testing::HasSubstr(
                          fmt::format("  {:<26}{:8.2f} mm", name, biometry[key]["value"].get<double>())));
}

TEST_F(MeshStage, OpticsHaveTheLensOfTheSubjectsAge) {
  make_meshes(options_, {});
  const EyeModel eye = eye_from_json(read_json(mesh("os", "optics.json"))["eye"], ".");
  EXPECT_NEAR(eye.media.at("lens").index, 1.441 - 0.00039 * 60, 1e-12);

  write_json(folder() / "case.json", {{"subject", {{"age_years", 100}}}});
  make_meshes(options_, {});
  const Json optics = read_json(mesh("os", "optics.json"));
  EXPECT_EQ(optics["parameters"].back(), "lens_index");
  EXPECT_NEAR(optics["values"].back(), 1.441 - 0.00039 * 100, 1e-12);
  EXPECT_NEAR(optics["prior_sigmas"].back(), std::hypot(0.005, 0.00039 * 30), 1e-12);
}

TEST_F(MeshStage, MeasuredEyeTracesLikeItsFormulas) {
  make_meshes(options_, {});
  const EyeModel formulas = eye_from_json(read_json(mesh("od", "optics.json"))["eye"], ".");
  for (const char* name : {"cornea_anterior", "cornea_posterior", "lens_anterior", "lens_posterior"}) {
    SCOPED_TRACE(name);
    const Surface from_mesh = read_mesh_surface(name, mesh("od", std::string(name) + ".ply"),
                                                eyes_[Laterality::od].lps_from_eye, "");
    const Surface& exact = formulas.surface(name);
    for (const double x : {-1.5, 0.0, 1.5}) {
      for (const double y : {-1.0, 1.0}) {
        const auto hit_of = [&](const Surface& surface) -> Eigen::Vector3d {
          const Eigen::Isometry3d to = surface.eye_from_surface().inverse();
          const auto hit = surface.shape->intersect(
              {to * Eigen::Vector3d(x, y, 5), to.linear() * -Eigen::Vector3d::UnitZ()});
          return surface.eye_from_surface() * hit.value().position;
        };
        EXPECT_NEAR((hit_of(from_mesh) - hit_of(exact)).norm(), 0, 2e-4);  // the smooth patch
      }
    }
  }
}

TEST_F(MeshStage, SecondRunIsUpToDateAndSameBytesWhenForced) {
  EXPECT_FALSE(make_meshes(options_, {}).json["skipped"].get<bool>());
  const std::string first =
      sha256_of_file(mesh("od", "retina.ply")) + sha256_of_file(mesh("od", "biometry.json"));
  EXPECT_TRUE(make_meshes(options_, {}).json["skipped"].get<bool>());
  CommonOptions force;
  force.force = true;
  force.threads = 1;
  EXPECT_FALSE(make_meshes(options_, force).json["skipped"].get<bool>());
  EXPECT_EQ(sha256_of_file(mesh("od", "retina.ply")) + sha256_of_file(mesh("od", "biometry.json")), first);
}

TEST_F(MeshStage, InstrumentsOfOneEyeLeaveTheOtherAlone) {
  make_meshes(options_, {});
  const Json before = read_json(mesh("os", "biometry.json"));
  instruments_.keratometry = {"od:43.25@175/44.75@85+-0.1"};
  options_.instruments = parse_instruments(instruments_, options_.retinal_depth_mm);
  make_meshes(options_, {});
  EXPECT_EQ(read_json(mesh("od", "biometry.json"))["astigmatism"]["M_D"]["source"], "keratometry");
  EXPECT_NEAR(read_json(mesh("od", "biometry.json"))["astigmatism"]["M_D"]["value"], 44, 0.1);
  EXPECT_EQ(read_json(mesh("os", "biometry.json"))["astigmatism"], before["astigmatism"]);
  // Meshed again without them, it says so.
  options_.instruments.clear();
  make_meshes(options_, {});
  const Json warnings = read_json(options_.case_folder / "meshing" / "stage.json")["warnings"];
  EXPECT_NE(warnings.dump().find("OD (right): keratometry: given to the earlier meshing"), std::string::npos);
  EXPECT_EQ(warnings.dump().find("OS (left): "), std::string::npos);
  write_file(options_.case_folder / "meshing" / "stage.json", "{");
  EXPECT_NO_THROW(make_meshes(options_, {}));
}

/// Two readings of which the images exclude neither: it is not the images that contradict.
TEST_F(MeshStage, InstrumentsThatContradictEachOtherAreToldAsSuch) {
  make_meshes(options_, {});
  const double length_mm =
      read_json(mesh("od", "biometry.json"))["optical_axial_length_mm"]["value"].get<double>();
  instruments_.axial_length = {fmt::format("od:{:.3f}+-0.02", length_mm),
                               fmt::format("od:{:.3f}+-0.02", length_mm + 0.3)};
  options_.instruments = parse_instruments(instruments_, options_.retinal_depth_mm);
  try {
    make_meshes(options_, {});
    FAIL() << "taken";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(),
                testing::HasSubstr("biometry and the images with the readings before it differ by"));
    EXPECT_THAT(error.what(), testing::HasSubstr(
                                  fmt::format("--axial-length {:.2f} mm, the images with", length_mm + 0.3)));
  }
}

/// A length that the images exclude: no mean of the two would be near either.
TEST_F(MeshStage, IrreconcilableInstrumentsAreRefused) {
  make_meshes(options_, {});
  const std::string before = sha256_of_file(mesh("od", "biometry.json"));
  instruments_.axial_length = {"od:29.0+-0.05"};
  options_.instruments = parse_instruments(instruments_, options_.retinal_depth_mm);
  try {
    make_meshes(options_, {});
    FAIL() << "taken";
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), ExitStatus::input_invalid);
    EXPECT_THAT(error.what(), testing::HasSubstr("OD (right): biometry and the images differ by"));
    EXPECT_THAT(error.what(), testing::HasSubstr("cannot both be of this eye"));
    EXPECT_THAT(error.what(), testing::ContainsRegex("\\(--axial-length 29.00 mm, the images [0-9.]+ mm\\)"));
  }
  EXPECT_EQ(sha256_of_file(mesh("od", "biometry.json")), before);
}

TEST_F(MeshStage, InstrumentsOfAnEyeThatIsNotThereAreNamed) {
  write_fit(Laterality::os, {{"fit", "lens not visible"}});
  instruments_.keratometry = {"os:43.25@175/44.75@85"};
  options_.instruments = parse_instruments(instruments_, options_.retinal_depth_mm);
  EXPECT_EQ(make_meshes(options_, {}).status, ExitStatus::partial);
  EXPECT_THAT(read_file(folder() / "meshing" / "stage.json"),
              testing::HasSubstr("OS (left): not fitted to the images"));
}

TEST_F(MeshStage, InstrumentsOfAnEyeThatIsNotAskedForAreNamed) {
  instruments_.keratometry = {"os:43.25@175/44.75@85"};
  options_.instruments = parse_instruments(instruments_, options_.retinal_depth_mm);
  CommonOptions right_eye;
  right_eye.laterality = LateralityChoice::od;
  EXPECT_EQ(make_meshes(options_, right_eye).status, ExitStatus::done);
  EXPECT_THAT(read_file(folder() / "meshing" / "stage.json"),
              testing::HasSubstr("OS (left): what was measured of it elsewhere is not used"));
}

/// `segment --laterality os` saw both eyes and wrote one.
TEST_F(MeshStage, AnEyeThatSegmentationWasNotAskedForIsNoLostOne) {
  fs::remove_all(folder() / "segmentation" / "od");
  EXPECT_THAT(make_meshes(options_, {}).text, testing::HasSubstr("segmentation found no such eye"));
  Json stage = read_json(folder() / "segmentation" / "stage.json");
  stage["parameters"]["laterality"] = "os";
  write_json(folder() / "segmentation" / "stage.json", stage);
  CommonOptions again;
  again.force = true;
  EXPECT_THAT(make_meshes(options_, again).text,
              testing::HasSubstr("segmentation was asked for the other eye alone"));
}

TEST_F(MeshStage, RefusedEyeIsNotMeshed) {
  write_fit(Laterality::os, {{"fit", "lens not visible"}});
  const Answer answer = make_meshes(options_, {});
  EXPECT_EQ(answer.status, ExitStatus::partial);
  EXPECT_TRUE(fs::exists(mesh("od", "retina.ply")));
  EXPECT_FALSE(fs::exists(folder() / "meshing" / "os"));
  EXPECT_THAT(answer.text, testing::HasSubstr("lens not visible"));
  EXPECT_FALSE(read_json(mesh("od", "biometry.json")).contains("interpupillary_distance_mm"));

  write_fit(Laterality::od, {{"fit", "lens not visible"}});
  EXPECT_EQ(make_meshes(options_, {}).status, ExitStatus::no_result);
  EXPECT_EQ(read_verdict(folder(), "meshing").status, ExitStatus::no_result);
  EXPECT_FALSE(fs::exists(folder() / "meshing" / "od"));
}

TEST_F(MeshStage, WithoutItsCorneaAnEyeKeepsTheRest) {
  write_fit(Laterality::od, {{"cornea", "cornea not visible"}});
  EXPECT_EQ(make_meshes(options_, {}).status, ExitStatus::partial);
  const Json biometry = read_json(mesh("od", "biometry.json"));
  EXPECT_NEAR(biometry.at("axial_length_mm").at("value"), eyes_[Laterality::od].pole_depth_mm(), 1e-9);
  EXPECT_EQ(biometry.at("axial_length_mm").at("method"), "fit");
  for (const char* quantity :
       {"/keratometry/flat/power_D", "/keratometry/cylinder_D", "/astigmatism/J45_D"}) {
    const Json& withheld = biometry.at(Json::json_pointer(quantity));
    EXPECT_TRUE(withheld.at("value").is_null()) << quantity;
    EXPECT_EQ(withheld.at("withheld"), "cornea not visible") << quantity;
  }
  EXPECT_TRUE(fs::exists(mesh("od", "retina.ply")));
  EXPECT_TRUE(fs::exists(mesh("od", "lens_anterior.ply")));
  EXPECT_FALSE(fs::exists(mesh("od", "cornea_anterior.ply")));
  EXPECT_FALSE(fs::exists(mesh("od", "optics.json")));
  EXPECT_TRUE(fs::exists(mesh("os", "optics.json")));
}

TEST_F(MeshStage, WithoutItsFrontAnEyeKeepsTheBackOfItsGlobe) {
  write_fit(Laterality::od, {{"front", "blanked"}});
  instruments_.keratometry = {"od:43.25@175/44.75@85"};
  options_.instruments = parse_instruments(instruments_, options_.retinal_depth_mm);
  EXPECT_EQ(make_meshes(options_, {}).status, ExitStatus::partial);
  const Json biometry = read_json(mesh("od", "biometry.json"));
  for (const char* quantity :
       {"/axial_length_mm", "/optical_axial_length_mm", "/anterior_chamber_depth_mm", "/lens_thickness_mm",
        "/lens_anterior_radius_mm", "/globe_depth_mm", "/keratometry/flat/power_D", "/astigmatism/J45_D",
        "/corneal_thickness_mm", "/cornea_zernike_um", "/retina/volume_mm3"})
    EXPECT_EQ(biometry.at(Json::json_pointer(quantity)).at("withheld"), "blanked") << quantity;
  for (const char* quantity : {"/globe_width_mm", "/globe_height_mm", "/retina/vertex_radius_mm/horizontal",
                               "/retina/q_240", "/retina/area_mm2"})
    EXPECT_EQ(biometry.at(Json::json_pointer(quantity)).at("method"), "fit") << quantity;
  EXPECT_TRUE(fs::exists(mesh("od", "retina.ply")));
  for (const char* file : {"lens_anterior.ply", "cornea_anterior.ply", "optics.json"})
    EXPECT_FALSE(fs::exists(mesh("od", file))) << file;
  EXPECT_THAT(read_file(folder() / "meshing" / "stage.json"),
              testing::HasSubstr("OD (right): its front is not in the images"));
}

TEST_F(MeshStage, AKeratometerKnowsTheCorneaThatTheImagesDoNotShow) {
  write_fit(Laterality::od, {{"cornea", "cornea not visible"}});
  instruments_.keratometry = {"od:43.25@175/44.75@85+-0.3"};
  options_.instruments = parse_instruments(instruments_, options_.retinal_depth_mm);
  EXPECT_EQ(make_meshes(options_, {}).status, ExitStatus::done);
  EXPECT_TRUE(fs::exists(mesh("od", "cornea_anterior.ply")));
  EXPECT_TRUE(fs::exists(mesh("od", "optics.json")));
  EXPECT_FALSE(read_json(mesh("od", "biometry.json"))
                   .at("/keratometry/flat/power_D"_json_pointer)
                   .contains("withheld"));
}

TEST_F(MeshStage, EdgesStandInForAFitThatIsWithheld) {
  const Json number = Measured::from_sigma(24, 0.5, "mri", "edges");
  Json edges{{"lps_from_eye", to_json_matrix(Eigen::Isometry3d::Identity())},
             {"anterior_chamber_depth_mm", withheld("no edges")}};
  for (const char* name :
       {"axial_length_mm", "lens_thickness_mm", "globe_width_mm", "globe_height_mm", "globe_depth_mm"})
    edges[name] = number;
  write_fit(Laterality::od, {{"fit", "slices moved"}}, edges);
  EXPECT_EQ(make_meshes(options_, {}).status, ExitStatus::partial);
  const Json biometry = read_json(mesh("od", "biometry.json"));
  EXPECT_EQ(biometry.at("globe_width_mm"), number);
  EXPECT_NEAR(biometry.at("optical_axial_length_mm").at("value"), 24 + options_.retinal_depth_mm, 1e-12);
  EXPECT_EQ(biometry.at("optical_axial_length_mm").at("method"), "edges");
  EXPECT_EQ(biometry.at("anterior_chamber_depth_mm").at("withheld"), "no edges");
  // The globe is a sphere of 12 mm; each extent is known to 0.5 mm, each half axis to 0.25.
  const Json& retina = biometry.at("retina");
  const auto radius = retina.at("/vertex_radius_mm/horizontal"_json_pointer).get<Measured>();
  EXPECT_NEAR(radius.value, 12, 1e-6);
  EXPECT_NEAR(radius.sigma(), std::sqrt(5) * 0.25, 1e-3);  // of a^2 / c
  EXPECT_EQ(radius.method, "edges");
  EXPECT_NEAR(retina.at("area_mm2").at("value"), 3 * pi * 144, 1e-3);
  EXPECT_EQ(retina.at("staphyloma_index").at("withheld"), "slices moved");
  // The centre lies 12 mm behind the apex, the back of a usual lens 7.2 mm: a sphere less a cap and the lens's back.
  const auto volume = retina.at("volume_mm3").get<Measured>();
  EXPECT_NEAR(volume.value, 4 / 3.0 * pi * 1728 - pi * 5.5 * 5.5 * (12 - 5.5 / 3), 120);
  // Where the length is withheld the centre lies where the eye's frame has it.
  edges["axial_length_mm"] = withheld("no cornea");
  edges["globe_centre_lps_mm"] = {0, 0, -12};
  write_fit(Laterality::od, {{"fit", "slices moved"}}, edges);
  make_meshes(options_, {});
  EXPECT_NEAR(
      read_json(mesh("od", "biometry.json")).at("/retina/volume_mm3/value"_json_pointer).get<double>(),
      volume.value, 1e-6);
  // A longer eye behind the same cornea has more vitreous, by about pi 12^2 a mm of depth over 2.
  edges["globe_depth_mm"] = edges["axial_length_mm"] = Measured::from_sigma(27, 0.5, "mri", "edges");
  write_fit(Laterality::od, {{"fit", "slices moved"}}, edges);
  make_meshes(options_, {});
  EXPECT_GT(read_json(mesh("od", "biometry.json")).at("/retina/volume_mm3/value"_json_pointer).get<double>(),
            volume.value + 500);
  EXPECT_EQ(biometry.at("/astigmatism/M_D"_json_pointer).at("withheld"), "slices moved");
  EXPECT_FALSE(fs::exists(mesh("od", "retina.ply")));
  EXPECT_FALSE(fs::exists(mesh("od", "optics.json")));
}

TEST_F(MeshStage, BadInputLeavesTheCaseAsItWas) {
  make_meshes(options_, {});
  const std::string before = sha256_of_file(mesh("od", "biometry.json"));
  write_file(folder() / "segmentation" / "od" / "fit.json", "{\"status\": \"measured\"}");
  EXPECT_THROW(make_meshes(options_, {}), Error);
  EXPECT_EQ(sha256_of_file(mesh("od", "biometry.json")), before);
  options_.vertices = {{"iris", 200}};
  EXPECT_THROW(make_meshes(options_, {}), Error);
  options_.vertices.clear();
  options_.case_folder = folder() / "nothing";
  EXPECT_THROW(make_meshes(options_, {}), Error);
}

TEST_F(MeshStage, GiftiIsRasWithTheSameTriangles) {
  options_.formats = {"gii"};
  options_.vertices = {{"", 100}};
  make_meshes(options_, {});
  const TriangleMesh ply = read_mesh(mesh("od", "retina.ply")).mesh;
  const std::string text = read_file(mesh("od", "retina.surf.gii"));
  std::vector<std::vector<double>> arrays;
  const std::regex data("<Data>([^<]*)</Data>");
  for (auto match = std::sregex_iterator(text.begin(), text.end(), data); match != std::sregex_iterator();
       ++match) {
    std::istringstream numbers((*match)[1]);
    arrays.emplace_back(std::istream_iterator<double>(numbers), std::istream_iterator<double>());
  }
  ASSERT_EQ(arrays.size(), 3U);
  ASSERT_EQ(arrays[0].size(), 3 * ply.vertices.size());
  ASSERT_EQ(arrays[1].size(), 3 * ply.triangles.size());
  for (std::size_t i = 0; i < ply.vertices.size(); ++i) {
    EXPECT_NEAR(arrays[0][3 * i], -ply.vertices[i].x(), 1e-5);
    EXPECT_NEAR(arrays[0][3 * i + 1], -ply.vertices[i].y(), 1e-5);
    EXPECT_NEAR(arrays[0][3 * i + 2], ply.vertices[i].z(), 1e-5);
  }
  for (std::size_t i = 0; i < ply.triangles.size(); ++i) EXPECT_EQ(arrays[1][3 * i], ply.triangles[i][0]);
}

}  // namespace
}  // namespace emmetrope::meshing
