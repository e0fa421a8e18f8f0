#include <regex>
#include <sstream>

#include "pipeline/report/normal_ranges.hpp"
#include "report_fixture.hpp"

// Every clinical number on the pages and in the objects is the JSON's.

namespace emmetrope::report {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;

class NumbersTest : public ReportTest {
 protected:
  Json json_of(const std::string& stage, const std::string& eye, const std::string& file) const {
    return read_json(folder_ / stage / eye / file);
  }
  void expect_biometry() const;
  void expect_refraction() const;
  void expect_criteria_budget_and_wavefront() const;
};

using Row = std::vector<std::string>;

/// The rows of all of the page's tables, cell by cell.
std::vector<Row> table_rows(const std::string& html) {
  std::vector<Row> rows;
  const std::regex cell("<t[hd][^>]*>([^<]*)</t[hd]>");
  for (std::size_t at = html.find("<tr>"); at != std::string::npos; at = html.find("<tr>", at + 1)) {
    const std::string row = html.substr(at, html.find("</tr>", at) - at);
    Row cells;
    for (auto found = std::sregex_iterator(row.begin(), row.end(), cell); found != std::sregex_iterator();
         ++found)
      cells.push_back((*found)[1]);
    rows.push_back(cells);
  }
  return rows;
}

/// A line of the PDF's text: its cells stand two spaces or more apart.
std::vector<Row> lines_of(const std::string& text) {
  std::vector<Row> lines;
  std::istringstream stream(text);
  const std::regex gap(" {2,}");
  for (std::string line; std::getline(stream, line);) {
    line.erase(0, line.find_first_not_of(" \f"));
    lines.emplace_back(std::sregex_token_iterator(line.begin(), line.end(), gap, -1),
                       std::sregex_token_iterator());
  }
  return lines;
}

/// Rows that begin with `expected`.
::testing::Matcher<const std::vector<Row>&> have_row(const Row& expected) {
  return Contains(::testing::ResultOf(
      [count = expected.size()](const Row& row) {
        return Row(row.begin(), row.begin() + static_cast<std::ptrdiff_t>(std::min(count, row.size())));
      },
      expected));
}

void NumbersTest::expect_biometry() const {
  const auto html = table_rows(output("report.html")), pdf = lines_of(pdf_text());
  for (const auto* rows : {&biometry_rows(), &keratometry_rows()})
    for (const auto& row : *rows) {
      Row expected{row.name};
      for (const char* eye : {"od", "os"}) {
        const auto measured =
            json_of("meshing", eye, "biometry.json").at(Json::json_pointer("/" + row.key)).get<Measured>();
        const bool is_unusual =
            row.low != row.high && (measured.value < row.low || measured.value > row.high);
        expected.push_back(format(measured.value, row.style) + (is_unusual ? " (!)" : ""));
        expected.push_back(format_interval(measured, row.style));
      }
      EXPECT_THAT(html, have_row(expected));
      if (row.name.size() < 34) {  // longer names break into two lines
        EXPECT_THAT(pdf, have_row(expected));
      }
    }
}

void NumbersTest::expect_refraction() const {
  const auto html = table_rows(output("report.html"));
  const std::string pdf = pdf_text(), page = visible_text(output("report.html"));
  for (const char* eye : {"od", "os"}) {
    const Json prescription = json_of("correction", eye, "prescription.json");
    const Json& rounded = prescription.at("rounded");
    const std::string text =
        format_refraction(rounded.at("sphere_D"), rounded.at("cylinder_D"), rounded.at("axis_deg"));
    EXPECT_THAT(page, HasSubstr(text));
    EXPECT_THAT(pdf, HasSubstr(text));
    for (const auto& [key, name] :
         {std::pair{"sphere_D", "Sphere"}, std::pair{"cylinder_D", "Cylinder"}, std::pair{"axis_deg", "Axis"},
          std::pair{"M_D", "M"}, std::pair{"J0_D", "J0"}, std::pair{"J45_D", "J45"}}) {
      const auto measured = prescription.at(key).get<Measured>();
      const NumberStyle style =
          std::string(key) == "axis_deg" ? NumberStyle{0, false, "deg"} : NumberStyle{2, true, "D"};
      EXPECT_THAT(html, have_row({name, format(measured.value, style), format_interval(measured, style)}));
      EXPECT_TRUE(std::regex_search(
          pdf, std::regex(name + std::string(" +") +
                          std::regex_replace(format(measured.value, style), std::regex("[+]"), "[+]") + " +" +
                          std::regex_replace(format_interval(measured, style), std::regex("[+]"), "[+]"))))
          << name << " of " << eye;
    }
  }
}

void NumbersTest::expect_criteria_budget_and_wavefront() const {
  const auto html = table_rows(output("report.html")), pdf = lines_of(pdf_text());
  const Json od = json_of("correction", "od", "prescription.json"),
             os = json_of("correction", "os", "prescription.json");
  const auto powers_of = [](const std::string& name, const Json& right, const Json& left, bool with_sign) {
    Row row{name};
    for (const Json& eye : {right, left})
      for (const char* key : {"M_D", "J0_D", "J45_D"})
        row.push_back(format(eye.at(key), {2, with_sign, "D"}));
    return row;
  };
  for (const auto& [key, name] : {std::pair{"paraxial", "Paraxial (curvature at the centre)"},
                                  std::pair{"minimum_rms_wavefront", "Least wavefront error"},
                                  std::pair{"minimum_rms_spot", "Least spot"},
                                  std::pair{"visual_strehl", "Best visual Strehl ratio"}}) {
    const Row row = powers_of(name, od.at("wavefront_check").at(key), os.at("wavefront_check").at(key), true);
    EXPECT_THAT(html, have_row(row));
    EXPECT_THAT(pdf, have_row(row));
  }
  for (std::size_t i = 0; i < od.at("budget").size(); ++i) {
    const Row row = powers_of(od["budget"][i].at("source"), od["budget"][i], os["budget"][i], false);
    EXPECT_THAT(html, have_row(row));
    EXPECT_THAT(pdf, have_row(row));
  }
  const Json right = json_of("raytrace", "od", "wavefront.json"),
             left = json_of("raytrace", "os", "wavefront.json");
  for (const auto& [key, name, style] :
       {std::tuple{"pupil_mm", "Entrance pupil", NumberStyle{2, false, "mm"}},
        std::tuple{"wavelength_nm", "Wavelength", NumberStyle{1, false, "nm"}},
        std::tuple{"rms_um", "Wavefront error, rms", NumberStyle{3, false, "\u00b5m"}},
        std::tuple{"strehl", "Strehl ratio", NumberStyle{3, false, ""}},
        std::tuple{"vsotf", "Visual Strehl ratio (VSOTF)", NumberStyle{3, false, ""}}}) {
    const Row row{name, format(right.at(key), style), format(left.at(key), style)};
    EXPECT_THAT(html, have_row(row));
    EXPECT_THAT(pdf, have_row(row));
  }
  const Json& cylinder = od.at("plano_cylinder");
  EXPECT_THAT(html,
              have_row({"Radius of the back surface", format(cylinder.at("radius_mm"), {1, true, "mm"})}));
  EXPECT_THAT(html, have_row({"Sharpness reached", format(cylinder.at("sharpness"), {4, false, ""})}));
}

TEST_F(NumbersTest, OfTheJsonStandInHtmlAndPdf) {
  test::make_fixture_case(folder_);
  report();
  expect_biometry();
  expect_refraction();
  expect_criteria_budget_and_wavefront();
}

TEST_F(NumbersTest, FollowTheJsonAndNotAStoredText) {
  test::make_fixture_case(folder_);
  const fs::path file = folder_ / "correction" / "od" / "prescription.json";
  Json prescription = read_json(file);
  prescription["rounded"]["sphere_D"] = -7.5;
  write_json(file, prescription);
  report();
  EXPECT_THAT(visible_text(output("report.html")), HasSubstr("-7.50 / -1.00 x 175"));
  EXPECT_THAT(pdf_text(), HasSubstr("-7.50 / -1.00 x 175"));
  EXPECT_THAT(dump("prescription.dcm"), HasSubstr("[-7.5000]"));
  EXPECT_THAT(output("prescription.fhir.json"), HasSubstr("\"sphere\": -7.5"));
}

/// What dsrdump prints of one NUM item.
struct Number {
  double value = 0, upper = -1, lower = -1;
  std::string unit, method;
};

/// eye -> name -> number
std::map<std::string, std::map<std::string, Number>> numbers_of(const std::string& dsrdump) {
  std::map<std::string, std::map<std::string, Number>> numbers;
  std::istringstream lines(dsrdump);
  std::string eye, name;
  const std::regex item(R"re((contains|has properties) NUM:\(,,"([^"]*)"\)="([^"]*)" \(([^,]*),)re");
  const std::regex method(R"re(Measurement Method"\)=\(([^,]*),)re");
  for (std::string line; std::getline(lines, line);) {
    std::smatch found;
    if (line.find("\"OD (right eye)\"") != std::string::npos) eye = "od";
    if (line.find("\"OS (left eye)\"") != std::string::npos) eye = "os";
    if (std::regex_search(line, found, method)) numbers[eye][name].method = found[1];
    if (!std::regex_search(line, found, item)) continue;
    const double value = std::stod(found[3]);
    if (found[1] == "contains") {
      name = found[2];
      numbers[eye][name].value = value;
      numbers[eye][name].unit = found[4];
    } else {
      (found[2].str()[0] == '+' ? numbers[eye][name].upper : numbers[eye][name].lower) = value;
    }
  }
  return numbers;
}

