#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <iostream>

#include "pipeline/base/files.hpp"
#include "pipeline/base/notation.hpp"
#include "pipeline/base/process.hpp"
#include "pipeline/eye/optics/paraxial.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "pipeline/report/living/case_eyes.hpp"
#include "pipeline/report/living/living_panel.hpp"
#include "raytrace/picture/spectrum.hpp"
#include "raytrace/scene/scene.hpp"
#include "raytrace/spectacle/spectacle.hpp"
#include "raytrace/tracer/exposure.hpp"
#include "raytrace/tracer/tracer.hpp"
#include "raytrace/wavefront/seen_pupil.hpp"
#include "raytrace/wavefront/wavefront.hpp"
#include "tests/support/measured_optics.hpp"
#include "tests/support/temporary_folder.hpp"

// The page in which an eye looks, in a browser without a graphics processor: its pictures against the tracer's.

namespace emmetrope::report {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::MatchesRegex;

/// EMMETROPE_FULL_PICTURES=1: as large as docs/method/living-eye.md compares them, and the figures are printed.
const bool is_full = std::getenv("EMMETROPE_FULL_PICTURES") != nullptr;
const int side = is_full ? 512 : 256, rays = is_full ? 256 : 64;
constexpr double field_mm = 1.4;

/// What the page is set to, and the same for the tracer.
struct Setting {
  const char* name;
  Json set;
  std::string scene = "letters:extent_deg=5";
  std::string spectacle = {};
  double pupil_mm = 4, accommodation_D = 0;
  raytrace::TraceSettings trace = {};
};

std::vector<Setting> settings() {
  std::vector<Setting> all{
      {"plain", Json::object()},
      {"astigmatic",
       {{"sphere_D", -1}, {"cylinder_D", -2}, {"axis_deg", 30}},
       "letters:extent_deg=5",
       "-1/-2x30@12"},
      {"wide-green",
       {{"pupil_mm", 6}, {"wavelength_nm", 555}, {"scene", "siemens"}},
       "siemens:extent_deg=5",
       "",
       6},
      {"near",
       {{"accommodation_D", 2}, {"distance_mm", 400}},
       "letters:extent_deg=5,distance_mm=400",
       "",
       4,
       2},
      {"ground",
       {{"sphere_D", -4},
        {"cylinder_D", -1},
        {"axis_deg", 100},
        {"is_thick", true},
        {"base_D", 4},
        {"index", 1.6},
        {"prism_D", 2},
        {"prism_base_deg", 90},
        {"scene_follows_gaze", false},
        {"gaze_deg", {1.5, -1}}},
       "letters:extent_deg=5",
       "-4/-1x100@12,base_D=4,index=1.6,prism=2@90"},
      {"night",
       {{"scene", "dial"}, {"pupil_mm", 5}, {"stiles_crawford_per_mm2", 0.05}, {"diffraction", true}},
       "dial:extent_deg=5",
       "",
       5}};
  all[2].trace.wavelength_nm = 555;
  all[4].trace.pose.gaze = {1.5, -1};
  all[5].trace.stiles_crawford_per_mm2 = 0.05;
  all[5].trace.diffraction = true;
  return all;
}

/// sRGB levels, three a pixel.
std::vector<double> traced(const EyeModel& eye, const Setting& setting, std::uint64_t seed) {
  static const raytrace::Tracer tracer("", 2);
  EyeModel worn = eye;
  worn.set_stop_diameter(setting.pupil_mm);
  if (!setting.spectacle.empty())
    worn = raytrace::with_spectacle(worn, raytrace::parse_spectacle(setting.spectacle));
  raytrace::TraceSettings trace = setting.trace;
  trace.representation = raytrace::Representation::fast;
  trace.grid = {side, side, field_mm, field_mm};
  trace.samples = rays;
  trace.seed = seed;
  trace.verbosity.quiet = true;
  const auto image =
      raytrace::trace_exposure(tracer, worn, *raytrace::make_scene(setting.scene), trace, {}).image;
  std::vector<double> levels;
  for (int row = 0; row < side; ++row)
    for (int column = 0; column < side; ++column)
      for (int c = 0; c < 3; ++c)
        levels.push_back(
            std::round(255 * raytrace::srgb_encoded(image.at(column, row, image.channels == 1 ? 0 : c))));
  return levels;
}

std::vector<double> drawn(const fs::path& file) {
  const std::string bytes = read_file(file);
  std::vector<double> levels;
  for (std::size_t i = 0; i < bytes.size(); ++i)
    if (i % 4 != 3) levels.push_back(static_cast<unsigned char>(bytes[i]));
  return levels;
}

double rms(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b.at(i)) * (a[i] - b.at(i));
  return std::sqrt(sum / static_cast<double>(a.size()));
}

