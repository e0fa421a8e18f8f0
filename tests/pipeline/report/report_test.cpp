#include <cstdlib>
#include <cstring>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <regex>

#include "pipeline/base/case_folder.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/measured.hpp"
#include "pipeline/base/power_vector.hpp"
#include "pipeline/report/comparison.hpp"
#include "pipeline/report/document/numbers.hpp"
#include "pipeline/report/page/viewer.hpp"
#include "pipeline/report/pdf/pdf.hpp"
#include "tests/pipeline/report/report_fixture.hpp"

namespace emmetrope::report {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

TEST_F(ReportTest, EveryPageSaysThatItIsForResearch) {
  test::make_fixture_case(folder_);
  report();
  const std::string pdf = pdf_text();
  const auto pages = std::count(pdf.begin(), pdf.end(), '\f');
  EXPECT_GE(pages, 2);
  EXPECT_LE(pages, 4);
  std::size_t start = 0;
  for (int page = 0; page < pages; ++page) {
    const std::size_t end = pdf.find('\f', start);
    EXPECT_THAT(pdf.substr(start, end - start), HasSubstr("Research use only. Not a medical device."))
        << page + 1;
    start = end + 1;
  }
}

TEST_F(ReportTest, CaseFullOfComplaintsStaysWithinFourPages) {
  test::make_fixture_case(folder_);
  const fs::path file = folder_ / "segmentation" / "stage.json";
  Json stage = read_json(file);
  for (int i = 0; i < 60; ++i)
    stage["warnings"].push_back("complaint " + std::to_string(i) +
                                ": a slice is missing between two others, and what that means is told at "
                                "some length here, as stages do");
  write_json(file, stage);
  report();
  const std::string pdf = pdf_text();
  EXPECT_LE(std::count(pdf.begin(), pdf.end(), '\f'), 4);
  EXPECT_THAT(pdf, HasSubstr("more are in the HTML report"));
  EXPECT_THAT(visible_text(output("report.html")), HasSubstr("complaint 59:"));
}

TEST_F(ReportTest, APageThatIsNeededBeyondFourIsFilled) {
  Document document;
  document.sections.push_back({"full", "Full", {}});
  auto& blocks = document.sections.front().blocks;
  std::string words;
  for (int i = 0; i < 100; ++i) words += "what must stand ";
  while (render_pdf(document).pages < 5) blocks.push_back({Paragraph{words}});
  blocks.push_back({Paragraph{"there is room for this"}, Paper::if_room});
  const Pdf pdf = render_pdf(document);
  EXPECT_EQ(pdf.pages, 5);
  fs::create_directories(folder_);
  write_file(folder_ / "full.pdf", pdf.bytes);
  const std::string text = output_of("/usr/bin/pdftotext", {(folder_ / "full.pdf").string(), "-"});
  EXPECT_THAT(text, AllOf(HasSubstr("there is room for this"), Not(HasSubstr("For want of room"))));
}

/// 11 of 400 pixels: at least 5.5 pt from the tops to the feet of its letters, at the price of a page.
TEST_F(ReportTest, ChartsInThePdfDoNotShrinkBelowWhatCanBeRead) {
  Figure chart;
  chart.width_px = 400;
  chart.height_px = 300;
  chart.svg =
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 400 300\"><text x=\"20\" y=\"20\" "
      "font-family=\"DejaVu Sans\" font-size=\"11\">lettering</text></svg>";
  Document document;
  document.sections.push_back({"charts", "Charts", {}});
  for (int i = 0; i < 20; ++i) document.sections.front().blocks.push_back({FigureRow{{chart, chart}, ""}});
  const Pdf pdf = render_pdf(document);
  EXPECT_EQ(pdf.pages, 5);
  fs::create_directories(folder_);
  write_file(folder_ / "charts.pdf", pdf.bytes);
  const std::string words =
      output_of("/usr/bin/pdftotext", {"-bbox", (folder_ / "charts.pdf").string(), "-"});
  const std::regex lettering("yMin=\"([0-9.]+)\" xMax=\"[0-9.]+\" yMax=\"([0-9.]+)\">lettering<");
  int found = 0;
  for (auto word = std::sregex_iterator(words.begin(), words.end(), lettering);
       word != std::sregex_iterator(); ++word, ++found)
    EXPECT_GT(std::stod((*word)[2]) - std::stod((*word)[1]), 5.5);
  EXPECT_EQ(found, 40);
}

/// Wherever the end of the line comes.
TEST_F(ReportTest, ThePdfBreaksNoOption) {
  Document document;
  document.sections.push_back({"options", "Options", {}});
  std::string before;
  for (int i = 0; i < 24; ++i) {
    before += "wide ";
    document.sections.front().blocks.push_back({Paragraph{before + "(--keratometry)."}});
  }
  fs::create_directories(folder_);
  write_file(folder_ / "options.pdf", render_pdf(document).bytes);
  const std::string text = output_of("/usr/bin/pdftotext", {(folder_ / "options.pdf").string(), "-"});
  std::size_t whole = 0;
  for (std::size_t at = text.find("(--keratometry)."); at != std::string::npos;
       at = text.find("(--keratometry).", at + 1))
    ++whole;
  EXPECT_EQ(whole, 24U) << text;
}

/// A card's list in the page, unfolded part first.
std::string list_after(const std::string& html, const std::string& mark) {
  const std::size_t start = html.find(mark);
  return start == std::string::npos ? "" : html.substr(start, html.find("</ul>", start) - start);
}

TEST_F(ReportTest, FiveWarningsAtMostTheMostDangerousFirst) {
  test::make_fixture_case(folder_);
  const fs::path file = folder_ / "segmentation" / "od" / "fit.json";
  Json fit = read_json(file);
  fit["quality"] = Json::array();
  for (int i = 0; i < 6; ++i)
    fit["quality"].push_back({{"name", "converged"},
                              {"passed", false},
                              {"withholds", "nothing"},
                              {"reason", "small thing " + std::to_string(i)}});
  fit["quality"].push_back({{"name", "cornea_sigma_over_prior"},
                            {"passed", false},
                            {"withholds", "cornea"},
                            {"reason", "the cornea is not seen"}});
  write_json(file, fit);
  const Answer answer = report();
  ASSERT_GE(answer.json.at("eyes").at("od").at("reasons").size(), 7U);
  EXPECT_EQ(answer.json.at("eyes").at("od").at("reasons")[0], "the cornea is not seen");

  const std::string html = output("report.html"), first = list_after(html, "<ul class=\"reasons\">"),
                    rest = list_after(html, "<details class=\"more\">");
  const auto items = [](const std::string& list) {
    std::size_t count = 0;
    for (std::size_t at = list.find("<li>"); at != std::string::npos; at = list.find("<li>", at + 1)) ++count;
    return count;
  };
  EXPECT_EQ(items(first), 5U);
  EXPECT_GE(items(rest), 2U);
  EXPECT_THAT(first, HasSubstr("Measure the cornea, and give it (--keratometry)."));
  EXPECT_LT(first.find("the cornea is not seen"), first.find("small thing 0"));
  EXPECT_THAT(rest, HasSubstr("small thing 5"));
  const std::string pdf = pdf_text();
  EXPECT_THAT(pdf, HasSubstr("the cornea is not seen"));
  EXPECT_THAT(pdf, Not(HasSubstr("small thing 5")));
}

/// The table of that caption; empty where the page has none.
std::string table_of(const std::string& html, const std::string& caption) {
  const std::size_t start = html.find("<caption>" + caption);
  return start == std::string::npos ? "" : html.substr(start, html.find("</table>", start) - start);
}

TEST_F(ReportTest, AWithheldPrescriptionIsNone) {
  test::make_fixture_case(folder_);
  const fs::path file = folder_ / "correction" / "od" / "prescription.json";
  Json prescription = read_json(file);
  prescription["M_D"]["ci95"] = {-2.87 - 3.2, -2.87 + 3.2};
  prescription["withheld"] =
      "The spherical equivalent's 95 % interval, +-3.20 D, does not support a prescription.";
  write_json(file, prescription);
  const Answer answer = report();
  EXPECT_FALSE(answer.json.at("eyes").at("od").contains("prescription"));
  EXPECT_TRUE(answer.json.at("eyes").at("os").contains("prescription"));
  EXPECT_EQ(table_of(output("report.html"), "Best plano-cylinder").find("OD"), std::string::npos);
  for (const std::string& text : {visible_text(output("report.html")), pdf_text()}) {
    EXPECT_THAT(text, HasSubstr("No prescription: known only to ±3.2 D"));
    EXPECT_THAT(text, HasSubstr("SE -6.1 to +0.3 D"));
    EXPECT_THAT(text, Not(HasSubstr("-2.25 / -1.00 x 175")));
  }
  EXPECT_THAT(visible_text(output("report.html")),
              HasSubstr("95 % interval, ±3.20 D, does not support a prescription. The estimate is for "
                        "information."));
  EXPECT_THAT(dump("prescription.dcm"), Not(HasSubstr("Right Eye Rx")));
  EXPECT_THAT(output("prescription.fhir.json"), Not(HasSubstr("right")));
}

TEST_F(ReportTest, WhatOneEyeHasMeasuredIsNoAssumption) {
  test::make_fixture_case(folder_);
  report();
  EXPECT_THAT(table_of(output("report.html"), "Not measured here"), HasSubstr("Corneal thickness"));
  const fs::path file = folder_ / "meshing" / "os" / "biometry.json";
  Json biometry = read_json(file);
  biometry["corneal_thickness_mm"]["source"] = "mri+prior";
  write_json(file, biometry);
  report();
  const std::string html = output("report.html");
  EXPECT_THAT(table_of(html, "Biometry"), HasSubstr("Corneal thickness"));
  EXPECT_THAT(table_of(html, "Not measured here"),
              AllOf(HasSubstr("Asphericity Q"), Not(HasSubstr("Corneal thickness"))));
}

/// Cases that were corrected before the correction stage said so hold no word of it.
TEST_F(ReportTest, AnOlderCaseIsHeldToTheSameLimit) {
  test::make_fixture_case(folder_);
  for (const char* eye : {"od", "os"}) {
    const fs::path file = folder_ / "correction" / eye / "prescription.json";
    Json prescription = read_json(file);
    prescription.erase("withheld");
    if (std::string(eye) == "od") prescription["M_D"]["ci95"] = {-2.87 - 3.2, -2.87 + 3.2};
    write_json(file, prescription);
  }
  const Answer answer = report();
  EXPECT_FALSE(answer.json.at("eyes").at("od").contains("prescription"));
  EXPECT_TRUE(answer.json.at("eyes").at("os").contains("prescription"));
  EXPECT_THAT(visible_text(output("report.html")), HasSubstr("No prescription: known only to ±3.2 D"));
}

// A point of a stack plus its shift lies where the surfaces are: the slice through the eye's middle lies that
// much lower in the stack, and the contours go with it.
TEST_F(ReportTest, ContoursFollowTheHeadsMotionBetweenStacks) {
  test::make_fixture_case(folder_);
  const auto slice = [&] {
    const std::string html = output("report.html");
    const std::size_t at = html.find("<figure id=\"slice-od-axial\">");
    return html.substr(at, html.find("</figure>", at) - at);
  };
  const auto contours = [](const std::string& figure) { return figure.substr(figure.find("<path")); };
  report();
  const std::string still = slice();
  const fs::path file = folder_ / "segmentation" / "od" / "fit.json";
  Json fit = read_json(file);
  fit["stacks"] = {{{"name", "stack1"}, {"shift_lps_mm", {0.0, 0.0, 1.5}}}};
  write_json(file, fit);
  report();
  const std::string moved = slice();
  const std::regex height("axial, S ([0-9.]+) mm");
  std::smatch before, after;
  ASSERT_TRUE(std::regex_search(still, before, height));
  ASSERT_TRUE(std::regex_search(moved, after, height));
  EXPECT_NEAR(std::stod(before[1]) - std::stod(after[1]), 1.5, 0.051);
  EXPECT_EQ(contours(still).substr(0, 2000), contours(moved).substr(0, 2000));
}

TEST_F(ReportTest, FilesThatNoStageWroteAreNotShown) {
  test::make_fixture_case(folder_);
  const fs::path segmentation = folder_ / "segmentation";
  for (const char* foreign : {"._stack.nii.gz", ".another.png", "od/.another.png"})
    write_file(segmentation / foreign, "of another patient");
  const CaseData data = read_case(folder_, LateralityChoice::both);
  ASSERT_FALSE(data.stacks.empty());
  for (const fs::path& file : data.stacks) EXPECT_NE(file.filename().string().front(), '.');
  for (const fs::path& file : data.overlays) EXPECT_NE(file.filename().string().front(), '.');
  for (const EyeData& eye : data.eyes)
    for (const fs::path& file : eye.overlays) EXPECT_NE(file.filename().string().front(), '.');
}

/// 6 mm of retina over 500 pixels are 2.4 minutes of arc each.
TEST_F(ReportTest, TheRowsOfTheFirstPagesChartHaveTheirAcuities) {
  test::make_fixture_case(folder_);
  const fs::path file = folder_ / "raytrace" / "stage.json";
  Json stage = read_json(file);
  stage["parameters"] = {{"scene", "letters"}, {"field_mm", {6.0, 6.0}}, {"size", {500, 500}}};
  write_json(file, stage);
  report();
  EXPECT_THAT(
      visible_text(output("report.html")),
      HasSubstr(
          "Rows go from logMAR 1.4 at the top down to 0.0, 0.1 a row; strokes below logMAR 0.4 are finer than a pixel."));
  stage["parameters"]["scene"] = "a scene of its own.json";
  write_json(file, stage);
  report();
  EXPECT_THAT(visible_text(output("report.html")), Not(HasSubstr("logMAR 1.4")));
}

/// Every colour that an overlay may have (segmentation/output/overlay.hpp), and the slices' are among them.
TEST_F(ReportTest, TheColoursOfAnOverlayAreNamedBelowIt) {
  test::make_fixture_case(folder_);
  const fs::path eye = folder_ / "segmentation" / "od";
  for (const char* name : {"overlay_stack1.png", "residual_stack1.png", "overlay_stack2.png"})
    cv::imwrite((eye / name).string(), cv::Mat(288, 288, CV_8UC3, cv::Scalar(90, 90, 90)));
  report();
  const std::string html = output("report.html");
  int captions = 0;
  for (std::size_t at = html.find("<figure id=\"overlay-od-"); at != std::string::npos;
       at = html.find("<figure id=\"overlay-od-", at + 1)) {
    const std::string figure = html.substr(at, html.find("</figure>", at) - at);
    if (figure.find("residuals of the fit") != std::string::npos) continue;
    ++captions;
    EXPECT_THAT(figure,
                HasSubstr("cornea cyan, iris violet, lens orange, inner wall green, outer wall yellow; red"));
    EXPECT_THAT(figure, AllOf(HasSubstr("withheld is grey"), HasSubstr("blue is the globe by edges")));
  }
  EXPECT_EQ(captions, 2);
  EXPECT_THAT(visible_text(html), HasSubstr("cornea cyan, lens orange, inner retina green"));
}

TEST_F(ReportTest, TheFirstPageNamesTheLensIndexAndTheAge) {
  test::make_fixture_case(folder_);
  const fs::path file = folder_ / "raytrace" / "stage.json";
  Json stage = read_json(file);
  stage["eyes"]["od"]["lens_index"] = 1.4231;
  stage["eyes"]["od"]["lens_index_from"] = "usual at the age of 47";
  write_json(file, stage);
  report();
  EXPECT_THAT(visible_text(output("report.html")), HasSubstr("lens index 1.423, usual at the age of 47"));
  EXPECT_THAT(pdf_text(), HasSubstr("lens index 1.423, usual at the"));
  EXPECT_THAT(visible_text(output("report.html")),
              HasSubstr("a living lens, whose index rises towards its core"));
}

TEST_F(ReportTest, SameCaseGivesSameBytes) {
  test::make_fixture_case(folder_);
  report();
  std::map<std::string, std::string> first;
  for (const auto& entry : fs::recursive_directory_iterator(folder_ / "report"))
    if (entry.is_regular_file()) first[entry.path().string()] = read_file(entry.path());
  const fs::path moved = folder_.string() + "-moved";
  fs::remove_all(moved);
  fs::rename(folder_, moved);
  fs::remove_all(moved / "report");
  CommonOptions common;
  common.verbosity.quiet = true;
  write_report({moved, {}, false}, common);
  EXPECT_GT(first.size(), 20U);
  for (const auto& [name, bytes] : first) {
    if (fs::path(name).filename() == "stage.json") continue;
    const fs::path again = moved / fs::relative(name, folder_);
    ASSERT_TRUE(fs::exists(again)) << again;
    EXPECT_TRUE(read_file(again) == bytes) << again;
  }
  fs::remove_all(moved);
}

TEST_F(ReportTest, SaysWhichPupilWavefrontAndPicturesAreOf) {
  test::make_fixture_case(folder_);
  const fs::path file = folder_ / "raytrace" / "stage.json";
  Json stage = read_json(file);
  stage["parameters"]["pupil_mm"] = 4.3;
  write_json(file, stage);
  report();
  const std::string html = visible_text(output("report.html"));
  for (const std::string& text : {html, pdf_text()})
    EXPECT_THAT(text, HasSubstr("Wavefront of an iris aperture of 4.3 mm"));
  EXPECT_THAT(html, HasSubstr("letters and pictures are those of an iris aperture of 4.3 mm"));
  EXPECT_THAT(html, HasSubstr("vertex distance, an iris aperture of 3.0 mm"));
}

TEST_F(ReportTest, AnAstigmatismThatMayBeNoneHasNoRule) {
  test::make_fixture_case(folder_);
  const fs::path file = folder_ / "meshing" / "os" / "biometry.json";
  Json biometry = read_json(file);
  biometry["keratometry"]["cylinder_D"]["ci95"][0] = 0.0;
  write_json(file, biometry);
  report();
  const std::string text = visible_text(output("report.html"));
  const auto line_of = [&](const std::string& eye) {
    const auto at = text.find(eye + ": K1");
    return text.substr(at, text.find('<', at + 1) - at).substr(0, 120);
  };
  EXPECT_THAT(line_of("OD (right)"), ::testing::HasSubstr("with-the-rule"));
  EXPECT_THAT(line_of("OD (right)"), ::testing::HasSubstr(" D @ 178"));
  EXPECT_THAT(line_of("OS (left)"), ::testing::HasSubstr("axis not determined"));
  EXPECT_THAT(line_of("OS (left)"), ::testing::Not(::testing::HasSubstr("@")));
  EXPECT_THAT(line_of("OS (left)"), ::testing::Not(::testing::HasSubstr("with-the-rule")));
  const auto has_dashes = [&](const std::string& id) {
    const std::string html = output("report.html");
    const auto at = html.find("<figure id=\"" + id + "\">");
    return html.substr(at, html.find("</figure>", at) - at).find("stroke-dasharray") != std::string::npos;
  };
  EXPECT_TRUE(has_dashes("axial-power-od"));
  EXPECT_FALSE(has_dashes("axial-power-os"));
  EXPECT_THAT(text, ::testing::HasSubstr("Solid line: steep meridian"));
  biometry = read_json(folder_ / "meshing" / "od" / "biometry.json");
  biometry["keratometry"]["cylinder_D"]["ci95"][0] = 0.0;
  write_json(folder_ / "meshing" / "od" / "biometry.json", biometry);
  report();
  EXPECT_THAT(visible_text(output("report.html")), ::testing::Not(::testing::HasSubstr("Solid line")));
}

TEST_F(ReportTest, APlanoCylinderOfAnEyeWithoutAnAxisHasNone) {
  test::make_fixture_case(folder_);  // the left eye's cylinder may be none
  report();
  const std::string row = ">Axis (meridian without power)<", both = output("report.html");
  const std::size_t at = both.find(row);
  ASSERT_NE(at, std::string::npos);
  EXPECT_THAT(visible_text("<body>" + both.substr(at, both.find("</tr>", at) - at)),
              AllOf(HasSubstr("90"), HasSubstr("\u2013")));
  const fs::path file = folder_ / "correction" / "od" / "prescription.json";
  Json prescription = read_json(file);
  prescription["cylinder_D"]["ci95"][1] = 0.0;
  write_json(file, prescription);
  report();
  EXPECT_THAT(table_of(output("report.html"), "Best plano-cylinder"),
              AllOf(HasSubstr("Radius"), Not(HasSubstr("Axis"))));
}

TEST_F(ReportTest, NoFormOfALensHasAnAxisWhereTheCylinderMayBeNone) {
  test::make_fixture_case(folder_);  // the left eye's
  report();
  const std::string html = output("report.html"), lenses = table_of(html, "Best lens of each kind");
  EXPECT_THAT(lenses, AllOf(HasSubstr("-2.31 / -1.12 x 176"), HasSubstr("+0.31 / -0.38 x \u2013"),
                            HasSubstr("-2.00 / -0.75 x \u2013"), Not(HasSubstr("x 092"))));
  EXPECT_THAT(table_of(html, "Best lens before rounding, OS"),
              AllOf(HasSubstr("+0.25 / -0.50 x \u2013"), Not(HasSubstr("x 090"))));
}

TEST_F(ReportTest, SecondRunIsSkippedUntilAResultChanges) {
  test::make_fixture_case(folder_);
  report();
  EXPECT_EQ(report().json["skipped"], true);
  Json biometry = read_json(folder_ / "meshing" / "os" / "biometry.json");
  biometry["axial_length_mm"]["value"] = 24.75;
  write_json(folder_ / "meshing" / "os" / "biometry.json", biometry);
  EXPECT_EQ(report().json["skipped"], false);
  EXPECT_THAT(visible_text(output("report.html")), HasSubstr("24.75 mm"));
}

TEST_F(ReportTest, RefusedCaseHasAReportWithReasonsAndNoNumbers) {
  test::FixtureOptions options;
  options.refused = true;
  test::make_fixture_case(folder_, options);
  const Answer answer = report();
  EXPECT_EQ(answer.status, ExitStatus::done);
  for (const std::string& text : {visible_text(output("report.html")), pdf_text()}) {
    EXPECT_THAT(text, HasSubstr("No prescription"));
    EXPECT_THAT(text, HasSubstr("chi2 per voxel 4.2"));
    EXPECT_FALSE(std::regex_search(text, std::regex("[+-][0-9]+\\.[0-9]{2} (D|/)"))) << text;
  }
  EXPECT_TRUE(fs::exists(folder_ / "report" / "report.dcm"));
  EXPECT_FALSE(fs::exists(folder_ / "report" / "prescription.dcm"));
  EXPECT_FALSE(fs::exists(folder_ / "report" / "prescription.fhir.json"));
  EXPECT_FALSE(fs::exists(folder_ / "report" / "biometry.dcm"));
}

TEST_F(ReportTest, ARefusedFitOutweighsAPrescriptionThatIsLeftOver) {
  test::make_fixture_case(folder_);
  Json fit = read_json(folder_ / "segmentation" / "od" / "fit.json");
  fit["status"] = "refused";
  write_json(folder_ / "segmentation" / "od" / "fit.json", fit);
  const Answer answer = report();
  EXPECT_FALSE(answer.json.at("eyes").at("od").contains("prescription"));
  EXPECT_TRUE(answer.json.at("eyes").at("os").contains("prescription"));
  EXPECT_THAT(dump("prescription.dcm"), Not(HasSubstr("Right Eye Rx")));
}

TEST_F(ReportTest, AnEyeThatAStageWasNotAskedForIsNotCalledUnsupported) {
  test::make_fixture_case(folder_);
  const fs::path correction = folder_ / "correction";
  Json stage = read_json(correction / "stage.json");
  stage["parameters"]["laterality"] = "od";
  write_json(correction / "stage.json", stage);
  fs::remove_all(correction / "os");
  report();
  for (const std::string& text : {visible_text(output("report.html")), pdf_text()}) {
    EXPECT_THAT(text, HasSubstr("No prescription: not asked for"));
    EXPECT_THAT(text, Not(HasSubstr("the images do not support one")));
  }
}

TEST_F(ReportTest, OneEyeIsReportedAndTheOtherNamedAsMissing) {
  test::FixtureOptions options;
  options.only_right = true;
  test::make_fixture_case(folder_, options);
  report();
  const std::string html = visible_text(output("report.html"));
  EXPECT_THAT(html, HasSubstr("-2.25 / -1.00 x 175"));
  EXPECT_THAT(html, HasSubstr("the left eye is not in the images"));
}

/// What a stage ended with.
void set_reasons(const fs::path& folder, const char* stage, const std::vector<std::string>& reasons) {
  const fs::path file = folder / stage / "stage.json";
  Json json = read_json(file);
  json["verdict"] = {{"status", 8}, {"reasons", reasons}};
  write_json(file, json);
}

TEST_F(ReportTest, AnEyeThatIsNotThereNeedsNoLabels) {
  test::FixtureOptions options;
  options.only_right = true;
  test::make_fixture_case(folder_, options);
  set_reasons(
      folder_, "segmentation",
      {"OS (left): no such eye was found in the images",
       "one eye only is seen; its side is taken from its place, 35 mm to the patient's right of the scanner's "
       "centre"});
  report();
  const std::string html = visible_text(output("report.html"));
  EXPECT_THAT(html, HasSubstr("Look whether the images show this eye"));
  EXPECT_THAT(html, HasSubstr("Check which eye it is; --laterality takes that one alone."));
  EXPECT_THAT(html, Not(HasSubstr("correct the labels")));
}

TEST_F(ReportTest, ACauseStandsOnceWhateverStagesCarryItAlong) {
  test::FixtureOptions options;
  options.only_right = true;
  test::make_fixture_case(folder_, options);
  const std::string cause = "the left globe is 35.2 mm across", other = "its cornea is not visible";
  const std::string segmented = "OS (left): " + cause + "; " + other,
                    quoted = "OS (left): refused by segmentation: " + cause;
  set_reasons(folder_, "segmentation", {segmented});
  for (const char* stage : {"meshing", "raytrace", "correction"})
    set_reasons(folder_, stage, {segmented, quoted});
  const Json eyes = report().json.at("eyes");
  EXPECT_EQ(eyes.at("os").at("reasons"), Json({cause + "; " + other}));
  const std::string html = visible_text(output("report.html"));
  const std::string limits = html.substr(html.rfind("In this case:"));
  EXPECT_EQ(limits.find(cause), limits.rfind(cause)) << limits;
  EXPECT_THAT(limits, Not(HasSubstr("refused by segmentation")));
}

TEST_F(ReportTest, HostileTextsStayTexts) {
  test::FixtureOptions options;
  options.subject = "<script>alert(1)</script>{{{style}}}%n\"'&";
  options.stage_warning = "</pre><img src=x onerror=alert(2)> \xff\x01 {{#sections}}";
  test::make_fixture_case(folder_, options);
  report();
  const std::string html = output("report.html");
  const auto has = [&](const char* text) {
    return html.find(text) != std::string::npos;
  };  // no page in a message
  EXPECT_FALSE(has("<script>alert(1)"));
  EXPECT_FALSE(has("<img src=x"));
  EXPECT_TRUE(has("&lt;script&gt;alert(1)"));
  EXPECT_TRUE(has("{{#sections}}"));
  EXPECT_THAT(pdf_text(), HasSubstr("onerror=alert(2)"));
}

TEST_F(ReportTest, HtmlNamesNoNetworkAddress) {
  test::make_fixture_case(folder_);
  report();
  const std::string html = output("report.html");
  EXPECT_LT(html.size(), most_page_bytes);
  const std::string own = html.substr(0, html.find("id=\"viewer-data\""));
  EXPECT_FALSE(std::regex_search(own, std::regex("(src|href)=[\"']?(https?:)?//")));
}

/// The program in an environment without any tool.
TEST_F(ReportTest, WithoutToolsFiguresAreMissingAndNamed) {
  test::make_fixture_case(folder_);
  const char* programs = std::getenv("EMMETROPE_BIN");
  ASSERT_NE(programs, nullptr) << "run by ctest, or set EMMETROPE_BIN to the folder of the programs";
  const auto ended = run_process(
      "/usr/bin/env",
      {"-i", "PATH=/nonexistent", std::string(programs) + "/emmetrope-report", folder_.string(), "--quiet"},
      ChildOutput::capture);
  ASSERT_EQ(ended.status, 0) << ended.output;
  for (const std::string& text : {visible_text(output("report.html")), pdf_text()}) {
    EXPECT_THAT(text, HasSubstr("SE -2.9 D, -4.5 to -1.3: do not"));
    EXPECT_THAT(text, HasSubstr("OD: corneal maps are missing, because gnuplot is not installed or failed."));
    EXPECT_THAT(text, HasSubstr("OS: charts of the wavefront are missing"));
  }
  EXPECT_NE(output("report.html").find("<figure id=\"slice-od-axial\">"), std::string::npos);
  EXPECT_EQ(output("report.html").find("<figure id=\"axial-power-od\">"), std::string::npos);
}

/// The NIfTI volume that the viewer gets first.
std::string first_volume(const ViewerData& viewer, const fs::path& folder) {
  write_file(folder / "volume.txt",
             Json::parse(viewer.data_json).at("volumes").at(0).at("data").get<std::string>());
  return run_process("/bin/sh", {"-c", "base64 -d \"$1\" | gzip -dc", "sh", (folder / "volume.txt").string()},
                     ChildOutput::capture)
      .output;
}

template <typename T>
T at(const std::string& bytes, std::size_t offset) {
  T value;
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  return value;
}

TEST_F(ReportTest, ViewerIsCoarsenedThenLeftOutWhereThePageHasNoRoom) {
  if (!has_viewer_library()) GTEST_SKIP() << "this build has no viewer (npm or network missing)";
  test::make_fixture_case(folder_);
  const CaseData data = read_case(folder_, LateralityChoice::both);
  const ViewerData full = make_viewer_data(data, most_page_bytes);
  EXPECT_EQ(full.note, "");
  const std::size_t bytes = full.script.size() + full.data_json.size();
  const ViewerData coarse = make_viewer_data(data, bytes - 1000);
  EXPECT_THAT(coarse.note, HasSubstr("every second voxel"));
  EXPECT_LE(coarse.script.size() + coarse.data_json.size(), bytes - 1000);
  const std::string fine_volume = first_volume(full, folder_), coarse_volume = first_volume(coarse, folder_);
  ASSERT_GT(coarse_volume.size(), 352U);
  for (const std::size_t axis : {0, 1}) {
    const auto count = at<std::int16_t>(fine_volume, 42 + 2 * axis);
    EXPECT_EQ(at<std::int16_t>(coarse_volume, 42 + 2 * axis), (count + 1) / 2);
    const std::size_t diagonal = 280 + 16 * axis + 4 * axis, origin = 280 + 16 * axis + 12;
    EXPECT_FLOAT_EQ(at<float>(coarse_volume, diagonal), 2 * at<float>(fine_volume, diagonal));
    EXPECT_EQ(at<float>(coarse_volume, origin), at<float>(fine_volume, origin));
  }
  EXPECT_EQ(at<std::int16_t>(coarse_volume, 46), at<std::int16_t>(fine_volume, 46));
  const ViewerData none = make_viewer_data(data, full.script.size() + 1000);
  EXPECT_EQ(none.script, "");
  EXPECT_THAT(none.note, HasSubstr("left out"));
}

/// What is left in front of the eyes is within 14 mm of a globe's centre; behind them all is as it was.
TEST_F(ReportTest, TheFaceCanBeTakenOffTheViewer) {
  if (!has_viewer_library()) GTEST_SKIP() << "this build has no viewer (npm or network missing)";
  test::make_fixture_case(folder_);
  const CaseData data = read_case(folder_, LateralityChoice::both);
  const ViewerData whole = make_viewer_data(data, most_page_bytes),
                   cut = make_viewer_data(data, most_page_bytes, Face::taken_off);
  EXPECT_THAT(cut.note, HasSubstr("The face is taken off"));
  const std::string before = first_volume(whole, folder_), after = first_volume(cut, folder_);
  ASSERT_EQ(before.size(), after.size());
  std::vector<Eigen::Vector3d> centres;
  for (const auto& eye : data.eyes) centres.push_back(*globe_centre(eye));
  const auto size = [&](std::size_t axis) { return at<std::int16_t>(before, 42 + 2 * axis); };
  std::size_t byte = 352, removed = 0, kept_in_front = 0;
  for (int k = 0; k < size(2); ++k)
    for (int j = 0; j < size(1); ++j)
      for (int i = 0; i < size(0); ++i, ++byte) {
        Eigen::Vector3d place;
        for (std::size_t row = 0; row < 3; ++row) {
          const std::size_t first = 280 + 16 * row;
          place[static_cast<Eigen::Index>(row)] = at<float>(before, first) * static_cast<float>(i) +
                                                  at<float>(before, first + 4) * static_cast<float>(j) +
                                                  at<float>(before, first + 8) * static_cast<float>(k) +
                                                  at<float>(before, first + 12);
        }
        place.head<2>() *= -1;  // the file is RAS
        const bool is_behind = std::all_of(centres.begin(), centres.end(),
                                           [&](const auto& centre) { return place.y() > centre.y() + 0.01; });
        const double nearest_mm = std::min((place - centres[0]).norm(), (place - centres[1]).norm());
        if (is_behind || nearest_mm < 13.9) {
          ASSERT_EQ(after[byte], before[byte]) << place.transpose();
          kept_in_front += is_behind ? 0 : 1;
        } else if (nearest_mm > 14.1 && place.y() < std::min(centres[0].y(), centres[1].y()) - 0.01) {
          ASSERT_EQ(after[byte], 0) << place.transpose();
          ++removed;
        }
      }
  EXPECT_GT(removed, 100U);
  EXPECT_GT(kept_in_front, 100U);
}

TEST_F(ReportTest, LargePicturesAreScaledAndThePageStaysSmall) {
  test::make_fixture_case(folder_);
  cv::Mat noise(1500, 1500, CV_8UC3);
  cv::RNG(7).fill(noise, cv::RNG::UNIFORM, 0, 255);
  for (const char* eye : {"od", "os"})
    cv::imwrite((folder_ / "correction" / eye / "corrected.png").string(), noise);
  ASSERT_GT(fs::file_size(folder_ / "correction" / "od" / "corrected.png"), 5'000'000U);
  report();
  EXPECT_LT(output("report.html").size(), most_page_bytes);
}

/// The fixture's case in `earlier`, and the same beside it.
fs::path two_visits(const fs::path& earlier) {
  fs::path later = earlier.string() + "-later";
  fs::remove_all(later);
  test::make_fixture_case(earlier);
  test::make_fixture_case(later);
  return later;
}

TEST_F(ReportTest, FollowUpTellsChangesFromMeasurementError) {
  const fs::path later = two_visits(folder_);
  const fs::path file = later / "meshing" / "od" / "biometry.json";
  Json biometry = read_json(file);
  // Half widths of 0.0588 mm each: the limit is 0.083 mm.
  biometry["optical_axial_length_mm"] = Measured::from_sigma(23.6 + 0.09, 0.03, "mri");
  // Half widths of 0.098 mm each: the limit is 0.139 mm.
  biometry["anterior_chamber_depth_mm"] = Measured::from_sigma(3.4 + 0.13, 0.05, "mri");
  // Half widths of 0.02 and, on the side of the earlier number, 0.01: the limit is 0.022.
  biometry["retina"]["q_240"] = Measured{0.14, {0.13, 0.24}, "mri"};
  write_json(file, biometry);
  CommonOptions common;
  common.verbosity.quiet = true;
  write_comparison(folder_, later, common);
  const std::string text =
      run_process("/usr/bin/pdftotext", {"-layout", (later / "comparison" / "comparison.pdf").string(), "-"},
                  ChildOutput::capture)
          .output;
  EXPECT_THAT(text,
              HasSubstr("OD (right): Axial length, optical +0.09 mm; Retinal asphericity Q, 240° +0.03."));
  EXPECT_THAT(text, HasSubstr("OS (left): nothing changed by more than its interval."));
  EXPECT_THAT(text, HasSubstr("was not checked: the source study of the cases is not at hand"));
  EXPECT_TRUE(
      std::regex_search(text, std::regex("Axial length, optical +23.60 mm +23.69 mm +.0.09 mm .*changed")))
      << text;
  EXPECT_TRUE(
      std::regex_search(text, std::regex("Anterior chamber depth +3.40 mm +3.53 mm +.0.13 mm .*within")))
      << text;
  EXPECT_TRUE(std::regex_search(text, std::regex("asphericity Q, 240.* .0.11 +.0.14 +.0.03 .*changed")))
      << text;
  fs::remove_all(later);
}

// A cylinder whose interval holds zero has no axis: the fixture's left cornea (0.34 +-0.59 D) and left prescription
// (-0.38 +-0.61 D) in both visits, the right cornea here in the later one.
TEST_F(ReportTest, FollowUpComparesNoAxisOfACylinderThatMayBeNone) {
  const fs::path later = two_visits(folder_);
  const fs::path file = later / "meshing" / "od" / "biometry.json";
  Json biometry = read_json(file);
  biometry["keratometry"]["cylinder_D"] = Measured::from_sigma(0.5, 0.3, "mri");
  write_json(file, biometry);
  CommonOptions common;
  common.verbosity.quiet = true;
  write_comparison(folder_, later, common);
  const std::string page = visible_text(read_file(later / "comparison" / "comparison.html"));
  const std::size_t left_from = page.rfind("OS (left)");
  const std::string right = page.substr(0, left_from), left = page.substr(left_from);
  const auto has_row = [](const std::string& text, const std::string& cells) {
    return std::regex_search(text, std::regex(std::regex_replace(cells, std::regex(" \\| "), "\\s+")));
  };
  const std::string not_compared = " | not determined | \u2013 | \u2013 | not determined";
  EXPECT_TRUE(has_row(right, "Axis | 176\u00b0 | 176\u00b0 | 0\u00b0")) << right;
  EXPECT_TRUE(has_row(right, "Flat axis | 178\u00b0" + not_compared)) << right;
  EXPECT_TRUE(has_row(right, "Steep axis | 88\u00b0" + not_compared)) << right;
  for (const char* row : {"Axis", "Flat axis", "Steep axis"})
    EXPECT_TRUE(has_row(left, row + std::string(" | not determined") + not_compared)) << row << left;
  fs::remove_all(later);
}

// The fixture's corneal thickness is the population's; here that of the left eye was measured once.
TEST_F(ReportTest, FollowUpJudgesNoValuesOfThePopulation) {
  const fs::path later = two_visits(folder_);
  const auto set_thickness = [&](const char* eye, const Measured& thickness) {
    const fs::path file = later / "meshing" / eye / "biometry.json";
    Json biometry = read_json(file);
    biometry["corneal_thickness_mm"] = thickness;
    write_json(file, biometry);
  };
  set_thickness("od", Measured::from_sigma(0.65, 0.03, "prior"));
  set_thickness("os", Measured::from_sigma(0.65, 0.01, "mri"));
  CommonOptions common;
  common.verbosity.quiet = true;
  write_comparison(folder_, later, common);
  const std::string page = visible_text(read_file(later / "comparison" / "comparison.html"));
  const std::size_t left_from = page.rfind("OS (left)");
  const std::regex unmeasured("Corneal thickness\\s+0.55 mm\\s+0.65 mm\\s+\u2013\\s+\u2013\\s+not measured"),
      measured("Corneal thickness\\s+0.55 mm\\s+0.65 mm\\s+.0.10 mm");
  EXPECT_TRUE(std::regex_search(page.substr(0, left_from), unmeasured)) << page;
  EXPECT_TRUE(std::regex_search(page.substr(left_from), measured)) << page;
  fs::remove_all(later);
}

// -10 D at 12 mm are -8.93 D at the cornea: no change.
TEST_F(ReportTest, FollowUpComparesRefractionsThatWereMadeAlike) {
  const fs::path later = two_visits(folder_);
  const fs::path file = later / "correction" / "od" / "prescription.json";
  Json prescription = read_json(file);
  prescription["vertex_distance_mm"] = 0;
  prescription["M_D"] = Measured::from_sigma(-8.93, 0.05, "mri");
  write_json(file, prescription);
  CommonOptions common;
  common.verbosity.quiet = true;
  write_comparison(folder_, later, common);
  const std::string page = read_file(later / "comparison" / "comparison.html");
  EXPECT_THAT(page, HasSubstr("OD (right): the refractions are not compared"));
  EXPECT_THAT(page, HasSubstr("vertex_distance_mm 12"));
  EXPECT_THAT(page, Not(HasSubstr("OS (left): the refractions are not compared")));
  fs::remove_all(later);
}

TEST_F(ReportTest, FollowUpMindsTheOrderOfDatesAndTheSubjects) {
  const fs::path later = folder_.string() + "-later";
  fs::remove_all(later);
  test::make_fixture_case(folder_);
  test::FixtureOptions another;
  another.subject = "s-another";
  test::make_fixture_case(later, another);
  Json case_json = read_json(later / "case.json");
  case_json["study_date"] = "2027-01-05";
  write_json(later / "case.json", case_json);
  CommonOptions common;
  common.verbosity.quiet = true;
  EXPECT_THROW(write_comparison(later, folder_, common), Error);
  EXPECT_FALSE(fs::exists(folder_ / "comparison"));
  write_comparison(folder_, later, common);
  fs::remove_all(later);
}

TEST_F(ReportTest, FollowUpComparesThePatientsOfTheSourceStudies) {
  const fs::path later = folder_.string() + "-later", first = folder_.string() + "-first-study",
                 second = folder_.string() + "-second-study";
  for (const auto& left_over : {later, first, second}) fs::remove_all(left_over);
  test::make_fixture_case(folder_);
  test::FixtureOptions another;
  another.subject = "s-another";
  test::make_fixture_case(later, another);
  test::make_fixture_study(first);
  test::note_study(folder_, first);
  CommonOptions common;
  const auto remark = [&] {
    return write_comparison(folder_, later, common).json["remarks"][0].get<std::string>();
  };
  EXPECT_THAT(remark(), HasSubstr("not checked: the source study of the later case"));
  test::make_fixture_study(second);
  test::note_study(later, second);
  EXPECT_EQ(remark(), "The source studies agree in the patient's ID and birth date.");
  const auto change = [&](const std::string& tag_and_value) {
    std::vector<std::string> words{"-nb", "-m", tag_and_value};
    for (const auto& entry : fs::directory_iterator(second)) words.push_back(entry.path().string());
    output_of("/usr/bin/dcmodify", words);
    test::note_study(later, second);
  };
  change("(0010,0020)=MRN-OTHER");
  EXPECT_THAT(remark(), HasSubstr("make sure that both are of one patient"));
  change("(0010,0030)=19610204");
  try {
    remark();
    ADD_FAILURE() << "two patients compared";
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), ExitStatus::input_invalid);
    EXPECT_THAT(error.what(), HasSubstr("two patients"));
    EXPECT_THAT(error.what(), Not(HasSubstr("1961")));
  }
  for (const char* page : {"comparison.html", "stage.json"})
    EXPECT_THAT(read_file(later / "comparison" / page),
                AllOf(Not(HasSubstr("MRN-")), Not(HasSubstr("1961"))));
  for (const auto& made : {later, first, second}) fs::remove_all(made);
}

