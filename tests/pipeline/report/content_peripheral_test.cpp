#include <cmath>
#include <regex>

#include "pipeline/base/frames.hpp"
#include "pipeline/base/power_vector.hpp"
#include "pipeline/report/document/numbers.hpp"
#include "pipeline/report/figures/peripheral_map.hpp"
#include "tests/pipeline/report/report_fixture.hpp"

// The map of peripheral refraction on the page against prescription.json.

namespace emmetrope::report {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr int across = 5;  ///< of the fixture's grid
constexpr double step_deg = 10, reach_deg = 20;

/// A cell as it is drawn: its middle, its number, and the line from end to end.
struct DrawnCell {
  double x = 0, y = 0, side = 0;
  std::string number;
  double line_x = 0, line_y = 0;  ///< to the right, downwards
};

std::vector<DrawnCell> cells_in(const std::string& figure) {
  const std::regex cell(
      R"re(<rect class="cell" x="([-0-9.]+)" y="([-0-9.]+)" width="([-0-9.]+)"[^>]*/>(<text[^>]*>([^<]*)</text>)?<path class="cylinder" d="M([-0-9.]+) ([-0-9.]+)L([-0-9.]+) ([-0-9.]+)")re");
  std::vector<DrawnCell> cells;
  for (std::sregex_iterator found(figure.begin(), figure.end(), cell); found != std::sregex_iterator();
       ++found) {
    const auto number = [&](int group) { return std::stod((*found)[group]); };
    cells.push_back({number(1) + number(3) / 2, number(2) + number(3) / 2, number(3), (*found)[5],
                     number(8) - number(6), number(9) - number(7)});
  }
  return cells;
}

/// Of the outermost cells' middles.
struct Edges {
  double left = 1e9, right = 0, top = 1e9, bottom = 0;
};

Edges edges_of(const std::vector<DrawnCell>& cells) {
  Edges edges;
  for (const DrawnCell& cell : cells) {
    edges.left = std::min(edges.left, cell.x);
    edges.right = std::max(edges.right, cell.x);
    edges.top = std::min(edges.top, cell.y);
    edges.bottom = std::max(edges.bottom, cell.y);
  }
  return edges;
}

class PeripheralMap : public ReportTest {
 protected:
  fs::path prescription_file(const std::string& eye) const {
    return folder_ / "correction" / eye / "prescription.json";
  }
  Json field_of(const std::string& eye) const { return read_json(prescription_file(eye)).at("peripheral"); }
  /// Its markup on the page; empty where there is none.
  std::string figure(const std::string& eye) const {
    const std::string html = output("report.html");
    const std::size_t at = html.find("<figure id=\"peripheral-" + eye + "\">");
    return at == std::string::npos ? "" : html.substr(at, html.find("</figure>", at) - at);
  }
};

double centre_sphere_D(const Json& field) {
  for (const Json& point : field)
    if (point.at("horizontal_deg") == 0.0 && point.at("vertical_deg") == 0.0) return point.at("M_D");
  return std::nan("");
}

// The patient's left is on the left and up is at the top; each number is M there less M at the centre.
TEST_F(PeripheralMap, CellsAreTheDirectionsOfThePrescription) {
  test::make_fixture_case(folder_);
  report();
  for (const char* eye : {"od", "os"}) {
    const Json field = field_of(eye);
    const std::vector<DrawnCell> cells = cells_in(figure(eye));
    ASSERT_EQ(cells.size(), field.size()) << eye;
    const Edges edges = edges_of(cells);
    for (std::size_t i = 0; i < cells.size(); ++i) {
      const double horizontal_deg =
                       reach_deg * (1 - 2 * (cells[i].x - edges.left) / (edges.right - edges.left)),
                   vertical_deg = reach_deg * (1 - 2 * (cells[i].y - edges.top) / (edges.bottom - edges.top));
      EXPECT_NEAR(horizontal_deg, field[i].at("horizontal_deg").get<double>(), 0.01 * step_deg);
      EXPECT_NEAR(vertical_deg, field[i].at("vertical_deg").get<double>(), 0.01 * step_deg);
      EXPECT_EQ(cells[i].number, signed_fixed(field[i].at("M_D").get<double>() - centre_sphere_D(field), 2));
    }
  }
}

// Nasal and temporal change sides with the eye, the patient's left does not.
TEST_F(PeripheralMap, NamesTheSidesOfTheField) {
  test::make_fixture_case(folder_);
  report();
  const auto is_on_the_left = [&](const char* eye, const char* side) {
    const std::string svg = figure(eye);
    const std::size_t word = svg.find(side), tag = svg.rfind("<text", word);
    return svg.substr(tag, word - tag).find("text-anchor=\"start\"") != std::string::npos;
  };
  EXPECT_TRUE(is_on_the_left("od", "nasal field"));
  EXPECT_FALSE(is_on_the_left("od", "temporal field"));
  EXPECT_TRUE(is_on_the_left("os", "temporal field"));
  EXPECT_FALSE(is_on_the_left("os", "nasal field"));
  EXPECT_THAT(visible_text(output("report.html")), HasSubstr("left on the left"));
  // The right eye's temporal field is on the patient's right: 0.0009 * 400 - 0.013 * 20 D there.
  EXPECT_THAT(figure("od"), HasSubstr("temporal +0.10 D, nasal +0.62 D, superior +0.36 D, inferior +0.36 D"));
  EXPECT_THAT(figure("os"), HasSubstr("temporal +0.62 D, nasal +0.10 D"));
}

// In the table too, where a sign would be the patient's left.
TEST_F(PeripheralMap, TheTableNamesTheSidesOfTheField) {
  test::make_fixture_case(folder_);
  report();
  const std::string html = output("report.html");
  for (const auto& [eye, name, of_the_left, of_the_right] :
       {std::tuple{"od", "OD (right)", "nasal", "temporal"},
        std::tuple{"os", "OS (left)", "temporal", "nasal"}}) {
    const std::size_t start =
        html.find(std::string("<caption>Refraction of least spot away from the axis, ") + name);
    ASSERT_NE(start, std::string::npos);
    const std::string table = html.substr(start, html.find("</table>", start) - start);
    const auto row_of = [&](const std::string& direction) {
      const std::size_t at = table.find(">" + direction + "<");
      return at == std::string::npos ? "" : table.substr(at, table.find("</tr>", at) - at);
    };
    for (const Json& point : field_of(eye)) {
      const double leftwards_deg = point.at("horizontal_deg"), up_deg = point.at("vertical_deg");
      std::string direction;
      if (leftwards_deg != 0)
        direction =
            fixed(std::abs(leftwards_deg), 1) + "\u00b0 " + (leftwards_deg > 0 ? of_the_left : of_the_right);
      if (up_deg != 0)
        direction += (direction.empty() ? "" : ", ") + fixed(std::abs(up_deg), 1) + "\u00b0 " +
                     (up_deg > 0 ? "superior" : "inferior");
      EXPECT_THAT(row_of(direction.empty() ? "on the axis" : direction),
                  HasSubstr(">" + signed_fixed(point.at("M_D").get<double>(), 2) + " D<"))
          << eye << " " << direction;
    }
  }
}

// The line's length is the cylinder, on one scale with the key; its direction is the minus cylinder's axis,
// counted by the examiner from his right, which is the left of the map.
TEST_F(PeripheralMap, LinesAreTheMinusCylinders) {
  test::make_fixture_case(folder_);
  report();
  const Json field = field_of("od");
  const std::string svg = figure("od");
  std::smatch key;
  ASSERT_TRUE(std::regex_search(svg, key, std::regex("h([0-9.]+)\" stroke=\"currentColor\"")));
  const double px_per_D = std::stod(key[1]);
  const std::vector<DrawnCell> cells = cells_in(svg);
  ASSERT_EQ(cells.size(), field.size());
  constexpr double written_px = 0.03;  // two decimals of two ends
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const SpheroCylinder power =
        to_sphero_cylinder({field[i].at("M_D").get<double>(), field[i].at("J0_D").get<double>(),
                            field[i].at("J45_D").get<double>()});
    const double length_px = -power.cylinder_D * px_per_D, axis = power.axis_deg * degree;
    EXPECT_NEAR(std::hypot(cells[i].line_x, cells[i].line_y), length_px, written_px);
    EXPECT_NEAR(cells[i].line_x * std::sin(axis) - cells[i].line_y * std::cos(axis), 0, written_px)
        << power.axis_deg;
  }
}