TEST_F(NumbersTest, BiometryObjectHoldsEveryNumberWithItsInterval) {
  test::make_fixture_case(folder_);
  report();
  const auto numbers =
      numbers_of(output_of("/usr/bin/dsrdump", {(folder_ / "report" / "biometry.dcm").string()}));
  const std::map<std::string, std::string> units{
      {"mm", "mm"}, {"D", "[diop]"}, {"deg", "deg"}, {"\u00b5m", "um"}, {"", "1"}};
  constexpr double half_digit = 0.5e-4 + 1e-9;
  for (const char* eye : {"od", "os"}) {
    const Json biometry = json_of("meshing", eye, "biometry.json");
    std::size_t count = 0;
    for (const auto* rows : {&biometry_rows(), &keratometry_rows()})
      for (const auto& row : *rows) {
        ++count;
        ASSERT_EQ(numbers.at(eye).count(row.name), 1U) << row.name;
        const Number& number = numbers.at(eye).at(row.name);
        const auto measured = biometry.at(Json::json_pointer("/" + row.key)).get<Measured>();
        EXPECT_NEAR(number.value, measured.value, half_digit) << row.name;
        EXPECT_NEAR(number.upper, measured.ci95[1] - measured.value, half_digit) << row.name;
        EXPECT_NEAR(number.lower, measured.value - measured.ci95[0], half_digit) << row.name;
        EXPECT_EQ(number.unit, units.at(row.style.unit)) << row.name;
        EXPECT_EQ(number.method, measured.source == "mri" ? "113091000" : "PRIOR") << row.name;
      }
    EXPECT_EQ(numbers.at(eye).size(), count);
  }
}

}  // namespace
}  // namespace emmetrope::report