TEST_F(ReportTest, FollowUpSaysThatTwoCasesAreOfOneScan) {
  const fs::path later = two_visits(folder_);
  Json case_json = read_json(later / "case.json");
  case_json["series"][0].update({{"columns", 24}, {"rows", 20}, {"min", 0}, {"max", 900}, {"mean", 123.456}});
  write_json(folder_ / "case.json", case_json);
  case_json["subject"]["id"] = "another";
  case_json["subject"]["age_years"] = 42;
  CommonOptions common;
  common.verbosity.quiet = true;
  const auto said = [&] {
    write_json(later / "case.json", case_json);
    return write_comparison(folder_, later, common).json["remarks"].dump();
  };
  EXPECT_THAT(said(), HasSubstr("Both cases are of one scan"));
  case_json["series"][0]["mean"] = 123.457;
  EXPECT_THAT(said(), Not(HasSubstr("of one scan")));
  fs::remove_all(later);
}

TEST_F(ReportTest, FollowUpRefusesOneCaseTwiceAndExplainsARefusedOne) {
  const fs::path later = two_visits(folder_);
  CommonOptions common;
  common.verbosity.quiet = true;
  for (const auto& same : {folder_, later}) try {
      write_comparison(folder_, same, common);
      ADD_FAILURE() << "one case twice";
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::usage);
      EXPECT_THAT(error.what(), HasSubstr("the same results"));
    }
  fs::remove_all(later);
  test::FixtureOptions refused;
  refused.refused = true;
  test::make_fixture_case(later, refused);
  const fs::path fit_file = later / "segmentation" / "od" / "fit.json";
  Json fit = read_json(fit_file);
  for (const char* reason : {"the lens is not visible", "the cornea was not found"})
    fit["quality"].push_back({{"name", "visible"}, {"passed", false}, {"reason", reason}});
  write_json(fit_file, fit);
  write_comparison(folder_, later, common);
  EXPECT_THAT(visible_text(read_file(later / "comparison" / "comparison.html")),
              AllOf(HasSubstr("Later, OD (right): No prescription: the images do not support one."),
                    HasSubstr("chi2 per voxel 4.2, at most 1.5; the lens is not visible; "
                              "the cornea was not found")));
  fs::remove_all(later);
}