struct Page {
  std::string name;
  std::function<EyeModel(double accommodation_D)> eye;
  LivingSubject subject;
};

raytrace::EyeMapSettings map_settings() {
  raytrace::EyeMapSettings result;
  result.threads = 2;
  return result;
}

/// An eye's own iris may be narrower.
Json with_pupil(const Setting& setting) {
  Json set = setting.set;
  set["pupil_mm"] = setting.pupil_mm;
  return set;
}

/// Writes the page, has it read, and compares.
Json read_page(const Page& page, const fs::path& folder, const char* extent) {
  fs::create_directories(folder);
  const std::string html = render_living_page(
      page.name, make_living_panel({living_json(page.subject, 2)}, {page.subject.living.map.note()}));
  EXPECT_LE(html.size(), 2'000'000U);
  write_file(folder / "page.html", html);
  Json list = Json::array();
  for (const Setting& setting : settings())
    list.push_back(
        {{"name", setting.name}, {"set", with_pupil(setting)}, {"width", side}, {"samples", rays}});
  write_json(folder / "settings.json", list);
  const ProcessResult browser =
      run_process("/usr/bin/env",
                  {"node", EMMETROPE_LIVING_CHECK, (folder / "page.html").string(),
                   (folder / "settings.json").string(), (folder / "found").string(), extent},
                  ChildOutput::capture);
  EXPECT_EQ(browser.status, 0) << browser.output;
  for (const Setting& setting : settings()) {
    const EyeModel eye = page.eye(setting.accommodation_D);
    const std::vector<double> one = traced(eye, setting, 1), other = traced(eye, setting, 2);
    const std::vector<double> shown = drawn(folder / "found" / (std::string(setting.name) + ".rgba"));
    const double noise = rms(one, other), difference = rms(shown, other);
    EXPECT_GT(noise, 0.2) << setting.name << ": a blank picture proves nothing";
    EXPECT_LE(difference, 1.2 * noise) << page.name << ", " << setting.name;
    if (is_full)
      std::cout << page.name << ", " << setting.name << ": " << difference / noise << " of the noise\n";
  }
  Json findings = read_json(folder / "found" / "findings.json");
  if (is_full)
    for (const char* key : {"first_picture_ms", "speed", "sharpest"})
      std::cout << page.name << ", " << key << ": " << findings.at(key).dump() << "\n";
  return findings;
}

bool can_browse() { return fs::exists("/usr/bin/chromium") && !std::string(EMMETROPE_PLAYWRIGHT).empty(); }

void expect_quiet(const Json& findings) {
  EXPECT_THAT(findings.at("complaints"), IsEmpty());
  EXPECT_THAT(findings.at("requests"), IsEmpty());
  EXPECT_LT(findings.at("beam_arcmin").get<double>(), 0.02);
}

void expect_readable(const Json& findings) {
  EXPECT_THAT(findings.at("unmoved"), IsEmpty());
  EXPECT_NEAR(findings.at("dragged_axis_deg").get<double>(), 60, 1);
  EXPECT_EQ(findings.at("images").at(0), 64);
  EXPECT_EQ(findings.at("images").at(1), 32);
  EXPECT_THAT(findings.at("images").at(2).get<std::string>(), HasSubstr("changed"));
  // An eye that only turns keeps its blur.
  EXPECT_NEAR(findings.at("gaze_blur").at(0).get<double>(), findings.at("gaze_blur").at(1).get<double>(),
              0.01);
  EXPECT_EQ(findings.at("held"), 1);
  EXPECT_TRUE(findings.at("let_go"));
  EXPECT_THAT(findings.at("saved").get<std::string>(), HasSubstr(".png"));
  Json state = findings.at("state"), by_link = findings.at("state_by_link");
  for (Json* one : {&state, &by_link}) one->erase("samples");  // how fine it is drawn is the reader's
  EXPECT_EQ(state, by_link);
  for (const Json& said : findings.at("refused")) {
    EXPECT_NE(said.at(0), "") << findings.at("refused");
    EXPECT_EQ(said.at(0), said.at(1)) << "set() and quality() refuse alike";
  }
  // The range that is named is this eye's, whose iris is 6 mm at most.
  const Json& pupil = findings.at("refused").at(9);
  EXPECT_THAT(pupil.at(0).get<std::string>(),
              AllOf(HasSubstr("pupil_mm"), MatchesRegex(".*it is 1 to 6([^0-9].*)?")));
  EXPECT_EQ(findings.at("kept_axis_deg"), Json({5, 0, 5}));  // the contract: 0 <= axis < 180
  EXPECT_FALSE(findings.at("moved_by_refusals"));
  // A link that asks for more than the eye has opens with what it has.
  const Json& beyond = findings.at("state_by_link_beyond");
  EXPECT_EQ(beyond.at("pupil_mm"), 6);
  EXPECT_EQ(beyond.at("worn"), Json());
  EXPECT_EQ(beyond.at("sphere_D"), -1);
  ASSERT_EQ(findings.at("accessibility").size(), 4U);
  for (const auto& [scheme, violations] : findings.at("accessibility").items())
    EXPECT_THAT(violations, IsEmpty()) << scheme;
  for (const auto& [width, elements] : findings.at("layout").items())
    EXPECT_THAT(elements, IsEmpty()) << width;
  EXPECT_EQ(findings.at("printed"), 0);
  EXPECT_THAT(findings.at("without_webgl").get<std::string>(), HasSubstr("WebGL 2"));
  EXPECT_EQ(findings.at("controls_without_webgl"), 0);
}