TEST_F(PeripheralMap, WhatTheRetinaDoesNotSeeIsBlank) {
  test::make_fixture_case(folder_);
  report();
  EXPECT_EQ(cells_in(figure("od")).size(), std::size_t{across} * across);
  EXPECT_THAT(figure("od"), Not(HasSubstr("Blank:")));
  EXPECT_THAT(figure("os"), HasSubstr("Blank: 1 of 25 directions"));
  const std::vector<DrawnCell> cells = cells_in(figure("os"));
  EXPECT_EQ(cells.size(), std::size_t{across} * across - 1);
  const Edges edges = edges_of(cells);
  for (const DrawnCell& cell : cells)
    EXPECT_FALSE(cell.x < edges.left + 1 && cell.y > edges.bottom - 1) << "the lower left one is drawn";
}

TEST_F(PeripheralMap, BothEyesShareOneScaleAboutZero) {
  test::make_fixture_case(folder_);
  Json prescription = read_json(prescription_file("os"));
  prescription["peripheral"][0]["M_D"] = centre_sphere_D(prescription["peripheral"]) - 3.2;
  write_json(prescription_file("os"), prescription);
  report();
  for (const char* eye : {"od", "os"}) {
    for (const char* end : {">+4 D<", ">0 D<", ">-4 D<"}) EXPECT_THAT(figure(eye), HasSubstr(end)) << eye;
    EXPECT_THAT(figure(eye), HasSubstr("role=\"img\" aria-label=\"Map of the refraction of O"));
  }
}