TEST_F(ReportTest, AnEditedResultIsRefused) {
  test::make_fixture_case(folder_);
  const std::string name = "correction/od/prescription.json";
  Json stage = read_json(folder_ / "correction" / "stage.json");
  for (const StageInput& file : inputs_below(folder_, "correction"))
    stage["outputs"][file.name] = sha256_of_file(file.path);
  write_json(folder_ / "correction" / "stage.json", stage);
  report();
  Json prescription = read_json(folder_ / name);
  prescription["rounded"]["sphere_D"] = -99;
  write_json(folder_ / name, prescription);
  try {
    report();
    FAIL() << "-99 D reported";
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), ExitStatus::input_invalid);
    EXPECT_THAT(error.what(), HasSubstr((folder_ / name).string() + " has been changed"));
    EXPECT_THAT(error.remedy(), HasSubstr("emmetrope correct"));
  }
  EXPECT_THAT(visible_text(output("report.html")), Not(HasSubstr("-99")));
}

TEST_F(ReportTest, ADamagedValueIsNamedByFileAndKey) {
  test::make_fixture_case(folder_);
  const fs::path file = folder_ / "correction" / "os" / "prescription.json";
  const Json good = read_json(file);
  for (const auto& [key, value] : {std::pair<std::string, Json>{"/rounded/sphere_D", "-2"},
                                   {"/M_D/ci95/1", true},
                                   {"/J0_D/value", "x"}}) {
    Json damaged = good;
    damaged[Json::json_pointer(key)] = value;
    write_json(file, damaged);
    try {
      report();
      ADD_FAILURE() << key;
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::input_invalid);
      EXPECT_THAT(error.what(), AllOf(HasSubstr(file.string()), HasSubstr(key), HasSubstr(value.dump())));
    }
  }
}

