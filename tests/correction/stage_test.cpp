#include "correction/stage.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/frames.hpp"
#include "tests/base/temporary_folder.hpp"
#include "tests/correction/measured_optics.hpp"

namespace emmetrope::correction {
namespace {

namespace fs = std::filesystem;

/// A case whose right eye has been meshed and traced, as formulas.
class CorrectStage : public testing::Test {
 protected:
  void SetUp() override {
    const Json optics = measured_optics();
    fs::create_directories(folder() / "meshing/od");
    fs::create_directories(folder() / "raytrace/od");
    write_json(folder() / "meshing/od/optics.json", optics);
    write_json(folder() / "raytrace/od/eye.json", optics["eye"]);
    const Json done = {{"status", 0}, {"reasons", Json::array()}};
    write_json(folder() / "meshing/stage.json", {{"verdict", done}, {"parameters", Json::object()}});
    write_json(folder() / "raytrace/stage.json", {{"verdict", done},
                                                  {"parameters",
                                                   {{"scene", "letters"},
                                                    {"samples", 4},
                                                    {"pupil_mm", 4},
                                                    {"size", "50x50"},
                                                    {"field_mm", "6x6"},
                                                    {"fovea", "0,0"},
                                                    {"lens_index", nullptr},
                                                    {"age_years", 40}}}});
    settings_.prescription.verbosity.quiet = true;
    common_.verbosity.quiet = true;
    common_.threads = 2;
  }

  const fs::path& folder() const { return temporary_.path(); }
  Json prescription() { return correct_case(folder(), settings_, common_).json["eyes"]["od"]; }
  void expect_usage_error() {
    try {
      correct_case(folder(), settings_, common_);
      ADD_FAILURE() << "was accepted";
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::usage) << error.what();
    }
  }

  test::TemporaryFolder temporary_;
  CorrectionSettings settings_;
  CommonOptions common_;
};

double width(const Json& measured) {
  return measured["ci95"][1].get<double>() - measured["ci95"][0].get<double>();
}

TEST_F(CorrectStage, WhatTheClinicKnowsIsLearntAndNotClaimed) {
  settings_.known.instruments.axial_length = {"od:24.00+-0.01"};
  const Json eye = prescription();
  EXPECT_EQ(eye["learnt_from"], Json({"biometry"}));
  EXPECT_FALSE(eye.contains("calibration"));

  // What glasses the patient is content with is half a dioptre off what the images say.
  const double said_D = eye["M_D"]["value"], given_D = said_D - 0.5;
  const double cylinder_D = eye["cylinder_D"]["value"], axis_deg = eye["axis_deg"]["value"];
  settings_.known.refractions = {"od:" + std::to_string(given_D - cylinder_D / 2) + "/" +
                                 std::to_string(cylinder_D) + "x" + std::to_string(axis_deg) + "@12+-0.1"};
  const Json calibrated = prescription();
  EXPECT_EQ(calibrated["M_D"]["source"], "refraction");
  EXPECT_NEAR(calibrated["M_D"]["value"], given_D, 0.02);
  EXPECT_NEAR(calibrated["calibration"]["without_it"]["sphere_D"].get<double>() + cylinder_D / 2, said_D,
              0.01);
  EXPECT_LT(width(calibrated["M_D"]), 2 * 1.96 * 0.1);
  EXPECT_LT(width(calibrated["M_D"]), width(eye["M_D"]) / 3);
  // Off in one of three numbers, by half a dioptre.
  const double sigma_D = width(eye["M_D"]) / (2 * 1.96);
  EXPECT_NEAR(calibrated["calibration"]["surprise_sigma"], 0.5 / std::hypot(sigma_D, 0.1) / std::sqrt(3),
              0.02);
  // -155 D per unit of index, of which the index takes its share of the variance.
  const double moved = calibrated["calibration"]["lens_index_after"]["value"].get<double>() -
                       calibrated["calibration"]["lens_index_before"].get<double>();
  EXPECT_GT(moved, 0.25 * 0.5 / 155);
  EXPECT_LT(moved, 0.5 / 155);
}

TEST_F(CorrectStage, RightAndLeftAreNeverSwapped) {
  // The left eye is the right one's mirror image, but 0.4 mm longer, and only the right one has been measured
  // elsewhere.
  Json left = measured_optics();
  for (Json& surface : left["eye"]["surfaces"])
    if (surface.contains("axis_deg")) surface["axis_deg"] = 180 - surface["axis_deg"].get<double>();
  left["eye"]["surfaces"].back()["position_mm"] = 24.4;
  for (std::size_t i = 0; i < left["parameters"].size(); ++i) {
    if (left["parameters"][i] == "cornea_j45_per_mm") left["values"][i] = -left["values"][i].get<double>();
    if (left["parameters"][i] == "optical_axial_length_mm") left["values"][i] = 24.4;
  }
  fs::create_directories(folder() / "meshing/os");
  fs::create_directories(folder() / "raytrace/os");
  write_json(folder() / "meshing/os/optics.json", left);
  write_json(folder() / "raytrace/os/eye.json", left["eye"]);
  settings_.known.instruments.axial_length = {"od:25.00+-0.01"};
  settings_.known.refractions = {"od:-5.00"};
  common_.laterality = LateralityChoice::os;
  const Json eyes = correct_case(folder(), settings_, common_).json["eyes"];
  ASSERT_EQ(eyes.size(), 1U);
  const Json& os = eyes["os"];
  EXPECT_EQ(os["laterality"], "os");
  EXPECT_EQ(os["learnt_from"], Json::array());
  EXPECT_FALSE(os.contains("calibration"));
  EXPECT_EQ(read_json(folder() / "correction/os/prescription.json"), os);
  EXPECT_FALSE(fs::exists(folder() / "correction/od"));
  // The cornea is steepest at 160 degrees, so that a minus cylinder's axis lies at 70; the right eye's would
  // be 110.
  EXPECT_NEAR(os["axis_deg"]["value"], 90 - 0.35 / degree, 0.5);
  const PowerVector expected = refraction_by_spot(eye_from_json(left["eye"], "."), settings_.prescription);
  EXPECT_NEAR(os["M_D"]["value"], expected.M_D, 0.05);
  EXPECT_NEAR(os["J45_D"]["value"], expected.J45_D, 0.05);
}

TEST_F(CorrectStage, WhatCannotBeLearntIsAUsageError) {
  for (const char* text : {"-2.25/-1.00x180", "ou:-2.25", "od:-2.25/-1x190", "od:minus two"}) {
    settings_.known.refractions = {text};
    expect_usage_error();
  }
  settings_.known.refractions.clear();
  settings_.known.instruments.keratometry = {"od:43@180/44@90"};
  write_json(folder() / "meshing/stage.json", {{"verdict", {{"status", 0}, {"reasons", Json::array()}}},
                                               {"parameters", {{"topography", {"od:map.csv"}}}}});
  expect_usage_error();
}

}  // namespace
}  // namespace emmetrope::correction
