#include "correction/stage.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "tests/support/measured_optics.hpp"
#include "tests/support/temporary_folder.hpp"

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
                                                    {"size", {50, 50}},
                                                    {"field_mm", {6, 6}},
                                                    {"fovea_mm", {0, 0}},
                                                    {"lens_index", nullptr},
                                                    {"age_years", 40}}}});
    settings_.prescription.verbosity.quiet = true;
    common_.verbosity.quiet = true;
    common_.threads = 2;
  }

  const fs::path& folder() const { return temporary_.path(); }
  Answer correct() {
    settings_.known = parse_known_data(known_);
    return correct_case(folder(), settings_, common_);
  }
  Json prescription() { return correct().json["eyes"]["od"]; }
  void expect_usage_error() {
    try {
      correct();
      ADD_FAILURE() << "was accepted";
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::usage) << error.what();
    }
  }

  test::TemporaryFolder temporary_;
  CorrectionSettings settings_;
  KnownDataFlags known_;
  CommonOptions common_;
};

double width(const Json& measured) {
  return measured["ci95"][1].get<double>() - measured["ci95"][0].get<double>();
}

TEST_F(CorrectStage, WhatTheClinicKnowsIsLearntAndNotClaimed) {
  known_.instruments.axial_length = {"od:24.00+-0.01"};
  const Json eye = prescription();
  EXPECT_EQ(eye["learnt_from"], Json({"biometry"}));
  EXPECT_FALSE(eye.contains("calibration"));

  // What glasses the patient is content with is half a dioptre off what the images say.
  const double said_D = eye["M_D"]["value"], given_D = said_D - 0.5;
  const double cylinder_D = eye["cylinder_D"]["value"], axis_deg = eye["axis_deg"]["value"];
  known_.refractions = {"od:" + std::to_string(given_D - cylinder_D / 2) + "/" + std::to_string(cylinder_D) +
                        "x" + std::to_string(axis_deg) + "@12+-0.1"};
  const Json calibrated = prescription();
  EXPECT_EQ(calibrated["M_D"]["source"], "refraction");
  EXPECT_NEAR(calibrated["M_D"]["value"], given_D, 0.02);
  EXPECT_NEAR(calibrated["calibration"]["without_it"]["sphere_D"]["value"].get<double>() + cylinder_D / 2,
              said_D, 0.01);
  EXPECT_LT(width(calibrated["M_D"]), 2 * 1.96 * 0.1);
  EXPECT_LT(width(calibrated["M_D"]), width(eye["M_D"]) / 3);
  // Off in one of three numbers, by half a dioptre: as rare as chi2 with three degrees of freedom.
  const double sigma_D = width(eye["M_D"]) / (2 * 1.96);
  const double chi = 0.5 / std::hypot(sigma_D, 0.1);
  const double rarity = std::erfc(chi / std::sqrt(2)) + std::sqrt(2 / pi) * chi * std::exp(-chi * chi / 2);
  EXPECT_NEAR(std::erfc(calibrated["calibration"]["surprise_sigma"].get<double>() / std::sqrt(2)), rarity,
              0.02);
  EXPECT_NEAR(width(calibrated["calibration"]["without_it"]["M_D"]), width(eye["M_D"]), 0.02);
  // -155 D per unit of index, of which the index takes its share of the variance.
  const double moved = calibrated["calibration"]["lens_index_after"]["value"].get<double>() -
                       calibrated["calibration"]["lens_index_before"].get<double>();
  EXPECT_GT(moved, 0.25 * 0.5 / 155);
  EXPECT_LT(moved, 0.5 / 155);
}