TEST_F(ReportTest, WhatNarrowsTheIntervalIsWhatTheStageFound) {
  test::make_fixture_case(folder_);
  for (const char* eye : {"od", "os"}) {
    const fs::path file = folder_ / "correction" / eye / "prescription.json";
    Json prescription = read_json(file);
    prescription["M_D"] = Measured::from_sigma(-2, 0.8, "mri");
    prescription["if_measured"] = {{{"measurement", "optical axial length +-0.05 mm"}, {"M_D", 0.79}},
                                   {{"measurement", "keratometry +-0.25 D"}, {"M_D", 0.5}},
                                   {{"measurement", "refraction +-0.25 D"}, {"M_D", 0.25}}};
    prescription["budget"].push_back(
        {{"source", "correlations"}, {"M_D", -0.3}, {"J0_D", 0.0}, {"J45_D", 0.0}});
    write_json(file, prescription);
  }
  report();
  const std::string page = visible_text(output("report.html"));
  EXPECT_THAT(page,
              HasSubstr("Refract, and give what was found (--refraction): it would leave \u00b10.5 D of "
                        "spherical equivalent."));
  EXPECT_THAT(page, HasSubstr("correlations (with a minus sign it lessens the total)"));
}

TEST_F(ReportTest, AGivenRefractionStandsBesideWhatTheImagesSay) {
  const auto with_surprise = [&](double sigmas) {
    fs::remove_all(folder_);
    test::make_fixture_case(folder_);
    const fs::path file = folder_ / "correction/od/prescription.json";
    Json prescription = read_json(file);
    prescription["M_D"] = Measured::from_sigma(-8, 0.2, "refraction");
    prescription["calibration"] = {
        {"given", {{"sphere_D", -9.0}, {"cylinder_D", 0.0}, {"axis_deg", 0.0}}},
        {"sigma_D", 0.25},
        {"surprise_sigma", sigmas},
        {"surprise_limit_sigma", 3},
        {"without_it",
         {{"sphere_D", -1.62},
          {"cylinder_D", -0.85},
          {"axis_deg", 170.0},
          {"M_D", {{"value", -2.045}, {"ci95", {-3.345, -0.745}}, {"source", "mri"}}}}}};
    write_json(file, prescription);
    report();
    const std::string html = output("report.html");
    const std::size_t card = html.find("id=\"card-od\"");
    return html.substr(card, html.find("</article>", card) - card);
  };
  const std::string agreeing = with_surprise(1.2);
  for (const char* shown : {"-9.00 DS", "-1.62 / -0.85 x 170", "\u00b10.49 D", "-3.35"})
    EXPECT_NE(visible_text("<body>" + agreeing).find(shown), std::string::npos) << shown;
  EXPECT_NE(agreeing.find("Supported, with the refraction that was given"), std::string::npos);
  EXPECT_EQ(agreeing.find("standard deviations"), std::string::npos);

  // No mean of two that contradict: both refractions, and no lens in any form.
  const std::string contradicted = visible_text("<body>" + with_surprise(4.4)), page = output("report.html");
  for (const std::string& text : {contradicted, pdf_text()})
    EXPECT_THAT(text, AllOf(HasSubstr("-9.00"), HasSubstr("-1.62")));
  EXPECT_THAT(contradicted, AllOf(HasSubstr("Given and images contradict: check eye and sign"),
                                  HasSubstr("differ by 4.4 standard deviations"),
                                  HasSubstr("No prescription: given and images contradict"),
                                  Not(HasSubstr("-2.25 / -1.00 x 175")), Not(HasSubstr("SE \u00b1"))));
  EXPECT_THAT(table_of(page, "Best lens of each kind"), AllOf(HasSubstr("OS"), Not(HasSubstr("OD"))));
  EXPECT_FALSE(
      read_json(folder_ / "report/stage.json").at("answer").at("eyes").at("od").contains("prescription"));
  EXPECT_THAT(dump("prescription.dcm"), AllOf(HasSubstr("Left Eye Rx"), Not(HasSubstr("Right Eye Rx"))));
  EXPECT_THAT(output("prescription.fhir.json"), AllOf(HasSubstr("left"), Not(HasSubstr("right"))));
}

