#include <regex>
#include <set>
#include <sstream>

#include "pipeline/base/notation.hpp"
#include "pipeline/report/content/biometry_rows.hpp"
#include "pipeline/report/content/content.hpp"
#include "pipeline/report/content/content_tables.hpp"
#include "tests/pipeline/report/report_fixture.hpp"

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
      cells.push_back(std::regex_replace((*found)[1].str(), std::regex("&apos;|&#39;"), "'"));
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

/// Whether a line of the PDF holds a row: words may break into a second line, numbers may not.
bool holds(const Row& line, const Row& row) {
  Row wanted;
  std::copy_if(row.begin(), row.end(), std::back_inserter(wanted),
               [](const auto& cell) { return !cell.empty(); });
  const auto shows = [](const std::string& cell, const std::string& whole) {
    const bool is_number = whole.find_first_of("0123456789") <= 1;
    return cell == whole || (!is_number && !cell.empty() && whole.rfind(cell, 0) == 0);
  };
  for (std::size_t first = 0; first + wanted.size() <= line.size(); ++first)
    if (std::equal(wanted.begin(), wanted.end(), line.begin() + static_cast<std::ptrdiff_t>(first),
                   [&](const auto& whole, const auto& cell) { return shows(cell, whole); }))
      return true;
  return false;
}

bool have_line(const std::vector<Row>& lines, const Row& row) {
  return std::any_of(lines.begin(), lines.end(), [&](const Row& line) { return holds(line, row); });
}

/// An astigmatism whose interval holds zero has no axis.
bool may_be_none(const Json& cylinder_D) {
  const auto measured = cylinder_D.get<Measured>();
  return measured.ci95[0] <= 0 && measured.ci95[1] >= 0;
}

void NumbersTest::expect_biometry() const {
  const auto html = table_rows(output("report.html"));
  for (const auto* rows : measured_rows())
    for (const auto& row : *rows) {
      if (row.key == inner_axial_length_key) continue;  // in the note below (OfEachResultFileStandOnThePage)
      Row expected{row.name};
      for (const char* eye : {"od", "os"}) {
        if (row.key.rfind("keratometry/", 0) == 0 && row.style.unit == "axis" &&
            may_be_none(json_of("meshing", eye, "biometry.json")["keratometry"]["cylinder_D"])) {
          expected.insert(expected.end(), {"not determined", "any"});
          continue;
        }
        const auto measured =
            json_of("meshing", eye, "biometry.json").at(Json::json_pointer("/" + row.key)).get<Measured>();
        expected.push_back(format(measured.value, row.style) +
                           (row.normal({}).range.contains(measured.value) ? "" : " (!)"));
        expected.push_back(format_interval(measured, row.style));
      }
      EXPECT_THAT(html, have_row(expected));
    }
}

