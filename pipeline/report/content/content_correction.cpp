#include <fmt/format.h>

#include "pipeline/base/ends_with.hpp"
#include "pipeline/report/content/content.hpp"
#include "pipeline/report/content/content_tables.hpp"
#include "pipeline/report/content/judgement.hpp"
#include "pipeline/report/figures/chart.hpp"

namespace emmetrope::report {
namespace {

/// Columns of the sweep that are measures of sharpness: those without a unit.
std::vector<std::size_t> measures_of(const Sweep& sweep) {
  std::vector<std::size_t> columns;
  for (std::size_t i = 1; i < sweep.names.size(); ++i)
    if (!ends_with(sweep.names[i], "_mm") && !ends_with(sweep.names[i], "_D") &&
        !ends_with(sweep.names[i], "_deg"))
      columns.push_back(i);
  return columns;
}

/// Letters and spaces only: it stands in a gnuplot script.
std::string words(const std::string& key) {
  std::string text;
  for (const char c : key)
    if (std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_') text += c == '_' ? ' ' : c;
  return text;
}

Figure sharpness_figure(const EyeData& eye) {
  Figure figure;
  figure.id = "sharpness-" + eye.id();
  figure.title = short_name(eye) + ", sharpness with a plano-cylinder";
  figure.alt = "Sharpness of the retinal image against the radius of a plano-cylinder, with the optimum";
  figure.width_px = 400;
  figure.height_px = 240;
  const Sweep& sweep = *eye.sweep;
  const auto measures = measures_of(sweep);
  if (measures.empty()) return {};
  std::string script = "$sweep << EOD\n";
  std::vector<double> peak(sweep.names.size(), 1e-300);
  for (const auto& row : sweep.rows)
    for (const std::size_t i : measures) peak[i] = std::max(peak[i], row[i]);
  bool is_positive = true;
  for (const auto& row : sweep.rows) {
    is_positive = is_positive && row[0] > 0;
    script += fmt::format("{:.6g}", row[0]);
    for (const std::size_t i : measures) script += fmt::format(" {:.5f}", row[i] / peak[i]);
    script += "\n";
  }
  const bool is_radius = ends_with(sweep.names[0], "_mm");
  script += fmt::format(
      "EOD\nset xlabel '{}'\nset ylabel 'Sharpness, relative'\nset key above samplen 2 width -3\n",
      is_radius ? "Radius of the back surface (mm)" : words(sweep.names[0]));
  script += "set yrange [0:1.05]\n";
  if (is_positive) script += "set logscale x\nset xtics (20, 50, 100, 200, 500)\n";
  if (const auto optimum = value_of(eye.prescription.value("plano_cylinder", Json::object()), sweep.names[0]))
    script += fmt::format("set arrow from {0:.6g}, graph 0 to {0:.6g}, graph 1 nohead dt 2 lc rgb '{1}'\n",
                          *optimum, second_colour);
  const std::array<const char*, 3> colours{first_colour, third_colour, quiet_colour};
  script += "plot ";
  for (std::size_t i = 0; i < measures.size(); ++i)
    script +=
        fmt::format("{}$sweep using 1:{} with lines lw 2 dt {} lc rgb '{}' title '{}'", i == 0 ? "" : ", ",
                    i + 2, i + 1, colours[i % colours.size()], words(sweep.names[measures[i]]));
  return draw_chart(figure, script + "\n") ? figure : Figure();
}

Table criteria_table(const Eyes& eyes) {
  PowerTable table("The refraction by several criteria", "Criterion", eyes, {2, true, "D"});
  std::vector<Json> prescriptions;
  for (const auto* eye : eyes) prescriptions.push_back(eye->prescription);
  table.add("Image sharpness (this report's)", prescriptions);
  for (const auto& [key, name] : {std::pair{"paraxial", "Paraxial (curvature at the centre)"},
                                  std::pair{"minimum_rms_wavefront", "Least wavefront error"},
                                  std::pair{"minimum_rms_spot", "Least spot"},
                                  std::pair{"visual_strehl", "Best visual Strehl ratio"}}) {
    std::vector<Json> powers;
    for (const auto* eye : eyes) {
      const Json check = eye->prescription.value("wavefront_check", Json::object());
      powers.push_back(check.is_object() ? check.value(key, Json()) : Json());
    }
    table.add(name, powers);
  }
  return table.table();
}

/// Lists of {name, M_D, J0_D, J45_D}, joined by name in the order of their first appearance.
Table joined_table(const Eyes& eyes, const char* list_key, const char* name_key, const std::string& caption,
                   const std::string& first) {
  PowerTable table(caption, first, eyes, {2, false, "D"});
  std::vector<std::string> names;
  std::map<std::string, std::vector<Json>> powers;
  for (std::size_t i = 0; i < eyes.size(); ++i) {
    const Json list = eyes[i]->prescription.value(list_key, Json::array());
    if (!list.is_array()) continue;
    for (const auto& line : list) {
      std::string name = line.value(name_key, std::string("other"));
      // The covariances' part of the variance may be negative; its root keeps the sign.
      if (name == "correlations") name += " (with a minus sign it lessens the total)";
      auto& entry = powers[name];
      if (entry.empty()) {
        names.push_back(name);
        entry.resize(eyes.size());
      }
      entry[i] = line;
    }
  }
  for (const auto& name : names) table.add(name, powers[name]);
  return table.table();
}

}  // namespace

Section correction_section(const CaseData& data, Notes& notes) {
  Section section{"correction", "How the lens was found", {}};
  Eyes eyes;
  for (const auto& eye : data.eyes)
    if (judge(data, eye).has_refraction) eyes.push_back(&eye);
  if (eyes.empty()) return section;
  for (const Table& table :
       {criteria_table(eyes),
        joined_table(eyes, "budget", "source",
                     "Where the uncertainty comes from (1 standard deviation; the squares add up to the "
                     "square of the total)",
                     "Source"),
        joined_table(eyes, "if_measured", "measurement",
                     "What a measurement would leave (1 standard deviation)", "If this were known")})
    if (!table.rows.empty()) section.blocks.push_back({table});
  if (const Table table = eye_table("Sharpness of the retinal image", eyes, &EyeData::prescription,
                                    {{"/sharpness/without_lens", "Without a lens", {4, false, ""}},
                                     {"/sharpness/with_lens", "With the best lens", {4, false, ""}}});
      !table.rows.empty())
    section.blocks.push_back({table, Paper::never});
  FigureRow charts;
  charts.caption =
      "Each measure against its own maximum. A single peak at the line is a lens well found; a flat top says "
      "that the image hardly cares. A line beyond the curve is an optimum outside the radii that were swept.";
  for (const auto* eye : eyes) {
    const Json difference = eye->prescription.value("difference", Json::object());
    if (difference.is_object() && difference.contains("text"))
      section.blocks.push_back(
          {Paragraph{short_name(*eye) + ": " + with_symbols(difference.value("text", std::string()))},
           Paper::never});
    if (!eye->sweep) continue;
    const Figure figure = sharpness_figure(*eye);
    if (figure.svg.empty())
      notes.push_back(short_name(*eye) +
                      ": the sharpness curve is missing, because gnuplot is not installed or failed.");
    else
      charts.figures.push_back(figure);
  }
  if (!charts.figures.empty()) section.blocks.push_back({charts, Paper::if_room});
  return section;
}

}  // namespace emmetrope::report