TEST_F(ReportTest, AGivenRefractionIsCombinedWithReadingsToo) {
  test::make_fixture_case(folder_);
  Json meshing = read_json(folder_ / "meshing/stage.json");
  meshing["parameters"]["instruments"]["od"] = {{"measurements", {{{"quantity", "keratometry"}}}}};
  write_json(folder_ / "meshing/stage.json", meshing);
  for (const char* eye : {"od", "os"}) {
    const fs::path file = folder_ / "correction" / eye / "prescription.json";
    Json prescription = read_json(file);
    prescription["M_D"] = Measured::from_sigma(-4, 0.24, "refraction");
    prescription["learnt_from"] = {"refraction"};
    prescription["calibration"] = {
        {"given", {{"sphere_D", -4.0}, {"cylinder_D", 0.0}, {"axis_deg", 0.0}}},
        {"sigma_D", 0.25},
        {"surprise_sigma", 1},
        {"surprise_limit_sigma", 3},
        {"without_it", {{"sphere_D", -3.5}, {"cylinder_D", 0.0}, {"axis_deg", 0.0}}}};
    write_json(file, prescription);
  }
  report();
  const std::string html = output("report.html");
  const auto card = [&](const std::string& eye) {
    const std::size_t at = html.find("id=\"card-" + eye + "\"");
    return visible_text("<body>" + html.substr(at, html.find("</article>", at) - at));
  };
  EXPECT_THAT(card("od"), AllOf(HasSubstr("what images and other instruments say, -3.50 DS"),
                                Not(HasSubstr("images alone"))));
  EXPECT_THAT(card("os"), HasSubstr("what the images alone say, -3.50 DS"));
}

