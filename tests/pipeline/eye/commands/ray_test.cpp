#include <gmock/gmock.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <filesystem>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/eye/commands/describe_eye.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope {
namespace {

TEST(EyeCommand, AnswersWithTheContractsKeys) {
  EyeQuery query;
  query.eye = "navarro";
  const Json json = describe_eye(query).json;
  for (const char* key :
       {"power_D", "object_focal_mm", "image_focal_mm", "object_principal_mm", "image_principal_mm",
        "object_nodal_mm", "image_nodal_mm", "axial_length_mm", "refraction_D"})
    EXPECT_TRUE(json[key].is_number()) << key;
  for (const char* pupil : {"entrance_pupil", "exit_pupil"})
    for (const char* key : {"position_mm", "diameter_mm"}) EXPECT_TRUE(json[pupil][key].is_number()) << pupil;
  for (const char* key : {"M_D", "J0_D", "J45_D"}) EXPECT_TRUE(json["refraction"][key].is_number()) << key;
  EXPECT_EQ(json["refraction"]["M_D"], json["refraction_D"]);
}

TEST(EyeCommand, SaysThatAnEyeWithoutPowerHasNoCardinalPoints) {
  const std::filesystem::path file = std::filesystem::path(testing::TempDir()) /
                                     ("emmetrope-afocal-" + std::to_string(::getpid()) + ".json");
  write_file(
      file,
      R"({"name": "afocal", "reference_wavelength_nm": 555, "media": {"air": {"index": 1}}, "surfaces": [
    {"name": "cornea_anterior", "type": "sphere", "position_mm": 0, "radius_mm": 7.8, "medium_after": "air"},
    {"name": "iris", "type": "stop", "position_mm": 3, "diameter_mm": 4},
    {"name": "retina", "type": "sphere", "position_mm": 24, "radius_mm": -12}]})");
  EyeQuery query;
  query.eye = file.string();
  const Answer answer = describe_eye(query);
  EXPECT_THAT(answer.text, testing::HasSubstr("principal points       none"));
  EXPECT_THAT(answer.text,
              testing::Not(testing::AnyOf(testing::HasSubstr("nan"), testing::HasSubstr("inf"))));
  EXPECT_NEAR(answer.json["refraction_D"].get<double>(), 1000 / 24.0, 1e-9);
}

TEST(EyeCommand, SaysThatAnEyeWithoutAStopHasNoPupils) {
  const test::TemporaryFolder folder;
  const std::filesystem::path file = folder.path() / "eye.json";
  write_eye(file, without_stop(make_eye("navarro")));
  EyeQuery query;
  query.eye = file.string();
  const Answer answer = describe_eye(query);
  EXPECT_TRUE(answer.json["entrance_pupil"].is_null());
  EXPECT_TRUE(answer.json["exit_pupil"].is_null());
  EXPECT_THAT(answer.text, testing::HasSubstr("entrance pupil         none: the eye has no stop"));
  EXPECT_THAT(answer.text, testing::Not(testing::HasSubstr("nan")));
}

TEST(EyeCommand, RefusesAWavelengthAtWhichAMediumHasNoIndex) {
  EyeQuery query;
  query.eye = "arizona";  // whose Abbe numbers make formulas that grow without end
  for (const double nm : {380.0, 1000.0}) {
    query.wavelength_nm = nm;
    EXPECT_NO_THROW(describe_eye(query)) << nm;
  }
  EyeModel eye = make_eye("navarro");
  eye.media.at("aqueous").dispersion = {Dispersion::Formula::cornu, {1.3, 1, 1200}};
  const std::filesystem::path file =
      std::filesystem::path(testing::TempDir()) / ("emmetrope-pole-" + std::to_string(::getpid()) + ".json");
  write_eye(file, eye);
  query.eye = file.string();
  query.wavelength_nm = 1199.5;
  EXPECT_THROW(describe_eye(query), Error);
}

TEST(EyeCommand, WritesAnEyeThatGivesTheSameAnswer) {
  EyeQuery query;
  query.eye = "arizona";
  query.options.accommodation_D = 3;
  query.options.pupil_mm = 5;
  query.wavelength_nm = 500;
  const std::filesystem::path file = std::filesystem::path(testing::TempDir()) /
                                     ("emmetrope-arizona-" + std::to_string(::getpid()) + ".json");
  query.output = file.string();
  Json first = describe_eye(query).json;
  EXPECT_EQ(first.at("files"), Json{file.string()});
  first.erase("files");
  EyeQuery again;
  again.eye = file.string();
  again.wavelength_nm = 500;
  EXPECT_EQ(describe_eye(again).json, first);
}