// The picture through the best lens is the case's, but for that lens.
TEST_F(CorrectStage, OfAPictureThatShowsMoreThanTheEyeIsRefused) {
  const fs::path file = folder() / "raytrace/stage.json";
  const Json plain = read_json(file);
  for (const auto& [key, value] :
       std::vector<std::pair<const char*, Json>>{{"spectacle", {{"sphere_D", -6}}},
                                                 {"plano_cylinder", {{"power_D", 2}}},
                                                 {"gaze_deg", {{"od", {0, 10}}, {"os", {0, 10}}}},
                                                 {"motion_deg", {0.5, 0}},
                                                 {"pupillary_distance_mm", 62},
                                                 {"field_deg", {30, 30}}}) {
    Json stage = plain;
    stage["parameters"][key] = value;
    write_json(file, stage);
    SCOPED_TRACE(key);
    expect_usage_error();
  }
  Json stage = plain;
  stage["parameters"].update({{"spectacle", nullptr},
                              {"gaze_deg", {{"od", {0, 0}}}},
                              {"motion_deg", {0, 0}},
                              {"field_deg", nullptr}});
  write_json(file, stage);
  EXPECT_NO_THROW(correct());
}

TEST_F(CorrectStage, TheStudysAgeIsTheEyes) {
  write_json(folder() / "case.json", {{"subject", {{"age_years", 38}}}});
  settings_.what_if.age_years = 60;
  const Json accommodation = prescription()["what_if"]["accommodation"];
  EXPECT_EQ(accommodation["age_years"], 38);
  const auto warnings = [&] { return read_json(folder() / "correction/stage.json")["warnings"].dump(); };
  EXPECT_NE(warnings().find("60 years, is not used"), std::string::npos);
  settings_.what_if.age_years.reset();
  correct();
  EXPECT_EQ(warnings().find("is not used"), std::string::npos);
}

// The lens's index is of the age at which the eye was traced.
TEST_F(CorrectStage, AtTheAgeAtWhichItWasTraced) {
  const fs::path file = folder() / "raytrace/stage.json";
  Json stage = read_json(file);
  const auto trace_at = [&](const Json& age_years, const Json& lens_index) {
    stage["parameters"]["age_years"] = age_years;
    stage["parameters"]["lens_index"] = lens_index;
    write_json(file, stage);
  };
  settings_.what_if.age_years = 100;
  for (const auto& [traced, said] :
       {std::pair<Json, std::string>(nullptr, "40 years, as no age was known"), {60, "60 years"}}) {
    trace_at(traced, nullptr);
    try {
      correct();
      ADD_FAILURE() << said;
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::usage);
      EXPECT_NE(std::string(error.what()).find("--age 100: the case was traced at " + said),
                std::string::npos)
          << error.what();
      EXPECT_NE(error.remedy().find("emmetrope trace " + folder().string() + " --age 100"),
                std::string::npos);
    }
  }
  const auto sigma = [&] {
    return read_json(folder() / "correction/stage.json")["parameters"]["lens_index_sigma"].get<double>();
  };
  trace_at(100, nullptr);
  EXPECT_EQ(prescription()["what_if"]["accommodation"]["age_years"], 100);
  EXPECT_NEAR(sigma(), std::hypot(0.005, 0.00039 * 30), 1e-12);
  trace_at(nullptr, 1.42);  // an index that is told is of no age
  EXPECT_EQ(prescription()["what_if"]["accommodation"]["age_years"], 100);
  EXPECT_EQ(sigma(), 0);
}

TEST_F(CorrectStage, ALensOlderThanAnyThatWasMeasuredIsLessKnown) {
  const auto sigma_at = [&](double age_years) {
    write_json(folder() / "case.json", {{"subject", {{"age_years", age_years}}}});
    correct();
    return read_json(folder() / "correction/stage.json")["parameters"]["lens_index_sigma"].get<double>();
  };
  EXPECT_EQ(sigma_at(70), 0.005);
  EXPECT_NEAR(sigma_at(100), std::hypot(0.005, 0.00039 * 30), 1e-12);
}