/// Whoever gave a refraction is not told to refract, nor that the index is the age's.
TEST_F(ReportTest, ACardAfterAGivenRefractionTellsWhatItChanged) {
  test::make_fixture_case(folder_);
  Json stage = read_json(folder_ / "raytrace/stage.json");
  stage["eyes"]["od"]["lens_index"] = 1.4254;
  stage["eyes"]["od"]["lens_index_from"] = "age 40 years";
  write_json(folder_ / "raytrace/stage.json", stage);
  const fs::path file = folder_ / "correction/od/prescription.json";
  Json prescription = read_json(file);
  prescription["M_D"] = Measured::from_sigma(-4, 0.24, "refraction");
  prescription["calibration"] = {{"surprise_sigma", 0.8},
                                 {"surprise_limit_sigma", 3},
                                 {"lens_index_after", Measured{1.4312, {1.4250, 1.4374}, "refraction"}}};
  write_json(file, prescription);
  report();
  const std::string html = output("report.html");
  const std::size_t at = html.find("id=\"card-od\"");
  const std::string card = visible_text("<body>" + html.substr(at, html.find("</article>", at) - at));
  EXPECT_THAT(card, AllOf(HasSubstr("the refraction that was given"),
                          HasSubstr("lens index 1.431 (1.425 to 1.437), from the refraction that was given"),
                          HasSubstr("Try the lens in a trial frame before it is dispensed.")));
  EXPECT_THAT(card, AllOf(Not(HasSubstr("age 40 years")), Not(HasSubstr("no MR image shows")),
                          Not(HasSubstr("Confirm by a subjective refraction"))));
  const std::string page = visible_text(html);
  EXPECT_THAT(page, AllOf(HasSubstr("By the refraction that was given it is 1.431 in OD."),
                          HasSubstr("alone moves the spherical equivalent by 0.78 D in OS (one standard")));
}

