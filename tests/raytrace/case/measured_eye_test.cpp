// A case whose meshes are a schematic eye's gives that eye back.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/base/measured.hpp"
#include "pipeline/eye/model/mesh_shape.hpp"
#include "pipeline/eye/optics/paraxial.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "raytrace/case/measured_eye.hpp"
#include "raytrace/system/sheet_mesh.hpp"
#include "raytrace/tracer/tracer.hpp"

namespace emmetrope::raytrace {
namespace {

class MeasuredCase : public testing::Test {
 protected:
  MeasuredCase()
      : folder_(std::filesystem::path(testing::TempDir()) /
                ("emmetrope-measured-eye-test-" + std::to_string(::getpid()))) {
    const auto meshing = folder_ / "meshing" / "od";
    std::filesystem::create_directories(meshing);
    const Eigen::Isometry3d lps = lps_from_eye({-30, -40, 5}, {0.05, -1, 0.02});
    schematic_ = make_eye("le-grand", {});
    for (const auto& surface : schematic_.surfaces) {
      if (surface.is_stop()) continue;
      const bool retina = surface.name == "retina";
      TriangleMesh sheet = sheet_mesh(*surface.shape, retina ? 8 : 5, 1500, 0.2);
      // le-grand's retina stands for the photoreceptors, 0.20 mm behind the interface that meshes show
      const double position = surface.position_mm - (retina ? 0.20 : 0);
      sheet = transformed(lps * Eigen::Isometry3d(Eigen::Translation3d(0, 0, -position)), sheet);
      write_mesh(meshing / (surface.name + ".ply"), sheet, true);
    }
    write_json(meshing / "biometry.json", {{"laterality", "od"}, {"lps_from_eye", to_json_matrix(lps)}});
  }
  ~MeasuredCase() override { std::filesystem::remove_all(folder_); }