TEST(LivingPage, ShowsWhatTheTracerShowsOfASchematicEye) {
  if (!can_browse()) GTEST_SKIP() << "Chromium or playwright-core is not installed";
  const auto eye = [](double accommodation_D) {
    EyeOptions options;
    options.accommodation_D = accommodation_D;
    return make_eye("navarro", options);
  };
  const Page page{
      "navarro",
      eye,
      {"eye", "navarro", eye(0), raytrace::living_schematic_eye("navarro", map_settings()), {}, ""}};
  const test::TemporaryFolder folder;
  const Json findings = read_page(page, folder.path() / "page", "whole");
  expect_quiet(findings);
  expect_readable(findings);
  for (const auto& [lens, shown] : {std::pair{"-8/0x0@12", 0}, {"+8/0x0@12", 1}}) {
    const EyeModel worn = raytrace::with_spectacle(eye(0), raytrace::parse_spectacle(lens));
    EXPECT_NEAR(findings.at("pupil_magnification").at(shown).get<double>(),
                raytrace::pupil_magnification_of_spectacle(worn, worn.reference_wavelength_nm), 0.003)
        << lens;
  }
  EXPECT_EQ(findings.at("worn"), Json({"refused", "refused"}));
  // `emmetrope correct --eye navarro`: docs/evidence/accuracy-refraction.md
  EXPECT_NEAR(findings.at("sharpest").at("eye").at(0).get<double>(), -0.256, 0.06);
  EXPECT_NEAR(findings.at("sharpest").at("eye").at(1).get<double>(), 0, 0.06);
  EXPECT_NEAR(findings.at("sharpest").at("eye").at(2).get<double>(), 0, 0.06);
  EXPECT_GT(findings.at("best").at("now"), findings.at("best").at("none"));
}

TEST(LivingPage, ShowsWhatTheTracerShowsOfAMeasuredEye) {
  if (!can_browse()) GTEST_SKIP() << "Chromium or playwright-core is not installed";
  const UncertainOptics optics = uncertain_optics_from_json(measured_optics(), ".", 0.005);
  const auto eye = [&](double accommodation_D) {
    return eye_at(optics, raytrace::accommodated(optics, accommodation_D, 40));
  };
  EyeModel narrow = eye(0);
  narrow.set_stop_diameter(3);
  raytrace::WavefrontSettings at_589;
  at_589.wavelength_nm = 589.3;
  const raytrace::Wavefront wavefront = raytrace::measure_wavefront(narrow, at_589);
  const PowerVector refraction = raytrace::at_vertex(wavefront, wavefront.minimum_rms_spot, 12);
  const LivingSubject subject{"od",
                              "OD (right)",
                              eye(0),
                              raytrace::living_measured_eye(eye(0), &optics, 40, map_settings()),
                              {{"best", to_sphero_cylinder(refraction), 12}},
                              ""};
  const Page page{"measured", eye, subject};
  const test::TemporaryFolder folder;
  const Json findings = read_page(page, folder.path() / "page", "brief");
  expect_quiet(findings);
  EXPECT_EQ(findings.at("on_cornea"), 0);
  EXPECT_EQ(findings.at("worn"), Json({"best", "refused"}));
  const Json& sharpness = findings.at("worn_sharpness");
  EXPECT_EQ(sharpness.at("worn"), sharpness.at("powers"));
  EXPECT_GT(sharpness.at("worn"), sharpness.at("none"));
  const Json& sharpest = findings.at("sharpest").at("od");
  EXPECT_NEAR(sharpest.at(0).get<double>(), refraction.M_D, 0.06);
  EXPECT_NEAR(sharpest.at(1).get<double>(), refraction.J0_D, 0.06);
  EXPECT_NEAR(sharpest.at(2).get<double>(), refraction.J45_D, 0.06);
}

