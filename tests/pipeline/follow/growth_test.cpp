#include "pipeline/follow/growth.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <tuple>

#include "pipeline/base/files.hpp"
#include "pipeline/base/process.hpp"
#include "pipeline/eye/instruments/instruments.hpp"
#include "pipeline/follow/quantities.hpp"
#include "pipeline/follow/visits.hpp"
#include "tests/support/fixture_case.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope::follow {
namespace {

namespace fs = std::filesystem;

/// An eye of this length whose parameters are known independently of one another.
ParametricEye eye_of(double axial_length_mm, double length_sigma_mm, double chamber_mm = 3.4) {
  ParametricEye eye;
  eye.axial_length_mm = axial_length_mm;
  eye.anterior_chamber_depth_mm = chamber_mm;
  eye.parameter_names = {"cornea_c_per_mm",     "cornea_j0_per_mm",          "cornea_j45_per_mm",
                         "axial_length_mm",     "anterior_chamber_depth_mm", "lens_thickness_mm",
                         "globe_semi_axis_z_mm"};
  const auto count = static_cast<Eigen::Index>(eye.parameter_names.size());
  eye.covariance = Eigen::MatrixXd::Zero(count, count);
  const double sigma[] = {0.001, 0.001, 0.001, length_sigma_mm, 0.05, 0.05, 0.1};
  for (Eigen::Index i = 0; i < count; ++i) eye.covariance(i, i) = sigma[i] * sigma[i];
  return eye;
}

/// Mean and standard deviation of a parameter's change in a year.
std::pair<double, double> change_of(const Growth& growth, const std::string& parameter) {
  const auto found = std::find(growth.parameters.begin(), growth.parameters.end(), parameter);
  const auto place = std::distance(growth.parameters.begin(), found);
  return {growth.per_year.mean[place], std::sqrt(growth.per_year.covariance(place, place))};
}

TEST(Growth, IsTheSlopeOfARegressionWithAPrior) {
  // Straight line through independent points with an unknown beginning: precision sum (t - mean t)^2 / sigma^2, and that
  // of the prior; here in closed form.
  constexpr double sigma = 0.08;
  const std::vector<double> years{0, 0.9, 2.2, 3.1}, lengths{23.5, 23.71, 23.8, 24.05};
  std::vector<EyeAtVisit> visits;
  double mean_year = 0, mean_length = 0;
  for (std::size_t i = 0; i < years.size(); ++i) {
    visits.push_back({fitted_eye(eye_of(lengths[i], sigma)), years[i]});
    mean_year += years[i] / 4;
    mean_length += lengths[i] / 4;
  }
  double squares = 0, products = 0;
  for (std::size_t i = 0; i < years.size(); ++i) {
    squares += (years[i] - mean_year) * (years[i] - mean_year);
    products += (years[i] - mean_year) * (lengths[i] - mean_length);
  }
  const double prior = change_sigma("axial_length_mm");
  const double variance = 1 / (squares / (sigma * sigma) + 1 / (prior * prior));
  const auto [mean, deviation] = change_of(growth_of(visits, 0), "axial_length_mm");
  EXPECT_NEAR(mean, variance * products / (sigma * sigma), 1e-6);
  EXPECT_NEAR(deviation, std::sqrt(variance), 1e-6);
}

/// Children are seen every few months: what was measured of the globe is not drawn towards no growth.
TEST(Growth, OfAGlobeOverMonthsIsTheDifferenceOverTheTime) {
  for (const double years : {0.25, 0.5, 1.0}) {
    const std::vector<EyeAtVisit> visits{{fitted_eye(eye_of(23.5, 0.1)), 0},
                                         {fitted_eye(eye_of(23.7, 0.1)), years}};
    const Growth growth = growth_of(visits, 0);
    const auto [mean, deviation] = change_of(growth, "axial_length_mm");
    EXPECT_NEAR(mean, 0.2 / years, 0.02 / years) << years;
    EXPECT_NEAR(deviation, std::sqrt(2) * 0.1 / years, 0.01 / years) << years;
  }
}

/// What the images say of a growth is named as of any other number.
TEST(Growth, ItsSourceIsTheImagesShare) {
  const auto length_over = [](double years) {
    return growth_of_quantities(
               growth_of({{fitted_eye(eye_of(23.5, 0.1)), 0}, {fitted_eye(eye_of(23.7, 0.1)), years}}, 0))
        .front();
  };
  EXPECT_EQ(length_over(1).source, "mri");
  EXPECT_GT(length_over(1).image_share.value(), 0.99);
  EXPECT_EQ(length_over(0.005).source, "prior");
}

TEST(Growth, OfWhatAnEyeDoesNotChangeIsHeld) {
  const std::vector<EyeAtVisit> visits{{fitted_eye(eye_of(23.5, 0.05, 3.3)), 0},
                                       {fitted_eye(eye_of(23.5, 0.05, 3.5)), 1}};
  const double prior = change_sigma("anterior_chamber_depth_mm"), noise = 2 * 0.05 * 0.05;
  const auto [mean, deviation] = change_of(growth_of(visits, 0), "anterior_chamber_depth_mm");
  EXPECT_NEAR(mean, 0.2 * prior * prior / (prior * prior + noise), 1e-6);
  EXPECT_LT(deviation, prior);
}

TEST(Growth, TheScannersScaleMakesLengthsLessCertain) {
  const std::vector<EyeAtVisit> visits{{fitted_eye(eye_of(24, 0.01)), 0},
                                       {fitted_eye(eye_of(24.1, 0.01)), 1}};
  const double alone = change_of(growth_of(visits, 0), "axial_length_mm").second;
  const double with_scale = change_of(growth_of(visits, 0.002), "axial_length_mm").second;
  const double more = with_scale * with_scale - alone * alone, whole = 2 * 0.002 * 24 * 0.002 * 24;
  EXPECT_LT(more, whole);  // what is held tells of the scale, too
  EXPECT_GT(more, 0.8 * whole);
}

// As biometry.json tells it: R = sqrt(R0^2 - Q 1.5^2), not at the apex.
TEST(Quantities, CornealPowerIsKeratometric) {
  ParametricEye eye = eye_of(23.5, 0.05);
  eye.cornea_c_per_mm = 1 / 7.8;
  eye.cornea_q = -0.25;
  eye.cornea_j0_per_mm = eye.cornea_j45_per_mm = 0;
  EXPECT_NEAR(quantities_of(eye)[6], 337.5 / std::sqrt(7.8 * 7.8 + 0.25 * 1.5 * 1.5), 1e-6);
}

// An error that is in every fit is in no difference: what is left are the covariances of each fit's own error.
TEST(Visits, WhatImagesShareIsTakenOutOfTheCovariance) {
  ParametricEye eye = eye_of(24, 0.15);
  const Eigen::Index length = 3, chamber = 4, depth = 6;
  eye.covariance(length, chamber) = eye.covariance(chamber, length) = -0.8 * 0.15 * 0.05;
  const Eigen::MatrixXd own = eye.covariance;
  Eigen::Matrix2d shared;
  shared << 0.13, 0.03, 0.03, 0.01;
  for (const auto& [i, row] : {std::pair{length, 0}, {depth, 1}})
    for (const auto& [k, column] : {std::pair{length, 0}, {depth, 1}})
      eye.covariance(i, k) += shared(row, column);
  const Json told{{"axial_length_mm", {{"axial_length_mm", 0.13}, {"globe_semi_axis_z_mm", 0.03}}},
                  {"globe_semi_axis_z_mm", {{"axial_length_mm", 0.03}, {"globe_semi_axis_z_mm", 0.01}}}};
  EXPECT_LT((without_shared_error(eye, told).covariance - own).norm(), 1e-12);
  EXPECT_EQ(without_shared_error(eye, Json::object()).covariance, eye.covariance);
  eye.covariance = own;
  EXPECT_THROW(without_shared_error(eye, told), Error);
}

class FollowCommand : public testing::Test {
 protected:
  fs::path visit(const std::string& name, double axial_length_mm) const {
    fs::path folder = temporary_.path() / name;
    test::FixtureOptions options;
    options.subject = "s-" + name;  // a study of its own
    test::make_fixture_case(folder, options);
    for (const char* eye : {"od", "os"}) {
      const fs::path file = folder / "segmentation" / eye / "fit.json";
      Json fit = read_json(file);
      fit["eye"] = to_json(eye_of(axial_length_mm, 0.03));
      fit["withheld"] = Json::object();
      write_json(file, fit);
    }
    return folder;
  }
  ProcessResult run(std::vector<std::string> words) const {
    words.insert(words.end(), {"-o", (temporary_.path() / "out").string(), "--json", "--quiet"});
    return run_process(fs::path(std::getenv("EMMETROPE_BIN")) / "emmetrope-follow", words,
                       ChildOutput::capture);
  }
  test::TemporaryFolder temporary_;
};

void set(const fs::path& file, const std::string& pointer, const Json& value) {
  Json json = read_json(file);
  json[Json::json_pointer(pointer)] = value;
  write_json(file, json);
}

/// However freely growth is measured: 3 mm in some months are another eye.
TEST(Growth, OfMillimetresInMonthsIsNoOneEyes) {
  const Growth growth =
      growth_of({{fitted_eye(eye_of(27.7, 0.2)), 0}, {fitted_eye(eye_of(24.4, 0.2)), 0.2}}, 0);
  const Difference length = differences_of_quantities(growth).front().front();
  EXPECT_NEAR(length.value, -3.3, 1e-6);
  EXPECT_NEAR(length.sigma, std::sqrt(2 * 0.2 * 0.2 + 0.2 * 0.2), 1e-3);
}

// The errors of both fits, 0.05 mm each, and what a chamber may change, 0.1 mm a year.
TEST(Growth, DifferencesAreComparedWithWhatBothFitsAndGrowthAllow) {
  for (const double years : {1.0, 3.0}) {
    const Growth growth = growth_of(
        {{fitted_eye(eye_of(23.5, 0.05, 3.3)), 0}, {fitted_eye(eye_of(23.5, 0.05, 3.78)), years}}, 0);
    ASSERT_EQ(growth.differences.size(), 1U);
    const Difference chamber = differences_of_quantities(growth).front().at(2);
    EXPECT_NEAR(chamber.value, 0.48, 1e-6);
    EXPECT_NEAR(chamber.sigma, std::sqrt(2 * 0.05 * 0.05 + 0.1 * 0.1 * years * years), 1e-6);
  }
}

TEST_F(FollowCommand, DoubtsEyesThatAreNotOne) {
  const fs::path first = visit("first", 23.5), second = visit("second", 23.6);
  set(second / "case.json", "/study_date", "2027-03-14");  // a year later
  const auto chamber = [&](double mm) {
    Json fit = read_json(second / "segmentation" / "od" / "fit.json");
    fit["eye"] = to_json(eye_of(23.6, 0.03, mm));
    write_json(second / "segmentation" / "od" / "fit.json", fit);
    return run({first.string(), second.string(), "--years", "0,1"});
  };
  EXPECT_EQ(Json::parse(chamber(3.5).output).at("warnings").size(), 0U);
  const ProcessResult doubted = chamber(3.4 + 0.48);
  EXPECT_EQ(doubted.status, 0);
  EXPECT_THAT(Json::parse(doubted.output).at("warnings").dump(),
              testing::HasSubstr("Anterior chamber of visit 2"));
  const ProcessResult refused = chamber(3.4 + 0.72);
  EXPECT_EQ(refused.status, 8);
  EXPECT_EQ(Json::parse(refused.output).at("warnings").size(), 0U);  // it is the reason
  EXPECT_TRUE(Json::parse(refused.output).at("eyes").at("od").contains("withheld"));
}

TEST_F(FollowCommand, SaysWhichReadingsItDoesNotUse) {
  const fs::path first = visit("first", 23.5), second = visit("second", 23.6);
  set(second / "case.json", "/study_date", "2027-03-14");
  const auto warnings = [&] {
    return Json::parse(run({first.string(), second.string(), "--years", "0,1"}).output).at("warnings").dump();
  };
  EXPECT_EQ(warnings(), "[]");
  InstrumentFlags flags;
  flags.axial_length = {"od:23.6"};
  flags.keratometry = {"od:43@180/44@90"};
  set(second / "meshing" / "stage.json", "/parameters/instruments", to_json(parse_instruments(flags, 0.2)));
  const std::string said = warnings();
  EXPECT_THAT(said, testing::HasSubstr(
                        "OD (right): axial length, keratometry by other instruments at visit 2: not used"));
  EXPECT_THAT(said, testing::Not(testing::HasSubstr("OS (left)")));
  EXPECT_THAT(said, testing::Not(testing::HasSubstr("visit 1")));
  set(second / "meshing" / "stage.json", "/parameters/instruments/od/measurements", nullptr);
  set(second / "meshing" / "stage.json", "/parameters/instruments/od/topography/file", "map.csv");
  EXPECT_THAT(warnings(), testing::HasSubstr("OD (right): topography by other instruments"));
}

TEST_F(FollowCommand, RefusesTwoPersonsAndOneScanTwice) {
  const fs::path first = visit("first", 23.5), second = visit("second", 23.6), same = visit("same", 23.5);
  const auto follow = [&](const fs::path& later) {
    return run({first.string(), later.string(), "--years", "0,1"});
  };
  EXPECT_EQ(follow(second).status, 0);
  EXPECT_EQ(follow(same).status, 3);
  EXPECT_THAT(follow(same).output, testing::HasSubstr("are one scan"));
  const fs::path noted = second / "case.json";
  set(noted, "/subject/sex", "M");
  EXPECT_THAT(follow(second).output, testing::HasSubstr("two persons: by (0010,0040) PatientSex"));
  set(noted, "/subject/sex", "F");
  set(noted, "/subject/age_years", 12);
  EXPECT_THAT(follow(second).output, testing::HasSubstr("41 and 12 years old"));
  set(noted, "/subject/age_years", 41);
  for (const auto& [key, value] :
       {std::pair("columns", 208.0), {"rows", 208.0}, {"min", 0.0}, {"max", 1492.0}, {"mean", 200.125}})
    for (const fs::path& one : {first / "case.json", noted}) set(one, std::string("/series/0/") + key, value);
  EXPECT_EQ(follow(second).status, 3);
  EXPECT_THAT(follow(second).output, testing::HasSubstr("visits 1 and 2 are one scan: their images"));
  set(noted, "/series/0/mean", 200.126);
  EXPECT_EQ(follow(second).status, 0);
  set(noted, "/subject/id", "s-first");
  EXPECT_THAT(follow(second).output, testing::HasSubstr("made from one study"));
}

TEST_F(FollowCommand, ComparesYearsWithTheStudiesDates) {
  const fs::path first = visit("first", 23.5), second = visit("second", 23.6);
  set(first / "case.json", "/study_date", "2026-03-14");
  set(second / "case.json", "/study_date", "2027-03-14");
  const auto warnings = [&](const std::string& years) {
    return Json::parse(run({first.string(), second.string(), "--years", years}).output).at("warnings").dump();
  };
  EXPECT_EQ(warnings("0,1.05"), "[]");
  const ProcessResult too_few = run({first.string(), second.string(), "--years", "0"});
  EXPECT_EQ(too_few.status, 2);
  EXPECT_THAT(too_few.output, testing::HasSubstr("--years: 1 number for 2 visits"));
  const ProcessResult mistyped = run({first.string(), second.string(), "--years", "0,10"});
  EXPECT_EQ(mistyped.status, 2);
  EXPECT_THAT(
      mistyped.output,
      testing::HasSubstr("10.00 years after visit 1, by the dates of their studies 1.00 (2026-03-14"));
  const ProcessResult turned = run({second.string(), first.string(), "--years", "0,1"});
  EXPECT_EQ(turned.status, 2);
  EXPECT_THAT(turned.output, testing::HasSubstr("by the dates of their studies -1.00"));
  set(second / "case.json", "/study_date", "2026-03-14");  // an anonymiser writes one date for all
  EXPECT_THAT(warnings("0,2"), testing::HasSubstr("by their studies both were on 2026-03-14"));
  set(second / "case.json", "/study_date", "2027-02-30");
  EXPECT_EQ(warnings("0,2"), "[]");  // that is no date
}

// A header without StudyDate is of no date, although objects made from it need one.
TEST_F(FollowCommand, StudiesWithoutDatesAreDatedByYears) {
  std::vector<std::string> folders;
  for (const auto& [name, length_mm, age_years] :
       {std::tuple{"first", 23.5, 7}, std::tuple{"second", 23.6, 12}}) {
    const fs::path folder = visit(name, length_mm),
                   study = temporary_.path() / (std::string(name) + "-study");
    test::make_fixture_study(study);
    std::vector<std::string> words{"-nb", "-ma", "(0008,0020)="};
    for (const auto& entry : fs::directory_iterator(study)) words.push_back(entry.path().string());
    run_process("/usr/bin/dcmodify", words, ChildOutput::discard);
    test::note_study(folder, study);
    set(folder / "case.json", "/study_date", nullptr);
    set(folder / "case.json", "/subject/age_years", age_years);
    folders.push_back(folder.string());
  }
  const ProcessResult ended = run({folders[0], folders[1], "--years", "0,5"});
  ASSERT_EQ(ended.status, 0) << ended.output;
  EXPECT_EQ(Json::parse(ended.output).at("warnings").size(), 0U);
  const ProcessResult mistyped = run({folders[0], folders[1], "--years", "0,1"});
  EXPECT_EQ(mistyped.status, 2);
  EXPECT_THAT(mistyped.output, testing::HasSubstr("1.0 years apart, and of patients 7 and 12 years old"));
}

TEST_F(FollowCommand, WarnsOfVisitsThatWereNotSegmentedAlike) {
  const fs::path first = visit("first", 23.5), second = visit("second", 23.6);
  set(second / "case.json", "/study_date", "2027-03-14");
  const auto warnings = [&] {
    return Json::parse(run({first.string(), second.string()}).output)
        .at("warnings")
        .get<std::vector<std::string>>();
  };
  EXPECT_THAT(warnings(), testing::IsEmpty());
  set(second / "segmentation" / "stage.json", "/version", "0.2.0");
  EXPECT_THAT(warnings(), testing::ElementsAre(testing::HasSubstr("(\"0.1.0+test\", \"0.2.0\")")));
  set(second / "segmentation" / "stage.json", "/version", "0.1.0+test");
  ParametricEye more = eye_of(23.6, 0.03);
  more.parameter_names.emplace_back("lens_equator_radius_mm");
  const auto count = static_cast<Eigen::Index>(more.parameter_names.size());
  more.covariance.conservativeResizeLike(Eigen::MatrixXd::Zero(count, count));
  more.covariance(count - 1, count - 1) = 0.01;
  set(second / "segmentation" / "od" / "fit.json", "/eye", to_json(more));
  EXPECT_THAT(warnings(), testing::ElementsAre(testing::HasSubstr(
                              "OD (right): the fit of visit 2 has other parameters than that of visit 1")));
}

TEST_F(FollowCommand, TellsGrowthWithItsInterval) {
  const std::string first = visit("first", 23.5).string(), second = visit("second", 23.8).string();
  const ProcessResult ended = run({first, second, "--years", "2020.5,2022.0"});
  ASSERT_EQ(ended.status, 0) << ended.output;
  const Json growth = Json::parse(ended.output).at("eyes").at("od").at("axial_length_mm");
  EXPECT_NEAR(growth.at("per_year").at("value").get<double>(), 0.2, 0.01);
  EXPECT_GT(growth.at("per_year").at("ci95").at(0).get<double>(), 0.1);
  EXPECT_EQ(growth.at("visits").size(), 2U);
  EXPECT_TRUE(fs::exists(temporary_.path() / "out" / "growth.html"));
  EXPECT_TRUE(fs::exists(temporary_.path() / "out" / "growth.pdf"));
}

TEST_F(FollowCommand, DoesNotReadWhatLaterStagesMade) {
  const fs::path first = visit("first", 23.5), second = visit("second", 23.8);
  write_file(second / "raytrace" / "stage.json", "{");
  write_file(second / "correction" / "od" / "prescription.json", "edited");
  const ProcessResult ended = run({first.string(), second.string(), "--years", "0,1"});
  EXPECT_EQ(ended.status, 0) << ended.output;
}

TEST_F(FollowCommand, SaysWhatIsWrongWithItsFolders) {
  const fs::path first = visit("first", 23.5), second = visit("second", 23.8),
                 missing = temporary_.path() / "none";
  const ProcessResult no_case = run({first.string(), missing.string(), "--years", "0,1"});
  EXPECT_EQ(no_case.status, 3);
  EXPECT_THAT(no_case.output, testing::HasSubstr("the case folder " + missing.string() + " does not exist"));
  write_file(temporary_.path() / "out", "a file where the folder is to be");
  const ProcessResult no_folder = run({first.string(), second.string(), "--years", "0,1"});
  EXPECT_EQ(no_folder.status, 5);
  EXPECT_THAT(no_folder.output, testing::HasSubstr("cannot make the folder"));
}

TEST_F(FollowCommand, ACorneaThatIsWithheldHasNoGrowth) {
  const std::string reason = "the cornea's shape is not visible";
  const fs::path first = visit("first", 23.5), second = visit("second", 23.8);
  set(second / "segmentation" / "od" / "fit.json", "/withheld/cornea", reason);
  const ProcessResult ended = run({first.string(), second.string(), "--years", "0,1"});
  ASSERT_EQ(ended.status, 0) << ended.output;
  const Json answer = Json::parse(ended.output), &eyes = answer.at("eyes");
  EXPECT_EQ(eyes.at("od").at("corneal_power_D"), (Json{{"withheld", "visit 2: " + reason}}));
  EXPECT_TRUE(eyes.at("od").at("axial_length_mm").contains("per_year"));
  EXPECT_TRUE(eyes.at("os").at("corneal_power_D").contains("per_year"));
  EXPECT_THAT(answer.at("warnings").dump(),
              testing::HasSubstr("OD (right): the growth of the cornea is withheld"));
}

/// Two visits in T1 at one field; what such images share of the error of the right eye's length is known.
class FollowAlikeImages : public FollowCommand {
 protected:
  static constexpr double own_mm = 0.08, shared_mm = 0.2;
  void SetUp() override {
    for (std::size_t i = 0; i < visits_.size(); ++i) {
      Json fit = read_json(fit_file(i));
      fit["eye"] = to_json(eye_of(i == 0 ? 23.5 : 23.6, std::hypot(own_mm, shared_mm)));
      fit["contrast"] = "T1";
      fit["shared_error"] = {
          {"images", "T1"},
          {"covariance", {{"axial_length_mm", {{"axial_length_mm", shared_mm * shared_mm}}}}}};
      write_json(fit_file(i), fit);
      set(visits_[i] / "case.json", "/stacks/0/contrast", "T1");
    }
  }
  fs::path fit_file(std::size_t i) const { return visits_[i] / "segmentation" / "od" / "fit.json"; }
  ProcessResult followed() const {
    return run({visits_[0].string(), visits_[1].string(), "--years", "0,1", "--scale-sd", "0"});
  }
  /// Of two fits and the spread of growth beforehand: 1 / (1 / (2 sigma^2) + 1 / prior^2).
  void expect_sigma(double of_fit_mm) const {
    const ProcessResult ended = followed();
    ASSERT_EQ(ended.status, 0) << ended.output;
    const auto growth =
        Json::parse(ended.output).at("eyes").at("od").at("axial_length_mm").at("per_year").get<Measured>();
    const double prior = change_sigma("axial_length_mm");
    EXPECT_NEAR(growth.sigma(), 1 / std::sqrt(1 / (2 * of_fit_mm * of_fit_mm) + 1 / (prior * prior)), 1e-4);
  }
  const std::array<fs::path, 2> visits_{visit("first", 23.5), visit("second", 23.6)};
};

TEST_F(FollowAlikeImages, GrowthHasNoErrorThatBothVisitsShare) {
  expect_sigma(own_mm);
  const fs::path later = visits_[1] / "case.json";
  for (const double field_T : {1.5, 0.0}) {  // another scanner, or nobody knows
    set(later, "/series/0/field_strength_T", field_T);
    expect_sigma(std::hypot(own_mm, shared_mm));
  }
  set(later, "/series/0/field_strength_T", 3.0);
  expect_sigma(own_mm);
  set(fit_file(1), "/shared_error/images", "T1, dark fat");  // which errs by something else
  expect_sigma(std::hypot(own_mm, shared_mm));
  set(fit_file(1), "/shared_error", nullptr);  // T1 and T2 joined
  expect_sigma(std::hypot(own_mm, shared_mm));
}

TEST_F(FollowAlikeImages, AnErrorThatCannotBeSharedStaysInTheInterval) {
  const fs::path fit = fit_file(1);
  for (const auto& [covariance, said] :
       {std::pair{Json{{"axial_length_mm", {{"axial_length_mm", 1}}}}, "more than the eye's own covariance"},
        {Json{{"nerve_mm", {{"nerve_mm", 1e-6}}}}, "shared_error of its fit.json has nerve_mm"}}) {
    set(fit, "/shared_error/covariance", covariance);
    expect_sigma(std::hypot(own_mm, shared_mm));
    const Json answer = Json::parse(followed().output);
    EXPECT_THAT(answer.at("warnings").dump(), testing::HasSubstr(std::string("OD (right): at visit 2 ")));
    EXPECT_THAT(answer.at("warnings").dump(), testing::HasSubstr(said));
    EXPECT_TRUE(answer.at("eyes").at("os").at("axial_length_mm").contains("per_year"));
  }
}

TEST_F(FollowAlikeImages, ABrokenSharedErrorIsNamedByFileAndKey) {
  const fs::path fit = fit_file(1);
  const Json whole = read_json(fit).at("shared_error");
  for (const auto& [pointer, broken, key] :
       {std::tuple{"", Json("T1"), "shared_error is \"T1\""},
        {"/images", Json(1), "shared_error/images is 1"},
        {"/images", Json(), "shared_error/images is null"},
        {"/covariance", Json::array({0.04}), "shared_error/covariance is [0.04]"},
        {"/covariance/axial_length_mm", Json(0.04), "shared_error/covariance/axial_length_mm is 0.04"},
        {"/covariance/axial_length_mm/axial_length_mm", Json("0.04"),
         "shared_error/covariance/axial_length_mm/axial_length_mm is \"0.04\""},
        {"/covariance/axial_length_mm/axial_length_mm", Json(std::nan("")),
         "shared_error/covariance/axial_length_mm/axial_length_mm is null"},
        {"/covariance/axial_length_mm/lens_thickness_mm", Json(0.01),
         "shared_error/covariance/axial_length_mm/lens_thickness_mm is 0.01"}}) {
    set(fit, "/shared_error", whole);
    set(fit, std::string("/shared_error") + pointer, broken);
    const ProcessResult ended = followed();
    EXPECT_EQ(ended.status, 3) << key;
    const std::string message = Json::parse(ended.output).at("error").at("message");
    EXPECT_THAT(message, testing::AllOf(testing::StartsWith(fit.string() + ": "), testing::HasSubstr(key)));
  }
}

TEST_F(FollowCommand, KnowsWhenTheVisitsWereFromTheirDates) {
  const fs::path first = visit("first", 23.5), second = visit("second", 23.9);
  const auto date = [&](const std::string& day) {
    Json json = read_json(second / "case.json");
    json["study_date"] = day;
    write_json(second / "case.json", json);
  };
  date("2028-03-14");  // 731 days, with a leap day, after the first
  const ProcessResult ended = run({first.string(), second.string()});
  ASSERT_EQ(ended.status, 0) << ended.output;
  EXPECT_NEAR(Json::parse(ended.output).at("years").at(1).get<double>(), 731 / 365.25, 1e-9);
  date("2027-02-30");
  EXPECT_EQ(run({first.string(), second.string()}).status, 3);
  date("2025-03-14");
  EXPECT_THAT(run({first.string(), second.string()}).output, testing::HasSubstr("is not after"));
  date("2026-03-14");
  EXPECT_THAT(run({first.string(), second.string()}).output,
              testing::HasSubstr("visits 1 and 2 are of one day"));
}

TEST_F(FollowCommand, ComparesPatientsOfLaterVisitsToo) {
  const fs::path second = visit("second", 23.6), third = visit("third", 23.8),
                 one = temporary_.path() / "one", other = temporary_.path() / "other";
  const std::string first = visit("first", 23.5).string();  // whose study is not there
  test::make_fixture_study(one);
  test::note_study(second, one);
  test::make_fixture_study(other);
  test::note_study(third, other);
  const auto follow = [&] { return run({first, second.string(), third.string(), "--years", "0,1,2"}); };
  EXPECT_EQ(follow().status, 0) << follow().output;
  std::vector<std::string> words{"-nb", "-m", "(0010,0020)=MRN-OTHER", "-m", "(0010,0030)=19610204"};
  for (const auto& entry : fs::directory_iterator(other)) words.push_back(entry.path().string());
  run_process("/usr/bin/dcmodify", words, ChildOutput::discard);
  test::note_study(third, other);
  const ProcessResult ended = follow();
  EXPECT_EQ(ended.status, 3);
  EXPECT_THAT(ended.output, testing::HasSubstr("two patients"));
}

TEST_F(FollowCommand, SaysWhatIsWrongWithItsVisits) {
  const std::string first = visit("first", 23.5).string(), second = visit("second", 23.8).string();
  EXPECT_EQ(run({first}).status, 2);
  EXPECT_EQ(run({first, second, "--years", "2,1"}).status, 3);
  EXPECT_EQ(run({first, second, "--years", "1"}).status, 2);
  EXPECT_EQ(run({first, temporary_.path().string()}).status, 3);
  Json fit = read_json(fs::path(second) / "segmentation" / "os" / "fit.json");
  fit["withheld"] = {{"fit", "no cornea"}};
  write_json(fs::path(second) / "segmentation" / "os" / "fit.json", fit);
  const ProcessResult ended = run({first, second, "--years", "0,1"});
  EXPECT_EQ(ended.status, 8);
  EXPECT_THAT(ended.output, testing::HasSubstr("visit 2: the fit of this eye is withheld"));
}

}  // namespace
}  // namespace emmetrope::follow