/// Two eyes of +-1.61 D each: 2.3 D apart at least, or nothing is said.
TEST_F(ReportTest, ADifferenceBetweenTheEyesIsTheIntervalsToo) {
  test::make_fixture_case(folder_);
  const auto with_sigma = [&](double sigma_D) {
    for (const char* eye : {"od", "os"}) {
      const fs::path file = folder_ / "correction" / eye / "prescription.json";
      Json prescription = read_json(file);
      prescription["M_D"] = Measured::from_sigma(prescription["M_D"]["value"], sigma_D, "mri");
      write_json(file, prescription);
    }
    report();
    return visible_text(output("report.html"));
  };
  // M is -2.87 and +0.12 D: 1.96 sqrt(2) sigma is 1.1 and 3.3 D.
  EXPECT_THAT(with_sigma(0.4), HasSubstr("The eyes differ by 3.0 \u00b1 1.1 D of spherical equivalent"));
  EXPECT_THAT(with_sigma(1.2), Not(HasSubstr("The eyes differ")));
}

/// What is shown with the lens is of the eye that the lens was found for.
TEST_F(ReportTest, TheWavefrontFollowsAGivenRefraction) {
  test::make_fixture_case(folder_);
  const fs::path file = folder_ / "correction/od/prescription.json";
  Json prescription = read_json(file);
  const auto power = [&](double M_D) {
    return PowerVector{M_D, prescription["J0_D"]["value"].get<double>(),
                       prescription["J45_D"]["value"].get<double>()};
  };
  const double before_D = prescription["M_D"]["value"], now_D = before_D - 1.73;
  Json alone = Json::object();
  for (const char* key : {"M_D", "J0_D", "J45_D"}) alone[key] = prescription[key];
  prescription["M_D"] = Measured::from_sigma(now_D, 0.2, "refraction");
  prescription["learnt_from"] = {"refraction"};
  prescription["calibration"] = {{"surprise_sigma", 0.8}, {"surprise_limit_sigma", 3}, {"without_it", alone}};
  write_json(file, prescription);
  report();
  // 12 mm before an eye whose pupil lies 3 mm behind its cornea; W = -M r^2 / (4 sqrt 3).
  const Json wavefront = read_json(folder_ / "raytrace/od/wavefront.json");
  const double radius_mm = wavefront["pupil_mm"].get<double>() / 2,
               moved_D = move_towards_eye(power(now_D), 15).M_D - move_towards_eye(power(before_D), 15).M_D,
               defocus_um = wavefront["zernike_um"][4].get<double>() -
                            moved_D * radius_mm * radius_mm / (4 * std::sqrt(3.0));
  EXPECT_THAT(table_of(output("report.html"), "Zernike coefficients"),
              HasSubstr(format(defocus_um, {4, true, "\u00b5m"})));
  const std::string page = visible_text(output("report.html"));
  EXPECT_THAT(page, HasSubstr("OD: the wavefront is of the eye after the refraction that was given"));
  EXPECT_THAT(page, HasSubstr("before, with no lens, the eye as the images alone show it"));
  EXPECT_THAT(page, Not(HasSubstr("OS: the wavefront is of the eye")));

  // Readings of instruments have moved it by an amount that no file tells.
  prescription["learnt_from"] = {"keratometry", "refraction"};
  write_json(file, prescription);
  report();
  const std::string html = output("report.html");
  EXPECT_THAT(html, AllOf(HasSubstr("letters-before-od"), HasSubstr("letters-after-os"),
                          Not(HasSubstr("letters-after-od")),
                          HasSubstr("OD: the wavefront is of the eye as it was traced")));
}

