#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>

#include "pipeline/base/files.hpp"
#include "pipeline/base/notation.hpp"
#include "pipeline/base/process.hpp"
#include "pipeline/report/document/numbers.hpp"
#include "pipeline/report/stage.hpp"
#include "tests/support/fixture_case.hpp"
#include "tests/support/temporary_folder.hpp"

// report.html as its readers have it: in a browser, by mouse, by keyboard, on paper, in the dark, without
// scripts.

namespace emmetrope::report {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST(Browser, ShowsMovesAndPrintsThePageWithoutNetwork) {
  if (!std::filesystem::exists("/usr/bin/chromium")) GTEST_SKIP() << "Chromium is not installed";
  if (std::string(EMMETROPE_PLAYWRIGHT).empty())
    GTEST_SKIP()
        << "playwright-core was not installed when the project was configured (npm or network missing)";
  const test::TemporaryFolder temporary;
  const fs::path folder = temporary.path() / "case";
  test::make_fixture_case(folder);
  CommonOptions common;
  common.verbosity.quiet = true;
  write_report({folder, {}, false}, common);
  const fs::path found = folder / "found";
  const ProcessResult browser = run_process(
      "/usr/bin/env",
      {"node", EMMETROPE_BROWSER_CHECK, (folder / "report" / "report.html").string(), found.string()},
      ChildOutput::capture);
  ASSERT_EQ(browser.status, 0) << browser.output;
  const Json findings = read_json(found / "findings.json");

  EXPECT_THAT(findings.at("complaints"), IsEmpty());
  EXPECT_THAT(findings.at("requests"), IsEmpty());
  ASSERT_TRUE(findings.at("viewer")) << "the page carries no viewer";
  for (const char* act :
       {"viewer_is_still", "viewer_scrolls", "viewer_obeys_keys", "viewer_turns", "slider_moves"})
    EXPECT_TRUE(findings.at(act)) << act;
  EXPECT_EQ(findings.at("radiological").at("left"), "R");
  EXPECT_EQ(findings.at("radiological").at("flipped"), "none");
  EXPECT_EQ(findings.at("neurological").at("left"), "L");
  EXPECT_THAT(findings.at("neurological").at("flipped").get<std::string>(), HasSubstr("matrix(-1, 0, 0, 1"));
  EXPECT_GT(findings.at("light").get<double>(), 0.8);
  EXPECT_LT(findings.at("dark").get<double>(), 0.2);
  EXPECT_TRUE(findings.at("contours_hide"));
  ASSERT_EQ(findings.at("accessibility").size(), 4U);
  for (const auto& [scheme, violations] : findings.at("accessibility").items())
    EXPECT_THAT(violations, IsEmpty()) << scheme;
  for (const char* window : {"desktop", "narrow"})
    EXPECT_THAT(findings.at("layout").at(window), IsEmpty()) << window;

  // Slices and letters, two of each eye: never three in a line and one of the left eye below.
  for (const auto& [width, rows] : findings.at("panels_a_line").items()) {
    EXPECT_GE(rows.size(), 2U) << width;
    for (const Json& panels : rows) EXPECT_TRUE(panels == 2 || panels == 4) << width << " " << panels;
  }

  // WebGL prints as a black box. The viewer is as wide as the page, the widest picture on paper less than
  // half of it.
  EXPECT_FALSE(findings.at("canvas_printed"));
  EXPECT_LT(findings.at("printed").at("widest_black").get<double>(), 0.5);
  const Json rounded = read_json(folder / "correction" / "od" / "prescription.json").at("rounded");
  const std::string prescription =
      format_refraction({rounded.at("sphere_D"), rounded.at("cylinder_D"), rounded.at("axis_deg")});
  EXPECT_THAT(findings.at("printed").at("text").get<std::string>(), HasSubstr(prescription));
  const Json& plain = findings.at("without_scripts");
  EXPECT_THAT(plain.at("text").get<std::string>(), HasSubstr(prescription));
  EXPECT_EQ(plain.at("pictures"), plain.at("pictures_shown"));
  EXPECT_EQ(plain.at("pictures"), 4);
  EXPECT_GT(plain.at("figures").get<int>(), 20);
}

}  // namespace
}  // namespace emmetrope::report