  std::filesystem::path folder_;
  EyeModel schematic_;
};

TEST_F(MeasuredCase, GivesTheSchematicEyesRefraction) {
  MeasuredEyeOptions options;
  options.lens_index = 1.42;
  const MeasuredEye measured = read_measured_eye(folder_, Laterality::od, options);
  ASSERT_EQ(measured.eye.surfaces.size(), 6U);
  for (const auto& surface : measured.eye.surfaces)
    if (!surface.is_stop()) {
      EXPECT_NEAR(surface.position_mm, schematic_.surface(surface.name).position_mm, 2e-4) << surface.name;
    }
  EyeModel expected = schematic_;
  expected.media = measured.eye.media;
  const double difference =
      paraxial_refraction(measured.eye, 589.3).M_D - paraxial_refraction(expected, 589.3).M_D;
  EXPECT_NEAR(difference, 0, 0.01);
  EXPECT_EQ(measured.lens_source, "--lens-index");

  TraceSettings settings;
  settings.grid = {16, 16, 2, 2, {0, 0}};
  settings.samples = 64;
  settings.verbosity.quiet = true;
  const auto result = Tracer("").trace(measured.eye, *make_scene("letters:contrast=0"), settings);
  EXPECT_EQ(result.states.at(RayState::missed_surface), 0U);
  EXPECT_FALSE(result.notes.empty());
}

TEST_F(MeasuredCase, LensIndexComesFromTheAgeOrTheCore) {
  EXPECT_NEAR(read_measured_eye(folder_, Laterality::od, {}).lens_index, 1.441 - 0.00039 * 40, 1e-12);
  write_json(folder_ / "case.json", {{"subject", {{"age_years", 60}}}});
  EXPECT_NEAR(read_measured_eye(folder_, Laterality::od, {}).lens_index, 1.441 - 0.00039 * 60, 1e-12);
  MeasuredEyeOptions options;
  options.lens_core = true;
  const EyeModel core = read_measured_eye(folder_, Laterality::od, options).eye;
  const double thickness =
      schematic_.surface("lens_posterior").position_mm - schematic_.surface("lens_anterior").position_mm;
  EXPECT_NEAR(core.surface("core_anterior").position_mm,
              schematic_.surface("lens_anterior").position_mm + 0.1517 * thickness, 1e-3);
  EXPECT_NEAR(1 / core.surface("core_posterior").shape->vertex_curvature()(0, 0), 0.96 * -6.0, 0.05);
  EXPECT_THROW(read_measured_eye(folder_, Laterality::os, {}), Error);
}

TEST_F(MeasuredCase, AnIndexThatNoAgeGivesIsWarnedOf) {
  MeasuredEyeOptions options;
  const auto warning = [&](double index) {
    options.lens_index = index;
    return read_measured_eye(folder_, Laterality::od, options).warning;
  };
  EXPECT_EQ(warning(1.42), "");
  EXPECT_NE(warning(1.47).find("none of any age"), std::string::npos);
  EXPECT_NE(warning(1.37), "");
  EXPECT_THROW(warning(1.55), Error);
  EXPECT_THROW(warning(1.35), Error);
}

// The optical length of the case and the length of the eye that is traced are one.
TEST_F(MeasuredCase, ThePhotoreceptorsLieAsItWasMeshed) {
  const std::filesystem::path file = folder_ / "meshing" / "od" / "biometry.json";
  Json biometry = read_json(file);
  biometry["axial_length_mm"] = Measured::from_sigma(23.0, 0.1, "mri");
  biometry["optical_axial_length_mm"] = Measured::from_sigma(23.6, 0.1, "mri");
  write_json(file, biometry);
  MeasuredEyeOptions options;
  EXPECT_NEAR(read_measured_eye(folder_, Laterality::od, options).eye.surface("retina").position_mm,
              schematic_.surface("retina").position_mm - 0.20 + 0.6, 2e-4);
  options.retinal_depth_mm = 0.6;
  EXPECT_NO_THROW(read_measured_eye(folder_, Laterality::od, options));
  options.retinal_depth_mm = 0.2;
  EXPECT_THROW(read_measured_eye(folder_, Laterality::od, options), Error);
}

// What is no measured number, or a depth that no retina has, is told with its file.
TEST_F(MeasuredCase, ABrokenLengthIsRefusedByItsFile) {
  const std::filesystem::path file = folder_ / "meshing" / "od" / "biometry.json";
  const Json whole = read_json(file);
  const auto refusal = [&](const Json& axial, const Json& optical) -> std::string {
    Json biometry = whole;
    biometry["axial_length_mm"] = axial;
    biometry["optical_axial_length_mm"] = optical;
    write_json(file, biometry);
    try {
      read_measured_eye(folder_, Laterality::od, {});
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::input_invalid);
      return error.context().front();
    }
    return "";
  };
  const Json length = Measured::from_sigma(23.0, 0.1, "mri");
  EXPECT_EQ(refusal(length, Measured::from_sigma(23.2, 0.1, "mri")), "");
  EXPECT_NE(refusal(length, Measured::from_sigma(25.0, 0.1, "mri")).find("biometry.json"), std::string::npos);
  EXPECT_NE(refusal(Measured::from_sigma(25.0, 0.1, "mri"), length).find("biometry.json"), std::string::npos);
  for (const auto& [key, value] : std::vector<std::pair<const char*, Json>>{
           {"value", nullptr}, {"value", "23"}, {"ci95", {23.0}}, {"ci95", {nullptr, 23.0}}, {"source", 7}}) {
    Json broken = length;
    broken[key] = value;
    EXPECT_NE(refusal(broken, length).find("biometry.json"), std::string::npos) << key;
    EXPECT_NE(refusal(length, broken).find("biometry.json"), std::string::npos) << key;
  }
}

TEST_F(MeasuredCase, EyeJsonReadsBack) {
  const MeasuredEye measured = read_measured_eye(folder_, Laterality::od, {});
  const auto own = folder_ / "raytrace" / "od";
  std::filesystem::create_directories(own);
  write_measured_eye(own, measured, Laterality::od);
  const EyeModel again = read_eye(own / "eye.json");
  EXPECT_NEAR(again.axial_length_mm(), measured.eye.axial_length_mm(), 1e-6);
  EXPECT_NEAR(paraxial_refraction(again, 589.3).M_D, paraxial_refraction(measured.eye, 589.3).M_D, 1e-6);
}

TEST_F(MeasuredCase, EyeJsonIsOfTheMeshesThatWereTraced) {
  const auto own = folder_ / "raytrace" / "od";
  std::filesystem::create_directories(own);
  for (const auto& changed : {folder_ / "meshing/od/lens_posterior.ply", own / "photoreceptors.ply"}) {
    write_measured_eye(own, read_measured_eye(folder_, Laterality::od, {}), Laterality::od);
    EXPECT_NO_THROW(read_eye(own / "eye.json"));
    MeshFile mesh = read_mesh(changed);
    mesh.mesh.vertices.front().z() += 1e-3;
    write_mesh(changed, mesh.mesh, mesh.says_lps);
    try {
      read_eye(own / "eye.json");
      ADD_FAILURE() << changed << " was read";
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::input_invalid);
      EXPECT_NE(std::string(error.what()).find(changed.filename().string()), std::string::npos);
    }
  }
}

}  // namespace
}  // namespace emmetrope::raytrace