/// Two dioptres more of spectacles are not two in the pupil: 0.22 D fewer here.
TEST_F(ReportTest, LettersAtTheEndAreOfTheLensThatIsSoFarOff) {
  test::make_fixture_case(folder_);
  constexpr double reach_D = 2;
  const auto letters = [&](double M_D, const std::string& kind) {
    const fs::path file = folder_ / "correction/od/prescription.json";
    Json prescription = read_json(file);
    prescription["M_D"] = Measured{M_D, {M_D - reach_D, M_D + reach_D}, "mri"};
    write_json(file, prescription);
    report();
    const std::string html = output("report.html");
    const std::size_t figure = html.find("letters-" + kind + "-od\"");
    EXPECT_NE(figure, std::string::npos) << kind;
    const std::size_t picture = html.find("base64,", figure);
    return html.substr(picture, html.find('"', picture) - picture);
  };
  EXPECT_EQ(letters(-5, "end"), letters(-5 + reach_D, "estimate"));
}

/// A topography, a scene, a lens, movements: their hashes are among those of the inputs.
TEST_F(ReportTest, NamesOfFilesThatWereTypedAreNowhere) {
  test::make_fixture_case(folder_);
  const auto set = [&](const std::string& stage, const Json& parameters) {
    Json json = read_json(folder_ / stage / "stage.json");
    json["parameters"].update(parameters);
    write_json(folder_ / stage / "stage.json", json);
  };
  const Json topography{{"od", {{"topography", {{"file", "maps/Meier_Hans_19600102"}, {"sigma_D", 0.25}}}}}};
  set("meshing", {{"instruments", topography}});
  set("raytrace", {{"scene", "Hans Meier.json"},
                   {"spectacle", "/home/meier/lens of Meier"},
                   {"movement", "Meier_saccades.CSV"}});
  set("correction", {{"picture", {{"scene", "letters:logmar=0.3,distance_mm=6000"}}},
                     {"chart", "../Meier.json"},
                     {"known", {{"instruments", topography}}}});
  report();
  const std::string html = output("report.html");
  for (const char* name : {"Meier", "meier", "19600102"}) {
    EXPECT_THAT(html, Not(HasSubstr(name)));
    EXPECT_THAT(output("stage.json"), Not(HasSubstr(name)));
    EXPECT_THAT(pdf_text(), Not(HasSubstr(name)));
  }
  EXPECT_THAT(html, HasSubstr("letters:logmar=0.3,distance_mm=6000"));
}

TEST_F(ReportTest, QuietSaysOnlyWhereTheReportIs) {
  test::make_fixture_case(folder_);
  EXPECT_EQ(report().text, (folder_ / "report" / "report.html").string() + "\n");
}

TEST_F(ReportTest, BrokenJsonIsAnInputErrorAndLeavesNothing) {
  test::make_fixture_case(folder_);
  write_json(folder_ / "meshing" / "od" / "biometry.json",
             Json{{"lps_from_eye", "nonsense"}, {"astigmatism", 3}});
  try {
    report();
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), ExitStatus::input_invalid) << error.what();
  }
  EXPECT_FALSE(fs::exists(folder_ / "report"));
}

TEST_F(ReportTest, MissingSegmentationIsNamed) {
  fs::create_directories(folder_);
  try {
    report();
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), ExitStatus::input_invalid);
    EXPECT_THAT(error.what(), HasSubstr("segmentation"));
    EXPECT_THAT(error.remedy(), HasSubstr("emmetrope segment"));
  }
  EXPECT_FALSE(fs::exists(folder_ / "report"));
}

}  // namespace
}  // namespace emmetrope::report