// Of a chart at 0.4 m the prescription would be 2.5 D off.
TEST_F(CorrectStage, APrescriptionIsForDistance) {
  for (const char* chart : {"siemens:distance_mm=400", "siemens:distance_mm=6000", "cards", "pyramids"}) {
    SCOPED_TRACE(chart);
    settings_.prescription.chart = chart;
    expect_usage_error();
  }
  settings_.prescription.chart = "siemens";
  const double by_chart_D = prescription()["M_D"]["value"];
  settings_.prescription.chart = "siemens:distance_mm=inf";
  EXPECT_EQ(prescription()["M_D"]["value"].get<double>(), by_chart_D);
}

// Prescription, wavefront and pictures of a case are of one point of the retina.
TEST_F(CorrectStage, OfThePointThatWasTraced) {
  settings_.fovea_mm = Eigen::Vector2d(0.5, 0);
  expect_usage_error();
  const fs::path file = folder() / "raytrace/stage.json";
  Json stage = read_json(file);
  stage["parameters"]["fovea_mm"] = {0.5, 0};
  write_json(file, stage);
  const double there_D = prescription()["M_D"]["value"];
  settings_.fovea_mm.reset();
  EXPECT_EQ(prescription()["M_D"]["value"].get<double>(), there_D);
  settings_.fovea_mm = Eigen::Vector2d(0, 0);
  expect_usage_error();
}

TEST_F(CorrectStage, RightAndLeftAreNeverSwapped) {
  // The left eye is the right one's mirror image, but 0.4 mm longer, and only the right one has been measured
  // elsewhere.
  Json left = measured_optics();
  for (Json& surface : left["eye"]["surfaces"])
    if (surface.contains("axis_deg")) surface["axis_deg"] = 180 - surface["axis_deg"].get<double>();
  left["eye"]["surfaces"].back()["position_mm"] = 24.4;
  Json traced = left["eye"];
  for (std::size_t i = 0; i < left["parameters"].size(); ++i) {
    if (left["parameters"][i] == "cornea_j45_per_mm") left["values"][i] = -left["values"][i].get<double>();
    if (left["parameters"][i] == "optical_axial_length_mm") left["values"][i] = 24.4;
  }
  fs::create_directories(folder() / "meshing/os");
  fs::create_directories(folder() / "raytrace/os");
  write_json(folder() / "meshing/os/optics.json", left);
  // A mesh's vertex lies a little off the length that has been measured, which is what biometers would
  // report.
  traced["surfaces"].back()["position_mm"] = 24.38;
  write_json(folder() / "raytrace/os/eye.json", traced);
  known_.instruments.axial_length = {"od:25.00+-0.01"};
  known_.refractions = {"od:-5.00"};
  common_.laterality = LateralityChoice::os;
  fs::create_directories(folder() / "correction/od");  // of an earlier run
  const Json eyes = correct().json["eyes"];
  ASSERT_EQ(eyes.size(), 1U);
  EXPECT_EQ(eyes["os"]["what_if"]["intra_ocular_lens"]["axial_length_mm"], 24.4);
  // What was given of the right eye is left out, what there was of it goes: not without a word.
  const Json warnings = read_json(folder() / "correction/stage.json")["warnings"];
  for (const char* said : {"OD (right): what was measured of it elsewhere is not used",
                           "OD (right): its earlier correction is dropped"})
    EXPECT_TRUE(std::any_of(warnings.begin(), warnings.end(), [&](const Json& warning) {
      return warning.get<std::string>().rfind(said, 0) == 0;
    })) << said;
  const Json& os = eyes["os"];
  EXPECT_EQ(os["laterality"], "os");
  EXPECT_EQ(os["learnt_from"], Json::array());
  EXPECT_FALSE(os.contains("calibration"));
  EXPECT_EQ(read_json(folder() / "correction/os/prescription.json"), os);
  EXPECT_FALSE(fs::exists(folder() / "correction/od"));
  // The cornea is steepest at 160 degrees, so that a minus cylinder's axis lies at 70; the right eye's would
  // be 110.
  EXPECT_NEAR(os["axis_deg"]["value"], 90 - 0.35 / degree, 0.5);
  const PowerVector expected = refraction_by_spot(eye_from_json(traced, "."), settings_.prescription);
  EXPECT_NEAR(os["M_D"]["value"], expected.M_D, 0.05);
  EXPECT_NEAR(os["J45_D"]["value"], expected.J45_D, 0.05);
}

