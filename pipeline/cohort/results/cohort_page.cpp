#include "pipeline/cohort/results/cohort_page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <numeric>
#include <set>
#include <utility>

#include "pipeline/base/files.hpp"
#include "pipeline/base/version.hpp"
#include "pipeline/cohort/results/quantities.hpp"
#include "pipeline/cohort/subjects/stage_end.hpp"
#include "pipeline/eye/population/limits.hpp"
#include "pipeline/report/content/biometry_rows.hpp"
#include "pipeline/report/document/document.hpp"
#include "pipeline/report/document/numbers.hpp"
#include "pipeline/report/figures/chart.hpp"
#include "pipeline/report/figures/picture_figure.hpp"
#include "pipeline/report/page/html.hpp"

namespace emmetrope::cohort {
namespace {

namespace fs = std::filesystem;
using report::Figure;
using report::FigureRow;
using report::Section;

using Numbers = std::vector<double>;

/// A number that tells of the eye, not of the population.
const Measured* measured_in(const EyeRow& row, const Quantity& quantity) {
  const auto found = row.numbers.find(quantity.column);
  return found == row.numbers.end() || found->second.source == "prior" ? nullptr : &found->second;
}

/// Of which the eyes of a person have one.
bool is_of_the_person(const Quantity& quantity) { return quantity.column == "interpupillary_distance"; }

/// The measured ones: an eye of whose quantity a prior alone tells is not among them.
std::vector<std::pair<const EyeRow*, const Measured*>> measured_of(const std::vector<EyeRow>& rows,
                                                                   const Quantity& quantity) {
  std::vector<std::pair<const EyeRow*, const Measured*>> found;
  std::set<std::string> persons;
  for (const EyeRow& row : rows)
    if (const Measured* measured = measured_in(row, quantity))
      if (!is_of_the_person(quantity) || persons.insert(row.subject).second)
        found.emplace_back(&row, measured);
  return found;
}

double quantile(Numbers sorted, double share) {
  std::sort(sorted.begin(), sorted.end());
  const double place = share * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<std::size_t>(place);
  const std::size_t above = std::min(below + 1, sorted.size() - 1);
  return sorted[below] + (place - static_cast<double>(below)) * (sorted[above] - sorted[below]);
}

Section outcomes_section(const std::vector<EyeRow>& rows) {
  const Outcomes outcomes = count_outcomes(rows);
  const auto share = [&](std::size_t count) {
    return fmt::format(
        "{} ({:.0f} %)", count,
        rows.empty() ? 0 : 100.0 * static_cast<double>(count) / static_cast<double>(rows.size()));
  };
  report::Table table;
  table.caption = "Eyes";
  table.header = {"Outcome", "Eyes", "What it means"};
  table.rows = {{"measured", share(outcomes.measured), "with a refraction"},
                {"in part", share(outcomes.partial), "some of the numbers, the others withheld"},
                {"no result", share(outcomes.no_result), "the images do not support any number"},
                {"failed", share(outcomes.failed), "the study could not be read, or the machine failed"}};
  Section section{"outcomes", "What came of the eyes", {{table}}};
  if (report::BulletList doubts{doubts_about(rows)}; !doubts.items.empty())
    section.blocks.push_back({doubts});
  return section;
}

/// What the finder or the fit saw of an eye; empty where there is no picture.
fs::path overlay_of(const CohortFolder& cohort, const EyeRow& row) {
  const fs::path folder = cohort.case_folder(row.subject) / "segmentation" / to_string(row.eye);
  std::vector<fs::path> pictures;
  if (!has_come_to_its_end(cohort, row.subject, "segment")) return {};
  std::error_code missing;
  for (const auto& entry : fs::directory_iterator(folder, missing))
    if (entry.path().filename().string().rfind("overlay", 0) == 0) pictures.push_back(entry.path());
  std::sort(pictures.begin(), pictures.end());
  return pictures.empty() ? fs::path() : pictures.front();
}

/// The most important one stands first.
std::string first_reason(const EyeRow& row) { return row.reason.substr(0, row.reason.find("; ")); }

Figure picture(const std::string& id, const fs::path& file, const EyeRow& row) {
  Figure figure = report::picture_figure(file, id);
  figure.title = row.subject + ", " + clinical_name(row.eye);
  figure.caption = first_reason(row);
  figure.alt = "Contours on the images of " + figure.title;
  return figure;
}

/// Without the numbers in it, so that eyes with the same reason stand together.
std::string kind_of(const std::string& reason) {
  std::string kind;
  for (const char c : reason) {
    const bool digit = (c >= '0' && c <= '9') || (c == '.' && !kind.empty() && kind.back() == '#');
    if (!digit)
      kind += c;
    else if (kind.empty() || kind.back() != '#')
      kind += '#';
  }
  return kind;
}

Section failures_section(const CohortFolder& cohort, const std::vector<EyeRow>& rows) {
  Section section{"failures", "Why eyes gave less", {}};
  std::map<std::string, std::vector<const EyeRow*>> by_reason;
  for (const EyeRow& row : rows)
    if (!row.stage.empty()) by_reason[row.stage + ": " + kind_of(first_reason(row))].push_back(&row);
  if (by_reason.empty()) return section;
  report::Table table;
  table.caption = "Reasons";
  table.header = {"Stage", "Eyes", "First reason", "Whose"};
  FigureRow pictures;
  pictures.caption = "One eye of each reason: look where its contours lie.";
  for (const auto& [kind, eyes] : by_reason) {
    constexpr std::size_t most_names = 8;
    std::string names;
    for (std::size_t i = 0; i < std::min(eyes.size(), most_names); ++i)
      names += fmt::format("{}{} {}", i == 0 ? "" : ", ", eyes[i]->subject, to_string(eyes[i]->eye));
    if (eyes.size() > most_names) names += fmt::format(" and {} more", eyes.size() - most_names);
    const EyeRow& first = *eyes.front();
    table.rows.push_back({first.stage, std::to_string(eyes.size()), first_reason(first), names});
    const auto shown = std::find_if(eyes.begin(), eyes.end(),
                                    [&](const EyeRow* row) { return !overlay_of(cohort, *row).empty(); });
    if (shown != eyes.end())
      pictures.figures.push_back(picture(fmt::format("reason-{}", pictures.figures.size() + 1),
                                         overlay_of(cohort, **shown), **shown));
  }
  section.blocks.push_back({table});
  if (!pictures.figures.empty()) section.blocks.push_back({pictures});
  return section;
}

/// Points as a block of gnuplot's.
std::string block(const std::vector<std::pair<double, double>>& points) {
  std::string text = "$points << EOD\n";
  for (const auto& [x, y] : points) text += fmt::format("{:.6g} {:.6g}\n", x, y);
  return text + "EOD\n";
}

std::optional<Figure> chart(const std::string& id, const std::string& title, const std::string& script) {
  Figure figure;
  figure.id = id;
  figure.title = title;
  figure.alt = title;
  figure.width_px = 420;
  figure.height_px = 300;
  return report::draw_chart(figure, script) ? std::optional(figure) : std::nullopt;
}

std::optional<Figure> histogram(const std::string& column, const std::string& key, const std::string& title,
                                const std::string& unit, const Numbers& values) {
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  const double bin = std::max((*high - *low) / 12, 1e-3 * std::max(1.0, std::abs(*high)));
  std::map<long, int> counts;
  for (const double value : values) ++counts[std::lround(std::floor((value - *low) / bin))];
  std::vector<std::pair<double, double>> bars;
  int most = 0;
  for (const auto& [place, count] : counts) most = std::max(most, count);
  for (const auto& [place, count] : counts)
    bars.emplace_back(*low + (static_cast<double>(place) + 0.5) * bin, count);
  std::string script =
      block(bars) + "set style fill solid 0.7\nset boxwidth " + fmt::format("{:.6g}", 0.95 * bin) +
      "\nset xlabel '" + (unit.empty() ? title : title + ", " + unit) +
      "'\nset ylabel 'eyes'\nset yrange [0:*]\n" + fmt::format("set ytics {}\n", (most + 4) / 5);
  if (const Limits* limits = find_limits(key); limits != nullptr && limits->normal.is_limited())
    for (const double end : {limits->normal.low, limits->normal.high})
      if (std::isfinite(end))
        script += fmt::format(
            "set arrow from {0:.6g}, graph 0 to {0:.6g}, graph 1 nohead dashtype 2 lc rgb '{1}'\n", end,
            report::quiet_colour);
  script += fmt::format("plot $points with boxes lc rgb '{}' notitle\n", report::first_colour);
  return chart("histogram-" + column, title, script);
}

std::optional<Figure> scatter(const std::string& id, const std::string& title, const std::string& x_label,
                              const std::string& y_label,
                              const std::vector<std::pair<double, double>>& points, bool with_diagonal) {
  if (points.size() < 2) return std::nullopt;
  std::string range;  // gnuplot would doubt an empty one on the terminal
  for (const auto& [axis, value] :
       {std::pair{"x", &std::pair<double, double>::first}, {"y", &std::pair<double, double>::second}}) {
    const double first = points.front().*value;
    if (std::all_of(points.begin(), points.end(),
                    [&, &value = value](const auto& p) { return p.*value == first; }))
      range += fmt::format("set {}range [{}:{}]\n", axis, first - 1, first + 1);
  }
  return chart(
      id, title,
      block(points) + range + "set xlabel '" + x_label + "'\nset ylabel '" + y_label + "'\nplot " +
          (with_diagonal ? fmt::format("x with lines dashtype 2 lc rgb '{}' notitle, ", report::quiet_colour)
                         : "") +
          fmt::format("$points with points pt 7 ps 0.6 lc rgb '{}' notitle\n", report::first_colour));
}

std::string id_of(std::string column) {
  std::replace(column.begin(), column.end(), '_', '-');
  return column;
}

/// A quantity's name and how it is written: as in the report, what that has not by its unit.
report::BiometryRow written(const Quantity& quantity) {
  const std::string key = quantity.key.substr(1);
  if (quantity.stage == "meshing")
    for (const auto* rows : report::measured_rows())
      for (const report::BiometryRow& row : *rows)
        if (row.key == key) return row;
  static const std::map<std::string, const char*> refraction{{"refraction_m", "Spherical equivalent"},
                                                             {"refraction_j0", "Refraction's J0"},
                                                             {"refraction_j45", "Refraction's J45"}};
  const auto named = refraction.find(quantity.column);
  return {key,
          named != refraction.end() ? named->second : quantity.description,
          {quantity.unit == "mm2" || quantity.unit == "mm3" ? 0 : 2,
           quantity.unit == "D" && quantity.stage != "meshing", quantity.unit}};
}

/// Where nine of ten of many values lie, or all of few.
std::string spread(const Numbers& values, const report::NumberStyle& style) {
  constexpr std::size_t many = 20;
  if (values.size() < 2) return "\u2013";
  const double tail = values.size() < many ? 0 : 0.05;
  return report::format(quantile(values, tail), style) + " to " +
         report::format(quantile(values, 1 - tail), style) + (tail > 0 ? "" : " (all)");
}

Section numbers_section(const std::vector<EyeRow>& rows) {
  Section section{"numbers", "Distributions", {}};
  report::Table table;
  const auto children = std::count_if(rows.begin(), rows.end(), [](const EyeRow& row) {
    return is_child(row.age_years) && !row.numbers.empty();
  });
  table.caption = "Numbers of the eyes, without those that a prior alone tells";
  if (children > 0)
    table.caption += fmt::format("; {} are of children, whose normal ranges are others", children);
  table.header = {
      "Quantity", "Eyes", "Median", "5 to 95 %, or all of few", "Normal adult", "Median half interval"};
  FigureRow charts;
  charts.caption = "Dashed: ends of the normal adult range, where there is one.";
  for (const Quantity& quantity : quantities()) {
    Numbers values, half;
    for (const auto& [row, measured] : measured_of(rows, quantity)) {
      values.push_back(measured->value);
      half.push_back((measured->ci95[1] - measured->ci95[0]) / 2);
    }
    if (values.empty() || quantity.unit == "deg") continue;  // an axis of 178 degrees is close to one of 2
    const std::string key = quantity.key.substr(1);
    const Limits* limits = quantity.stage == "meshing" ? find_limits(key) : nullptr;
    const bool has_normal = limits != nullptr && limits->normal.is_limited();
    const report::BiometryRow row = written(quantity);
    report::NumberStyle plain = row.style;
    plain.unit.clear();
    table.rows.push_back({row.style.unit.empty() ? row.name : row.name + ", " + row.style.unit,
                          std::to_string(values.size()), report::format(quantile(values, 0.5), plain),
                          spread(values, plain),
                          has_normal ? report::format_range(limits->normal, plain.decimals) : "\u2013",
                          fmt::format("{:.{}f}", quantile(half, 0.5), plain.decimals)});
    static const std::map<std::string, const char*> drawn{
        {"optical_axial_length", "Optical axial length"},
        {"refraction_m", "Spherical equivalent"},
        {"retina_q_240", "Retinal asphericity Q over 240 degrees"},
        {"vitreous_volume", "Vitreous volume"}};
    if (const auto title = drawn.find(quantity.column); title != drawn.end() && values.size() > 1)
      if (auto figure = histogram(id_of(quantity.column), key, title->second, quantity.unit, values))
        charts.figures.push_back(*figure);
  }
  if (table.rows.empty()) return section;
  section.blocks.push_back({table});
  if (!charts.figures.empty()) section.blocks.push_back({charts});
  return section;
}

Section relations_section(const std::vector<EyeRow>& rows) {
  Section section{"relations", "Left and right, age and refraction", {}};
  std::vector<std::pair<double, double>> sides, by_age, by_refraction;
  const std::string column = "optical_axial_length";
  for (const EyeRow& row : rows) {
    const auto length = row.numbers.find(column);
    if (length == row.numbers.end()) continue;
    if (row.age_years) by_age.emplace_back(*row.age_years, length->second.value);
    if (const auto m = row.numbers.find("refraction_m"); m != row.numbers.end())
      by_refraction.emplace_back(m->second.value, length->second.value);
  }
  for (const auto& [right, left] : fellow_eyes(rows))
    if (right->numbers.count(column) > 0 && left->numbers.count(column) > 0)
      sides.emplace_back(right->numbers.at(column).value, left->numbers.at(column).value);
  FigureRow charts;
  for (const auto& figure :
       {scatter("sides", "Left against right", "right eye, mm", "left eye, mm", sides, true),
        scatter("age", "Length against age", "age, years", "optical axial length, mm", by_age, false),
        scatter("refraction", "Length against refraction", "spherical equivalent, D",
                "optical axial length, mm", by_refraction, false)})
    if (figure) charts.figures.push_back(*figure);
  if (!charts.figures.empty()) section.blocks.push_back({charts});
  return section;
}

/// Where a page in `folder` finds the report of a subject, as a relative URL; empty where there is none.
std::string link_to_report(const CohortFolder& cohort, const std::string& subject, const fs::path& folder) {
  const fs::path report = cohort.case_folder(subject) / "report" / "report.html";
  return has_come_to_its_end(cohort, subject, "report") && fs::exists(report)
             ? report.lexically_relative(folder).generic_string()
             : "";
}

/// Robust standard deviation by the distances from the median (Iglewicz and Hoaglin 1993): by their median, or by their
/// mean where more than half of them are none.
double robust_sigma(const Numbers& away) {
  constexpr double sigma_of_median = 1.4826, sigma_of_mean = 1.2533;
  const double by_median = sigma_of_median * quantile(away, 0.5);
  if (by_median > 0) return by_median;
  return sigma_of_mean * std::accumulate(away.begin(), away.end(), 0.0) / static_cast<double>(away.size());
}

/// Eyes further than 3.5 robust standard deviations from the median.
Section outliers_section(const CohortFolder& cohort, const std::vector<EyeRow>& rows,
                         const fs::path& page_folder) {
  constexpr double far = 3.5;
  constexpr std::size_t fewest = 8;
  Section section{"outliers", "Eyes far from the others", {}};
  report::Table table;
  table.caption = "More than 3.5 robust standard deviations from the median: to be looked at";
  table.header = {"Eye", "Quantity", "Value", "Median"};
  for (const Quantity& quantity : quantities()) {
    const auto found = measured_of(rows, quantity);
    Numbers values;
    for (const auto& [row, measured] : found) values.push_back(measured->value);
    if (values.size() < fewest || quantity.unit == "deg") continue;
    const double median = quantile(values, 0.5);
    const report::BiometryRow written_as = written(quantity);
    Numbers away;
    for (const double value : values) away.push_back(std::abs(value - median));
    const double sigma = robust_sigma(away);
    if (!(sigma > 0)) continue;
    for (const auto& [row, measured] : found) {
      if (std::abs(measured->value - median) < far * sigma) continue;
      table.rows.push_back(
          {row->subject + (is_of_the_person(quantity) ? "" : std::string(" ") + to_string(row->eye)),
           written_as.name, report::format(measured->value, written_as.style),
           report::format(median, written_as.style)});
      table.links.push_back(link_to_report(cohort, row->subject, page_folder));
    }
  }
  if (!table.rows.empty()) section.blocks.push_back({table});
  return section;
}

}  // namespace

std::string cohort_page(const CohortFolder& cohort, const std::vector<EyeRow>& rows,
                        const fs::path& page_folder) {
  std::set<std::string> subjects;
  for (const EyeRow& row : rows) subjects.insert(row.subject);
  report::Document document;
  document.title = "Emmetrope cohort";
  document.heading = {{"Subjects", std::to_string(subjects.size())}, {"Software", "Emmetrope " + version()}};
  for (Section section : {outcomes_section(rows), failures_section(cohort, rows), numbers_section(rows),
                          relations_section(rows), outliers_section(cohort, rows, page_folder)})
    if (!section.blocks.empty()) document.sections.push_back(std::move(section));
  return report::render_html(document, {}, {});
}

}  // namespace emmetrope::cohort