/// A case whose right eye, as formulas, has been corrected.
CaseData corrected_case(const fs::path& folder, double lens_index_sigma, const Json& learnt_from) {
  const Json optics = measured_optics();
  fs::create_directories(folder / "meshing/od");
  fs::create_directories(folder / "raytrace/od");
  write_json(folder / "meshing/od/optics.json", optics);
  write_json(folder / "raytrace/od/eye.json", optics["eye"]);
  EyeData eye;
  const Json lens{{"sphere_D", -2.0}, {"cylinder_D", -1.0}, {"axis_deg", 20.0}};
  eye.prescription = lens;
  eye.prescription["rounded"] = lens;
  eye.prescription["M_D"] = Measured::from_sigma(-2.5, 0.4, "mri");
  eye.prescription["learnt_from"] = learnt_from;
  CaseData data;
  data.folder = folder;
  const auto done = [](const char* stage, const Json& parameters) {
    return StageData{stage, ExitStatus::done, {}, {}, Json{{"parameters", parameters}}};
  };
  data.stages = {done("raytrace", {{"age_years", 40}}),
                 done("correction", {{"lens_index_sigma", lens_index_sigma}})};
  data.eyes = {eye};
  return data;
}

TEST(CaseEyes, AnEyeThatWasNotTracedIsTold) {
  const test::TemporaryFolder folder;
  CaseData data = corrected_case(folder.path(), 0.005, Json::array());
  data.eyes.push_back(EyeData{});
  data.eyes.back().laterality = Laterality::os;
  const CaseEyes eyes = living_eyes_of(data, 2, 1);
  EXPECT_EQ(eyes.eyes.size(), 1U);
  EXPECT_THAT(eyes.not_traced, testing::ElementsAre(HasSubstr("OS looks out of no picture")));
}

TEST(CaseEyes, HaveTheUncertaintyAndTheLensesOfTheEyeThatLooks) {
  const test::TemporaryFolder folder;
  const CaseEyes as_traced = living_eyes_of(corrected_case(folder.path(), 0.005, Json::array()), 2, 1),
                 learnt =
                     living_eyes_of(corrected_case(folder.path(), 0, Json::array({"keratometry"})), 2, 1);
  ASSERT_EQ(as_traced.eyes.size(), 1U);
  ASSERT_EQ(learnt.eyes.size(), 1U);
  // A known index of the lens is not among what is not known.
  const auto reach_D = [](const CaseEyes& eyes) {
    return eyes.eyes.front().at("bands").at(0).at("M_D").get<double>();
  };
  constexpr double sigma = 0.005, vertex_distance_mm = 12;
  const auto refraction_D = [](double lens_index) {
    Json eye = measured_optics()["eye"];
    eye["media"]["lens"]["index"] = lens_index;
    return move_towards_eye(paraxial_refraction(eye_from_json(eye, "."), eye["reference_wavelength_nm"]),
                            -vertex_distance_mm)
        .M_D;
  };
  const double by_index_D = 1.96 * (refraction_D(1.4254 - sigma) - refraction_D(1.4254 + sigma)) / 2;
  EXPECT_NEAR(std::pow(reach_D(as_traced), 2) - std::pow(reach_D(learnt), 2), std::pow(by_index_D, 2),
              0.3 * std::pow(by_index_D, 2));
  // The best lens of the eye with a keratometer's reading is not that of the eye that was traced.
  EXPECT_EQ(as_traced.eyes.front().at("lenses").size(), 2U);
  EXPECT_EQ(learnt.eyes.front().at("lenses").size(), 0U);
  EXPECT_THAT(learnt.notes, Contains(HasSubstr("OD looks as the images alone show it")));
}

TEST(LivingPage, KeepsNamesFromEndingItsScript) {
  const EyeModel eye = make_eye("arizona");
  raytrace::EyeMapSettings settings = map_settings();
  const LivingSubject subject{
      "eye", "</script><b>", eye, raytrace::living_schematic_eye("arizona", settings), {}, ""};
  const std::string scripts = make_living_panel({living_json(subject, 2)}, {}).scripts;
  EXPECT_EQ(scripts.find("</script><b>"), std::string::npos);
  EXPECT_EQ(make_living_panel({}, {"why"}).markup, "");
}

}  // namespace
}  // namespace emmetrope::report