TEST_F(CorrectStage, AKnownLensIndexStaysAndTheRestMoves) {
  const Json optics = measured_optics();
  UncertainOptics uncertain = uncertain_optics_from_json(optics, ".", 0);
  const EyeModel eye = uncertain.model;
  const raytrace::Tracer tracer("", 2);
  const PowerVector spot = refraction_by_spot(eye, settings_.prescription);
  StatedRefraction stated;
  stated.refraction.sphere_D = spot.M_D - 1;
  const Calibration calibration = calibrate(tracer, eye, uncertain, stated, settings_.prescription);
  EXPECT_TRUE(calibration.index_was_known);
  EXPECT_EQ(calibration.index_after.value, calibration.index_before);
  EXPECT_NE(calibration.index_after.source, "refraction");
  EXPECT_LT(refraction_by_spot(uncertain.model, settings_.prescription).M_D, spot.M_D - 0.2);
}

TEST_F(CorrectStage, AKnownRefractionIsOfSodiumLight) {
  // Media that disperse as water does: in blue the eye is a dioptre more myopic, and a refraction that says what the eye
  // is in sodium light changes nothing.
  Json optics = measured_optics();
  for (Json& medium : optics["eye"]["media"]) medium["abbe"] = {medium["index"], 55};
  UncertainOptics uncertain = uncertain_optics_from_json(optics, ".", 0.005);
  const EyeModel eye = uncertain.model;
  PrescriptionSettings in_blue = settings_.prescription;
  in_blue.wavelength_nm = 450;
  const PowerVector sodium = refraction_by_spot(eye, settings_.prescription),
                    blue = refraction_by_spot(eye, in_blue);
  EXPECT_LT(blue.M_D, sodium.M_D - 0.5);
  StatedRefraction stated;
  stated.refraction = to_sphero_cylinder(sodium);
  stated.sigma_D = 0.1;
  const raytrace::Tracer tracer("", 2);
  const Calibration calibration = calibrate(tracer, eye, uncertain, stated, in_blue);
  EXPECT_NEAR(calibration.index_after.value, calibration.index_before, 0.001);
  EXPECT_NEAR(calibration.before.M_D, blue.M_D, 0.2);
  EXPECT_NEAR(refraction_by_spot(uncertain.model, in_blue).M_D, blue.M_D, 0.2);
}

TEST_F(CorrectStage, AnEyeThatWasNotTracedIsNamedAndTheCaseLeftAsItIs) {
  common_.laterality = LateralityChoice::os;
  fs::create_directories(folder() / "correction/od");
  write_file(folder() / "correction/od/kept", "");
  try {
    correct_case(folder(), settings_, common_);
    ADD_FAILURE() << "was accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), ExitStatus::input_invalid) << error.what();
    EXPECT_NE(std::string(error.what()).find("--laterality"), std::string::npos);
  }
  EXPECT_TRUE(fs::exists(folder() / "correction/od/kept"));
}