TEST(EyeCommand, RefusesAnIrisInAnotherUnit) {
  for (const char* pupil : {"0.003", "0.3", "15"}) {
    CLI::App app;
    EyeOptions options;
    declare_eye_options(app, options);
    EXPECT_THROW(app.parse("--pupil " + std::string(pupil)), CLI::ValidationError) << pupil;
  }
}

TEST(RayCommand, GivesEveryHitAndAnOpenSchematicIris) {
  RayQuery query;
  query.eye = "gullstrand";
  query.from_mm = {0, 3, 10};
  query.to_mm = {0, 3, 0};
  Json json = describe_ray(query).json;
  EXPECT_EQ(json["state"], "reached");
  EXPECT_EQ(json["at"], "retina");
  EXPECT_EQ(json["hits"].size(), 7u);
  EXPECT_EQ(json["hits"][0]["surface"], "cornea_anterior");
  EXPECT_EQ(json["hits"][0]["position_mm"].size(), 3u);
  EXPECT_EQ(json["hits"][0]["direction"].size(), 3u);
  EXPECT_NEAR(json["hits"][0]["opl_mm"].get<double>(), 10 + 7.7 - std::sqrt(7.7 * 7.7 - 9), 1e-12);
  query.options.pupil_mm = 3;
  json = describe_ray(query).json;
  EXPECT_EQ(json["state"], "vignetted");
  EXPECT_EQ(json["at"], "iris");
}

TEST(RayCommand, HowFarOffARayBeginsDoesNotMatter) {
  RayQuery query;
  query.eye = "navarro";
  query.to_mm = {0.5, 1, 0};
  query.from_mm = {0.5, 1, 20};
  const Json near = describe_ray(query).json.at("hits");
  for (const double far_mm : {1e3, 1e6, 1e10, 1e15}) {
    query.from_mm = {0.5, 1, far_mm};
    const Json far = describe_ray(query).json.at("hits");
    ASSERT_EQ(far.size(), near.size()) << far_mm;
    for (std::size_t i = 0; i < near.size(); ++i) {
      for (std::size_t k = 0; k < 3; ++k)
        EXPECT_NEAR(far[i]["position_mm"][k].get<double>(), near[i]["position_mm"][k].get<double>(), 1e-9);
      EXPECT_NEAR(far[i]["opl_mm"].get<double>() - far_mm, near[i]["opl_mm"].get<double>() - 20,
                  1e-9 + 1e-15 * far_mm);
    }
  }
}

TEST(RayCommand, ARayAwayFromTheEyeMeetsNothing) {
  RayQuery query;
  query.eye = "navarro";
  query.from_mm = {0, 0, 20};
  query.to_mm = {0, 0, 30};
  const Json json = describe_ray(query).json;
  EXPECT_TRUE(json["hits"].empty());
  EXPECT_EQ(json["state"], "missed_surface");
}

/// The retina of Navarro's eye, a closed sphere, and of Atchison's, an open form, lie about 24 mm behind the cornea.
TEST(RayCommand, ARayOutOfTheEyeStartsOnTheRetina) {
  for (const auto& [eye, length_mm] : {std::pair{"navarro", 24.00}, {"atchison:-1", 23.88}}) {
    RayQuery query;
    query.eye = eye;
    query.to_mm = {0, 0, 20};
    query.from_mm = {0, 0, -length_mm};
    EXPECT_EQ(describe_ray(query).json["state"], "reached") << eye;
    // Behind it, the globe's middle, the vitreous before the middle, the lens, the cornea.
    for (const double z_mm : {-30.0, -12.0, -11.996, -10.0, -5.0, -0.05}) {
      query.from_mm = {0, 0, z_mm};
      EXPECT_THROW(describe_ray(query), Error) << eye << " " << z_mm;
    }
  }
}

TEST(RayCommand, RefusesARayWithoutDirection) {
  RayQuery query;
  query.eye = "navarro";
  query.from_mm = query.to_mm = {0, 0, 10};
  EXPECT_THROW(describe_ray(query), Error);
  query.to_mm = {1, 0, 10};
  EXPECT_THROW(describe_ray(query), Error);
}

}  // namespace
}  // namespace emmetrope
