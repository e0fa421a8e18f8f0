#include <fmt/format.h>

#include "pipeline/report/chart.hpp"
#include "pipeline/report/content.hpp"
#include "pipeline/report/judgement.hpp"
#include "pipeline/report/numbers.hpp"

namespace emmetrope::report {
namespace {

std::string short_name(const EyeData& eye) { return eye.laterality == Laterality::od ? "OD" : "OS"; }

/// "radius_mm" -> "radius (mm)"
std::string axis_label(const std::string& key) {
  std::string label;
  for (const char c : key)
    if (std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_') label += c == '_' ? ' ' : c;
  for (const char* unit : {" mm", " D", " deg", " nm"}) {
    const std::string end = unit;
    if (label.size() > end.size() && label.compare(label.size() - end.size(), end.size(), end) == 0)
      return label.substr(0, label.size() - end.size()) + " (" + end.substr(1) + ")";
  }
  return label;
}

bool sharpness_chart(Figure& figure, const Sweep& sweep, std::optional<double> optimum_x) {
  std::string script = "$sweep << EOD\n";
  for (const auto& row : sweep.rows) script += fmt::format("{:.6g} {:.6g}\n", row[0], row[1]);
  script += fmt::format("EOD\nset xlabel '{}'\nset ylabel '{}'\nunset key\n", axis_label(sweep.names[0]),
                        axis_label(sweep.names[1]));
  if (optimum_x)
    script += fmt::format(
        "set arrow from {0:.6g}, graph 0 to {0:.6g}, graph 1 nohead dt 2 lc rgb '{1}'\n"
        "set label 'optimum' at {0:.6g}, graph 0.06 offset 0.5 textcolor rgb '{1}'\n",
        *optimum_x, second_colour);
  script += fmt::format("plot $sweep using 1:2 with linespoints pt 7 ps 0.4 lw 2 lc rgb '{}'\n", first_colour);
  return draw_chart(figure, script);
}

/// M, J0, J45 by every criterion, side by side.
Table criteria_table(const EyeData& eye) {
  Table table{"The same eye by other criteria, " + std::string(clinical_name(eye.laterality)),
              {"Criterion", "M", "J0", "J45"},
              {}};
  const NumberStyle style{2, true, "D"};
  const auto add = [&](const std::string& name, const Json& power) {
    const auto M = value_of(power, "M_D"), J0 = value_of(power, "J0_D"), J45 = value_of(power, "J45_D");
    if (M && J0 && J45) table.rows.push_back({name, format(*M, style), format(*J0, style), format(*J45, style)});
  };
  add("Image sharpness (the prescription)", eye.prescription);
  const Json check = eye.prescription.value("wavefront_check", Json::object());
  for (const auto& [key, name] : {std::pair{"paraxial", "Paraxial: wavefront curvature at the centre"},
                                  std::pair{"minimum_rms_wavefront", "Least wavefront error over the pupil"},
                                  std::pair{"minimum_rms_spot", "Least spot over the pupil"},
                                  std::pair{"visual_strehl", "Best visual Strehl ratio"}})
    if (check.is_object() && check.contains(key)) add(name, check[key]);
  return table;
}

/// Standard deviations by source, the largest first as it is written.
Table budget_table(const EyeData& eye) {
  Table table{"Where the uncertainty comes from (1 standard deviation), " + std::string(clinical_name(eye.laterality)),
              {"Source", "M", "J0", "J45"},
              {}};
  const Json budget = eye.prescription.value("budget", Json::array());
  if (!budget.is_array()) return table;
  const NumberStyle style{2, false, "D"};
  for (const auto& line : budget) {
    if (!line.is_object()) continue;
    const auto M = value_of(line, "M_D"), J0 = value_of(line, "J0_D"), J45 = value_of(line, "J45_D");
    table.rows.push_back({line.value("source", "other"), M ? format(*M, style) : "", J0 ? format(*J0, style) : "",
                          J45 ? format(*J45, style) : ""});
  }
  return table;
}

Table cylinder_table(const EyeData& eye) {
  Table table{"Best plano-cylinder, " + std::string(clinical_name(eye.laterality)), {"Quantity", "Value"}, {}};
  const Json lens = eye.prescription.value("plano_cylinder", Json());
  if (!lens.is_object()) return table;
  for (const auto& [key, name, style] :
       {std::tuple{"radius_mm", "Radius of the back surface", NumberStyle{1, true, "mm"}},
        std::tuple{"axis_deg", "Axis (meridian without power)", NumberStyle{0, false, "deg"}},
        std::tuple{"index", "Refractive index", NumberStyle{3, false, ""}},
        std::tuple{"vertex_distance_mm", "In front of the cornea", NumberStyle{0, false, "mm"}},
        std::tuple{"sharpness", "Sharpness reached", NumberStyle{4, false, ""}}})
    if (const auto value = value_of(lens, key)) table.rows.push_back({name, format(*value, style)});
  return table;
}

}  // namespace

Section correction_section(const CaseData& data, Notes& notes) {
  Section section{"correction", "How the lens was found", {}, false};
  FigureRow charts;
  for (const auto& eye : data.eyes) {
    if (!judge(data, eye).has_prescription) continue;
    for (const Table& table : {criteria_table(eye), budget_table(eye)})
      if (!table.rows.empty()) section.blocks.push_back({table});
    if (const Table table = cylinder_table(eye); !table.rows.empty()) section.blocks.push_back({table, false});
    if (!eye.sweep || eye.sweep->names.size() < 2) continue;
    Figure figure;
    figure.id = "sharpness-" + eye.id();
    figure.title = short_name(eye) + ", sharpness of the retinal image";
    figure.caption = "A single peak at the line is a lens well found; a flat top says that the image hardly cares.";
    figure.alt = "Sharpness of the retinal image against the lens, with its optimum";
    figure.width_px = 480;
    figure.height_px = 280;
    const Json cylinder = eye.prescription.value("plano_cylinder", Json::object());
    const auto optimum = value_of(cylinder, eye.sweep->names[0]);
    if (sharpness_chart(figure, *eye.sweep, optimum))
      charts.figures.push_back(figure);
    else
      notes.push_back(short_name(eye) + ": the sharpness curve is missing, because gnuplot is not installed or failed.");
  }
  if (!charts.figures.empty()) section.blocks.push_back({charts});
  return section;
}

}  // namespace emmetrope::report