TEST_F(CorrectStage, OfANamedEyeAllFilesAreWrittenOrNone) {
  const auto status_of = [&](const fs::path& output) {
    try {
      correct_eye(make_eye("navarro"), output, settings_, common_);
      return ExitStatus::done;
    } catch (const Error& error) {
      return error.status();
    }
  };
  settings_.picture.scene = "nosuch";
  EXPECT_EQ(status_of(folder() / "named"), ExitStatus::usage);
  EXPECT_FALSE(fs::exists(folder() / "named"));
  settings_.picture.scene = "letters";
  EXPECT_EQ(status_of("/proc/named"), ExitStatus::not_writable);
  // What is not this eye's goes where no lens is sharpest, and nothing else does.
  settings_.prescription.chart = "dial:contrast=0";
  fs::create_directories(folder() / "named");
  for (const char* name : {"prescription.json", "notes.txt"}) write_file(folder() / "named" / name, "");
  EXPECT_EQ(status_of(folder() / "named"), ExitStatus::no_result);
  EXPECT_FALSE(fs::exists(folder() / "named/prescription.json"));
  EXPECT_TRUE(fs::exists(folder() / "named/notes.txt"));
  EXPECT_FALSE(fs::exists(folder() / "named/.writing-correction"));
}

// In metres the lens would stand in the cornea's plane.
TEST_F(CorrectStage, OfANamedEyeTheSettingsAreCheckedAsOfACase) {
  settings_.prescription.vertex_distance_mm = 0.012;
  expect_usage_error();
  try {
    correct_eye(make_eye("navarro"), folder() / "named", settings_, common_);
    ADD_FAILURE() << "was accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), ExitStatus::usage) << error.what();
    EXPECT_EQ(std::string(error.what()),
              "--vertex-distance (vertex_distance_mm) is 0.012 mm, outside 5 to 30");
    EXPECT_EQ(error.remedy(), "give 5 to 30 mm, or 0 for a contact lens");
  }
  EXPECT_FALSE(fs::exists(folder() / "named"));
}

TEST_F(CorrectStage, ANamedEyesLensIndexIsKnown) {
  settings_.lens_index_sigma = 0.01;
  try {
    correct_eye(make_eye("navarro"), folder() / "named", settings_, common_);
    ADD_FAILURE() << "was accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), ExitStatus::usage) << error.what();
  }
  EXPECT_FALSE(fs::exists(folder() / "named"));
}

TEST_F(CorrectStage, SettingsAreRefusedByFlagAndField) {
  const auto said = [](const auto& change) {
    CorrectionSettings settings;
    change(settings);
    try {
      settings.check();
      return std::string("was accepted");
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::usage);
      return std::string(error.what());
    }
  };
  EXPECT_EQ(said([](auto& s) { s.picture.samples = 0; }),
            "--samples (picture.samples) is 0, outside 1 to 100000");
  EXPECT_EQ(said([](auto& s) { s.lens_index_sigma = 1; }),
            "--lens-index-sigma (lens_index_sigma) is 1, outside 0 to 0.05");
  EXPECT_EQ(said([](auto& s) { s.what_if.age_years = 140; }),
            "--age (what_if.age_years) is 140 years, outside 0 to 110");
  EXPECT_EQ(said([](auto& s) { s.what_if.iol_target_D = 6; }),
            "--iol-target (what_if.iol_target_D) is 6 D, outside -10 to 5");
  EXPECT_EQ(said([](auto& s) { s.what_if.iol_a_constant = 1; }),
            "--iol-a-constant (what_if.iol_a_constant) is 1, outside 110 to 125");
}

TEST_F(CorrectStage, WhatCannotBeLearntIsAUsageError) {
  for (const char* text : {"-2.25/-1.00x180", "ou:-2.25", "od:-2.25/-1x190", "od:minus two"}) {
    known_.refractions = {text};
    expect_usage_error();
  }
  known_.refractions.clear();
  known_.instruments.keratometry = {"od:43@180/44@90"};
  write_json(folder() / "meshing/stage.json",
             {{"verdict", {{"status", 0}, {"reasons", Json::array()}}},
              {"parameters", {{"instruments", {{"od", {{"topography", {{"file", "map.csv"}}}}}}}}}});
  expect_usage_error();
}

}  // namespace
}  // namespace emmetrope::correction