void NumbersTest::expect_refraction() const {
  const auto html = table_rows(output("report.html"));
  const std::string pdf = pdf_text(), page = visible_text(output("report.html"));
  for (const char* eye : {"od", "os"}) {
    const Json prescription = json_of("correction", eye, "prescription.json");
    const Json& rounded = prescription.at("rounded");
    const std::string text =
        format_refraction({rounded.at("sphere_D"), rounded.at("cylinder_D"), rounded.at("axis_deg")});
    EXPECT_THAT(page, HasSubstr(may_be_none(prescription.at("cylinder_D")) ? without_axis(text) : text));
    // The headline of both media: its interval is too wide for more than the spherical equivalent.
    const auto M_D = prescription.at("M_D").get<Measured>();
    const std::string headline = "SE " + format(M_D.value, {1, true, "D"}) + ", " +
                                 signed_fixed(M_D.ci95[0], 1) + " to " + signed_fixed(M_D.ci95[1], 1) + ":";
    EXPECT_THAT(page, HasSubstr(headline));
    EXPECT_THAT(pdf, HasSubstr(headline));
    for (const auto& [key, name] :
         {std::pair{"sphere_D", "Sphere"}, std::pair{"cylinder_D", "Cylinder"}, std::pair{"axis_deg", "Axis"},
          std::pair{"M_D", "M"}, std::pair{"J0_D", "J0"}, std::pair{"J45_D", "J45"}}) {
      const auto measured = prescription.at(key).get<Measured>();
      const NumberStyle style =
          std::string(key) == "axis_deg" ? NumberStyle{0, false, "axis"} : NumberStyle{2, true, "D"};
      if (std::string(key) == "axis_deg" && may_be_none(prescription.at("cylinder_D")))
        EXPECT_THAT(html, have_row({name, "not determined", "any"}));
      else
        EXPECT_THAT(html, have_row({name, format(measured.value, style), format_interval(measured, style)}));
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
    EXPECT_TRUE(have_line(pdf, row)) << row.front();
  }
  for (std::size_t i = 0; i < od.at("budget").size(); ++i) {
    const Row row = powers_of(od["budget"][i].at("source"), od["budget"][i], os["budget"][i], false);
    EXPECT_THAT(html, have_row(row));
    EXPECT_TRUE(have_line(pdf, row)) << row.front();
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
    EXPECT_TRUE(have_line(pdf, row)) << row.front();
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

/// Every table of the page whose caption the PDF carries stands there row by row.
TEST_F(NumbersTest, PdfHoldsTheRowsOfThePage) {
  test::make_fixture_case(folder_);
  report();
  const std::string html = output("report.html"), text = pdf_text();
  const auto lines = lines_of(text);
  const std::regex caption("<caption>([^<]*)</caption>");
  int printed = 0;
  for (std::size_t at = html.find("<table"); at != std::string::npos; at = html.find("<table", at + 1)) {
    const std::string table = html.substr(at, html.find("</table>", at) - at);
    std::smatch found;
    ASSERT_TRUE(std::regex_search(table, found, caption));
    if (text.find(found[1].str()) == std::string::npos) continue;
    ++printed;
    for (const auto& row : table_rows(table.substr(table.find("<tbody>"))))
      EXPECT_TRUE(have_line(lines, row)) << found[1] << ": " << ::testing::PrintToString(row);
  }
  EXPECT_GE(printed, 7);
}

/// A number of a result file, and whether it is the half width of an axis's interval.
struct Leaf {
  std::string pointer;
  double value = 0;
};

/// What a clinician has no use for: how the search went, frames, curves that are drawn, and texts' parts.
bool is_clinical(const std::string& pointer) {
  static const std::regex other(
      "/(lps_from_eye|head_roll_deg|plausibility|search|images|distinct_optima_D|log_curvature[^/]*|learnt_from|difference|mtf|zone_mm|cornea_zernike_um)(/.*)?|.*/(residual_D|search|images|distinct_optima_D|log_curvature[^/]*)(/.*)?");
  return !std::regex_match(pointer, other);
}

/// Moves every clinical number by another small step, so that no two are alike, and lists what they became.
void make_distinct(Json& json, const std::string& pointer, int& count, std::vector<Leaf>& leaves) {
  if (!is_clinical(pointer)) return;
  const auto step = [&] { return 0.0137 * ++count; };
  if (json.is_object() && json.contains("ci95")) {
    // The refraction's cylinder stays one that has an axis, which then stands in every form.
    const double by = pointer == "/cylinder_D" ? -step() : step();
    json["value"] = json["value"].get<double>() + by;
    leaves.push_back({pointer, json["value"]});
    for (auto& end : json["ci95"]) end = end.get<double>() + by;
    const bool is_angle = pointer.find("_deg") != std::string::npos;  // written as value and half width
    if (is_angle)
      leaves.push_back({pointer, (json["ci95"][1].get<double>() - json["ci95"][0].get<double>()) / 2});
    if (!is_angle)
      for (const auto& end : json["ci95"]) leaves.push_back({pointer, end});
  } else if (json.is_structured()) {
    std::size_t index = 0;
    for (auto item = json.begin(); item != json.end(); ++item, ++index)
      make_distinct(*item, pointer + "/" + (json.is_object() ? item.key() : std::to_string(index)), count,
                    leaves);
  } else if (json.is_number_float()) {
    // A minus cylinder, and one that is written: below 0.125 D there is none.
    const bool is_cylinder = pointer.substr(pointer.rfind('/') + 1) == "cylinder_D";
    json = is_cylinder ? -0.2 - std::abs(json.get<double>()) - step() : json.get<double>() + step();
    // The sign of a direction in the visual field is told by a word.
    const bool is_direction =
        pointer.find("/peripheral/") != std::string::npos && pointer.find("_deg") != std::string::npos;
    leaves.push_back({pointer, is_direction ? std::abs(json.get<double>()) : json.get<double>()});
  }
}

/// A number as a page shows it.
struct Written {
  double value = 0;
  int decimals = 0;
  bool is_ratio = false;  ///< "2.0e-04"
};

std::vector<Written> written_numbers(const std::string& text) {
  std::vector<Written> numbers;
  const std::regex number("[-+]?[0-9]+(\\.[0-9]+)?(e-[0-9]+)?");
  for (auto found = std::sregex_iterator(text.begin(), text.end(), number); found != std::sregex_iterator();
       ++found)
    numbers.push_back({std::stod(found->str()), std::max(0, static_cast<int>((*found)[1].length()) - 1),
                       (*found)[2].matched});
  return numbers;
}

/// Decimals that a number has at least: axes, near points, vertex distances, areas and volumes are written whole.
int least_decimals(const std::string& pointer) {
  const std::string key = pointer.substr(pointer.rfind('/') + 1);
  if (key == "axis_deg" || key.rfind("near_point", 0) == 0 || key.rfind("vertex_distance", 0) == 0) return 0;
  if (key == "area_mm2" || key == "volume_mm3") return 0;
  return key.find("_D") != std::string::npos ? 2 : 1;
}

bool is_written(const std::vector<Written>& numbers, const Leaf& leaf) {
  const int least = least_decimals(leaf.pointer);
  return std::any_of(numbers.begin(), numbers.end(), [&](const Written& number) {
    if (number.is_ratio) return std::abs(number.value / leaf.value - 1) < 0.06;
    return number.decimals >= least &&
           std::abs(number.value - leaf.value) <= 0.5001 * std::pow(10.0, -number.decimals);
  });
}

TEST_F(NumbersTest, OfEachResultFileStandOnThePage) {
  test::make_fixture_case(folder_);
  std::vector<Leaf> leaves;
  int count = 0;
  for (const char* eye : {"od", "os"})
    for (const auto& [stage, file] :
         {std::pair{"meshing", "biometry.json"}, std::pair{"raytrace", "wavefront.json"},
          std::pair{"correction", "prescription.json"}}) {
      const fs::path path = folder_ / stage / eye / file;
      Json json = read_json(path);
      if (json.contains("retina")) json["retina"].erase("map");  // is a picture
      make_distinct(json, "", count, leaves);
      write_json(path, json);
    }
  ASSERT_GT(leaves.size(), 300U);
  report();
  const auto written = written_numbers(visible_text(output("report.html")));
  for (const auto& leaf : leaves) EXPECT_TRUE(is_written(written, leaf)) << leaf.pointer << " " << leaf.value;
}

TEST_F(NumbersTest, FollowTheJsonAndNotAStoredText) {
  test::make_fixture_case(folder_);
  const fs::path file = folder_ / "correction" / "od" / "prescription.json";
  Json prescription = read_json(file);
  prescription["rounded"]["sphere_D"] = -7.5;
  write_json(file, prescription);
  report();
  EXPECT_THAT(visible_text(output("report.html")), HasSubstr("-7.50 / -1.00 x 175"));
  EXPECT_THAT(dump("prescription.dcm"), HasSubstr("[-7.5000]"));
  EXPECT_THAT(output("prescription.fhir.json"), HasSubstr("\"sphere\": -7.5"));
  EXPECT_THAT(output("prescription.fhir.json"), HasSubstr("Spherical equivalent +-"));
}

/// In the PDF too; without an axis where the cylinder may be none, and not at all where there is no prescription.
TEST_F(NumbersTest, TheFirstPageHasCylinderAndAxisWithTheirIntervals) {
  test::make_fixture_case(folder_);
  const fs::path file = folder_ / "correction/od/prescription.json";
  Json prescription = read_json(file);
  prescription["cylinder_D"] = Measured{-2.53, {-3.39, -1.67}, "mri"};
  prescription["axis_deg"] = Measured{1.8, {-4.5, 8.2}, "mri"};
  write_json(file, prescription);
  report();
  const std::string right = "-2.5 D (-3.4 to -1.7), axis 2\u00b0 \u00b1 6\u00b0";
  for (const std::string& text : {visible_text(output("report.html")), pdf_text()}) {
    EXPECT_THAT(text, HasSubstr(right));
    EXPECT_THAT(text, HasSubstr("-0.4 D (-1.0 to +0.2), axis not"));  // of the left eye
  }
  prescription["withheld"] = "The interval does not support a prescription.";
  prescription["M_D"]["ci95"] = {-2.87 - 3.2, -2.87 + 3.2};
  write_json(file, prescription);
  report();
  for (const std::string& text : {visible_text(output("report.html")), pdf_text()})
    EXPECT_THAT(text, testing::Not(HasSubstr(right)));
}

/// How the refraction was made is where it is told.
TEST_F(NumbersTest, TheConditionsOfTheRefractionAreTold) {
  test::make_fixture_case(folder_);
  const auto set = [&](double vertex_mm, const Json& fovea_mm) {
    for (const char* eye : {"od", "os"}) {
      const fs::path file = folder_ / "correction" / eye / "prescription.json";
      Json prescription = read_json(file);
      prescription["vertex_distance_mm"] = vertex_mm;
      prescription["fovea_mm"] = fovea_mm;
      prescription["wavelength_nm"] = 555;
      write_json(file, prescription);
    }
    report();
  };
  set(12.5, {0, 0});
  EXPECT_THAT(visible_text(output("report.html")), HasSubstr("vertex distance 12.5 mm"));
  EXPECT_THAT(visible_text(output("report.html")), HasSubstr("own axis. The fovea"));
  EXPECT_THAT(visible_text(output("report.html")), HasSubstr("in light of 555 nm"));
  EXPECT_THAT(output("prescription.fhir.json"), HasSubstr("Vertex distance 12.5 mm, on the eye's own axis."));
  EXPECT_THAT(output("prescription.fhir.json"), HasSubstr("\"code\": \"lens\""));
  EXPECT_THAT(output("prescription.fhir.json"), HasSubstr("In light of 555 nm."));
  EXPECT_THAT(output("prescription.dcm"),
              HasSubstr("vertex distance 12.5 mm, on the eye's own axis. In light of 555 nm. Sphere:"));
  set(0, {-1.5, 0});
  EXPECT_THAT(visible_text(output("report.html")), HasSubstr("at (-1.5, 0) mm from the pole"));
  EXPECT_THAT(visible_text(output("report.html")), testing::Not(HasSubstr("own axis")));
  EXPECT_THAT(output("prescription.fhir.json"), HasSubstr("\"code\": \"contact\""));
  const Json lens = Json::parse(output("prescription.fhir.json")).at("lensSpecification").at(0);
  EXPECT_TRUE(lens.contains("power"));  // FHIR's sphere is a spectacle lens's
  EXPECT_FALSE(lens.contains("sphere"));
  EXPECT_FALSE(fs::exists(folder_ / "report" / "prescription.dcm"));
}

/// No range of adults stands beside a child's numbers, and none is called unusual by it.
TEST_F(NumbersTest, OfAChildAreComparedWithChildrens) {
  test::make_fixture_case(folder_);
  const auto page_at = [&](const Json& age_years) {
    Json case_json = read_json(folder_ / "case.json");
    case_json["subject"]["age_years"] = age_years;
    write_json(folder_ / "case.json", case_json);
    report();
    return visible_text(output("report.html"));
  };
  const std::string of_adult = page_at(30), of_child = page_at(8), of_infant = page_at(2.5);
  EXPECT_THAT(of_adult, HasSubstr("Normal adult"));
  EXPECT_THAT(of_child, HasSubstr("Normal at 8 years"));
  EXPECT_THAT(of_child, HasSubstr("21.23 to 24.47"));
  EXPECT_THAT(of_child, HasSubstr("Tideman JWL"));
  EXPECT_THAT(of_infant, HasSubstr("Normal at 2 years"));
  for (const std::string& page : {of_child, of_infant}) {
    EXPECT_THAT(page, testing::Not(HasSubstr("Normal adult")));
    EXPECT_THAT(page, testing::Not(HasSubstr("adult range")));
    EXPECT_THAT(page, testing::Not(HasSubstr("Hoffmann PC")));
  }
}

TEST_F(NumbersTest, AnEstimateIsOneInEveryForm) {
  test::make_fixture_case(folder_);
  const fs::path file = folder_ / "correction/od/prescription.json";
  Json prescription = read_json(file);
  prescription["M_D"]["ci95"] = {-2.87 - 2.1, -2.87 + 2.1};
  for (const bool is_said : {true, false}) {  // by the correction stage, or of an earlier one
    if (is_said)
      prescription["estimate"] = "An estimate, do not dispense.";
    else
      prescription.erase("estimate");
    write_json(file, prescription);
    report();
    for (const std::string& text :
         {visible_text(output("report.html")), output("prescription.fhir.json"), output("prescription.dcm")})
      EXPECT_THAT(text, HasSubstr("do not dispense")) << is_said;
    EXPECT_THAT(
        read_json(folder_ / "report/stage.json").at("answer").at("eyes").at("od").at("reasons").dump(),
        HasSubstr("do not dispense"));
  }
}

/// Who takes a lens out of an object finds first, beside it, why it is not to be taken as it is.
TEST_F(NumbersTest, DoubtsStandBesideTheLensTheyAreOf) {
  test::make_fixture_case(folder_);
  const fs::path file = folder_ / "correction/od/prescription.json",
                 fit = folder_ / "segmentation/od/fit.json";
  Json prescription = read_json(file), fitted = read_json(fit);
  prescription["M_D"]["ci95"] = {-2.87 - 2.1, -2.87 + 2.1};
  prescription["estimate"] = "An estimate, do not dispense.";
  write_json(file, prescription);
  fitted["quality"].push_back({{"name", "converged"},
                               {"passed", false},
                               {"withholds", "nothing"},
                               {"reason", "the fit has not converged"}});
  write_json(fit, fitted);
  report();
  const Json lenses = Json::parse(output("prescription.fhir.json")).at("lensSpecification");
  EXPECT_THAT(lenses.at(0).at("note").at(0).at("text").get<std::string>(),
              testing::AllOf(testing::StartsWith("An estimate, do not dispense."),
                             HasSubstr("the fit has not converged.")));
  const std::string elements = dump("prescription.dcm");
  const std::size_t right = elements.find("Right Eye Rx"),
                    said = elements.find("An estimate, do not dispense.");
  EXPECT_LT(right, said);
  EXPECT_LT(said, elements.find("[Sphere]"));
  EXPECT_THAT(elements, HasSubstr("the fit has not converged."));
}

TEST_F(NumbersTest, ARefractionWithoutAnIntervalIsAnEstimateInEveryForm) {
  test::make_fixture_case(folder_);
  const fs::path file = folder_ / "correction/od/prescription.json";
  Json prescription = read_json(file);
  prescription["M_D"] = -2.87;
  for (const bool is_said :
       {false, true}) {  // of an earlier correction stage, or that there is nothing to say
    if (is_said) prescription["estimate"] = nullptr;
    write_json(file, prescription);
    report();
    const std::string page = visible_text(output("report.html"));
    EXPECT_THAT(page, HasSubstr("Estimate: refract before dispensing"));
    for (const std::string& text : {page, output("prescription.fhir.json"), output("prescription.dcm")})
      EXPECT_THAT(text, HasSubstr("interval is unknown: an estimate, do not dispense")) << is_said;
  }
}

/// "[12]" of the text is the twelfth in the list.
TEST_F(NumbersTest, ACitationNamesTheWorkThatIsMeant) {
  test::make_fixture_case(folder_);
  report();
  const std::string page = visible_text(output("report.html"));
  const auto expect_cited = [&](const std::string& before, const std::string& authors) {
    std::smatch found;
    ASSERT_TRUE(std::regex_search(page, found, std::regex(before + R"re( \[(\d+)\])re"))) << before;
    EXPECT_THAT(page, HasSubstr(found[1].str() + ". " + authors));
  };
  expect_cited("retina through them", "Wei Q,");
  expect_cited("as power vectors", "Thibos LN,");
  expect_cited("Wavefronts follow", "ANSI Z80.28");
  expect_cited("the lens index", "Dubbelman M, van der Heijde GL. The shape of the aging human lens");
  if (!find_program("gnuplot")) GTEST_SKIP() << "gnuplot is not installed: no chart of the MTF";
  expect_cited("healthy corrected eyes", "Watson AB.");
}

/// Numbers in brackets on the page, and those of the list of references.
std::pair<std::set<int>, std::set<int>> cited_and_listed(const std::string& page) {
  const auto numbers_of = [&](const std::string& text, const std::string& pattern) {
    std::set<int> numbers;
    const std::regex number(pattern);
    for (auto found = std::sregex_iterator(text.begin(), text.end(), number); found != std::sregex_iterator();
         ++found)
      numbers.insert(std::stoi((*found)[1]));
    return numbers;
  };
  const std::size_t list = page.find("<ul class=\"small\">");
  return {numbers_of(visible_text(page), R"re(\[(\d+)\])re"),
          numbers_of(page.substr(list, page.find("</ul>", list) - list), R"re(<li>(\d+)\. )re")};
}

/// Of a report with numbers and of one without.
TEST_F(NumbersTest, TheListHoldsWhatIsCitedAndNothingElse) {
  for (const bool is_refused : {false, true}) {
    fs::remove_all(folder_);
    test::FixtureOptions options;
    options.refused = is_refused;
    test::make_fixture_case(folder_, options);
    report();
    const auto [cited, listed] = cited_and_listed(output("report.html"));
    EXPECT_EQ(cited, listed);
    if (is_refused) {  // no light was traced and no lens sought: nothing is claimed to have been done
      EXPECT_TRUE(cited.empty());
      EXPECT_THAT(visible_text(output("report.html")), Not(HasSubstr("image sharpest")));
      continue;
    }
    EXPECT_GE(cited.size(), 4U);
    EXPECT_EQ(*listed.rbegin(), static_cast<int>(listed.size()));  // from 1, without gaps
  }
}

/// A picture that was seen through a spectacle is not called one without a lens.
TEST(WornWhileTraced, IsWhatTheTraceStageSays) {
  CaseData data;
  data.stages = {{"raytrace", ExitStatus::done, {}, {}, {}}};
  Json& parameters = data.stages[0].provenance["parameters"];
  parameters = {{"spectacle", nullptr}, {"plano_cylinder", nullptr}};
  EXPECT_EQ(worn_while_traced(data), "");
  parameters["spectacle"] = {{"power", {{"M_D", -2.75}, {"J0_D", 0.5}, {"J45_D", 0.0}}},
                             {"vertex_distance_mm", 12.0},
                             {"prism", {{"dioptres", 0.0}, {"base_deg", 0.0}}}};
  EXPECT_EQ(worn_while_traced(data), "a spectacle of -2.25 / -1.00 x 180 at 12 mm");
  parameters["spectacle"]["prism"] = {{"dioptres", 3.0}, {"base_deg", 90.0}};
  EXPECT_EQ(worn_while_traced(data),
            "a spectacle of -2.25 / -1.00 x 180 at 12 mm with 3 prism dioptres, base at 90 degrees");
  EXPECT_EQ(worn_while_traced(CaseData{}), "");
}

/// A table says by which criterion its refractions are, where it is not this report's.
TEST_F(NumbersTest, RefractionsOfTheLeastSpotAreCalledThat) {
  test::make_fixture_case(folder_);
  report();
  const std::string html = output("report.html");
  EXPECT_THAT(html, HasSubstr("<caption>The refraction of least spot at other pupils (iris apertures)"));
  EXPECT_THAT(html, HasSubstr("<caption>Refraction of least spot away from the axis, OD (right)"));
  EXPECT_THAT(html, HasSubstr("M of each direction less M of the centre, both of the least spot"));
  EXPECT_THAT(html, HasSubstr("Left over (least spot), M"));
}

/// A lens implant takes the lens's place: its power does not share the refraction's interval.
TEST_F(NumbersTest, AnImplantsPowerHasItsOwnInterval) {
  test::make_fixture_case(folder_);
  report();
  const auto rows = table_rows(output("report.html"));
  const std::string interval = "+15.41 to +20.65";
  EXPECT_THAT(rows, have_row({"SRK/T", "+18.03 D", interval, "+18.03 D", interval}));
  EXPECT_THAT(rows, have_row({"A constant", "118.4", "", "118.4", ""}));
  EXPECT_THAT(visible_text(output("report.html")), HasSubstr("but for the intraocular lens"));
}

TEST_F(NumbersTest, WhatIsNoPlanForSurgerySaysSoBeforeItsNumbers) {
  test::make_fixture_case(folder_);
  report();
  const std::string html = output("report.html");
  const std::size_t section = html.find("<section id=\"lenses\"");
  ASSERT_NE(section, std::string::npos);
  const std::size_t caveat = html.find("Nothing here is a plan for surgery", section);
  EXPECT_LT(caveat, html.find("<table", section));
  EXPECT_LT(html.find("Where the result above is an estimate, nothing here is to be ordered.", section),
            html.find("<table", section));
  // In the PDF tables stand alone.
  for (const char* table : {"Intraocular lens for a target refraction", "Laser ablation for this refraction"})
    EXPECT_THAT(html, HasSubstr(std::string("<caption>") + table + ", for information, no plan for surgery"));
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

/// How many measured numbers a document holds, but for the Zernike coefficients, which are of the whole
/// surface.
std::size_t measured_numbers(const Json& json) {
  if (!json.is_structured()) return 0;
  if (json.is_object() && json.contains("ci95")) return 1;
  std::size_t count = 0;
  for (auto item = json.begin(); item != json.end(); ++item)
    if (!json.is_object() || item.key() != "cornea_zernike_um") count += measured_numbers(*item);
  return count;
}

TEST_F(NumbersTest, BiometryObjectHoldsEveryNumberWithItsInterval) {
  test::make_fixture_case(folder_);
  report();
  const auto numbers =
      numbers_of(output_of("/usr/bin/dsrdump", {(folder_ / "report" / "biometry.dcm").string()}));
  const std::map<std::string, std::string> units{{"mm", "mm"},        {"D", "[diop]"},   {"deg", "deg"},
                                                 {"axis", "deg"},     {"\u00b5m", "um"}, {"mm\u00b2", "mm2"},
                                                 {"mm\u00b3", "mm3"}, {"", "1"}};
  constexpr double half_digit = 0.5e-4 + 1e-9;
  for (const char* eye : {"od", "os"}) {
    const Json biometry = json_of("meshing", eye, "biometry.json");
    std::size_t count = 0;
    for (const auto* rows : measured_rows())
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
    EXPECT_EQ(count, measured_numbers(biometry));  // none of the file is left out
  }
}

}  // namespace
}  // namespace emmetrope::report