TEST_F(PeripheralMap, AnEyeWithoutDirectionsOrTheirCentreHasNone) {
  test::make_fixture_case(folder_);
  Json right = read_json(prescription_file("od")), left = read_json(prescription_file("os"));
  right.erase("peripheral");
  write_json(prescription_file("od"), right);
  report();
  EXPECT_EQ(figure("od"), "");
  EXPECT_NE(figure("os"), "");
  left["peripheral"].erase(across * across / 2);
  write_json(prescription_file("os"), left);
  report();
  EXPECT_EQ(figure("os"), "");
  EXPECT_THAT(visible_text(output("report.html")),
              HasSubstr("Refraction of least spot away from the axis, OS (left)"));
}

// Its four pages are full of what stands in every report: here the wavefront's charts are missing.
TEST_F(PeripheralMap, StandsInThePdfWhereThereIsRoom) {
  test::make_fixture_case(folder_);
  for (const char* eye : {"od", "os"}) fs::remove(folder_ / "raytrace" / eye / "wavefront.json");
  report();
  const std::string pdf = pdf_text();
  for (const char* text : {"OD, relative peripheral refraction", "OS, relative peripheral refraction",
                           "+0.62", "temporal field", "cylinder of 1 D"})
    EXPECT_THAT(pdf, HasSubstr(text));
}

TEST(FieldMap, IsOfAGridAboutTheAxisAlone) {
  const std::vector<FieldDirection> row{{-5, 0, {-1, 0, 0}}, {0, 0, {-2, 0, 0}}, {5, 0, {-2.5, 0, 0}}};
  const auto map = make_field_map(row);
  ASSERT_TRUE(map);
  EXPECT_EQ(map->rings, 1);
  EXPECT_EQ(map->unseen(), 6);
  EXPECT_EQ(map->relative_sphere_D(-5, 0), 1.0);
  EXPECT_FALSE(map->relative_sphere_D(0, 5));
  EXPECT_FALSE(make_field_map({}));
  EXPECT_FALSE(make_field_map({row[1]}));
  EXPECT_FALSE(make_field_map({row[0], row[2]}));
  EXPECT_FALSE(make_field_map({row[0], row[1], {7, 0, {}}}));
}

}  // namespace
}  // namespace emmetrope::report
