#include "correction/prescription/sweep.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>
#include <vector>

#include "pipeline/base/notation.hpp"

namespace emmetrope::correction {
namespace {

struct Curve {
  const char* name;
  const char* colour;
  const char* dashes;
};
/// In the order of all_criteria; distinguishable without colour.
constexpr std::array<Curve, all_criteria.size()> curves{{{"gradient energy", "#1f5fa8", "none"},
                                                         {"variance of Laplacian", "#b4561f", "6 3"},
                                                         {"MTF-weighted", "#3a7d44", "2 3"}}};

constexpr double width = 640, height = 400, left = 64, right = 20, top = 36, bottom = 56;

std::string text(double x, double y, const std::string& anchor, const std::string& what) {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\">{}</text>\n", x, y, anchor, what);
}
std::string line(double x1, double y1, double x2, double y2, const std::string& style) {
  return fmt::format("<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" {}/>\n", x1, y1, x2, y2,
                     style);
}

/// 10, 20, 50, 100, ... within a range; for a short one 30, 70, 150, ... too.
std::vector<double> ticks_mm(double first_mm, double last_mm) {
  std::vector<double> ticks;
  for (double decade_mm = 1; decade_mm < last_mm; decade_mm *= 10)
    for (const double times : {1.0, 1.5, 2.0, 3.0, 5.0, 7.0}) {
      const double tick_mm = times * decade_mm;
      const bool round = times == 1.0 || times == 2.0 || times == 5.0;
      if (tick_mm >= 0.999 * first_mm && tick_mm <= 1.001 * last_mm && (round || last_mm < 20 * first_mm))
        ticks.push_back(tick_mm);
    }
  return ticks;
}

/// How the search's second derivative says that sharpness falls beside the optimum, until a third is lost:
/// radius and sharpness over its peak. A parabola of ln(sharpness) in the lens's power, as it is blur that
/// counts.
std::vector<std::pair<double, double>> osculating_curve(const PlanoCylinderResult& result) {
  const double radius_mm = result.lens.radius_mm, power_D = result.lens.power_D;
  const double per_D2 = result.radius_curvature_per_mm2 * std::pow(radius_mm / power_D, 2);
  const double reach_D = std::sqrt(-0.8 / per_D2);
  constexpr int steps = 24;
  std::vector<std::pair<double, double>> points;
  for (int i = -steps; i <= steps; ++i) {
    const double off_D = reach_D * i / steps;
    const double at_mm = radius_mm * power_D / (power_D + off_D);
    if (at_mm * radius_mm > 0) points.emplace_back(at_mm, std::exp(per_D2 / 2 * off_D * off_D));
  }
  return points;
}

/// Places in the picture.
struct Axes {
  double first_mm = 0, last_mm = 0;
  double x(double radius_mm) const {
    return left +
           std::log(std::abs(radius_mm) / first_mm) / std::log(last_mm / first_mm) * (width - left - right);
  }
  static double y(double relative) { return height - bottom - relative * (height - top - bottom); }
  bool hold(double radius_mm) const {
    return std::abs(radius_mm) >= first_mm && std::abs(radius_mm) <= last_mm;
  }
};

/// The optimum with its number and its curvature, where the sweep holds it.
/// \param most  the sweep's best by criterion k
std::string optimum_mark(const PlanoCylinderResult& result, std::size_t k, double most, const Axes& axes) {
  const double best_mm = result.lens.radius_mm;
  const auto of_best = std::find_if(result.sweep.begin(), result.sweep.end(), [&](const SweepRow& row) {
    return std::abs(row.radius_mm - best_mm) < 1e-9 * std::abs(best_mm);
  });
  if (!result.search.accepted || of_best == result.sweep.end()) return {};
  const double x = axes.x(best_mm), peak = of_best->sharpness[k] / most;
  std::string svg = line(x, axes.y(0), x, axes.y(1), "stroke=\"#222222\" stroke-dasharray=\"4 4\"");
  svg += "<polyline fill=\"none\" stroke=\"#222222\" stroke-width=\"1\" points=\"";
  for (const auto& [radius_mm, relative] : osculating_curve(result))
    if (axes.hold(radius_mm))
      svg += fmt::format("{:.1f},{:.1f} ", axes.x(radius_mm), axes.y(peak * relative));
  svg += "\"/>\n";
  // On the side that the curves leave free.
  const bool on_right = x > width / 2;
  const double beside = on_right ? left + 10 : width - right - 10;
  const char* anchor = on_right ? "start" : "end";
  const std::string axis =
      result.axis_from == AxisFrom::convention ? ", any axis" : " x " + format_axis(result.lens.axis_deg);
  return svg +
         text(beside, axes.y(0.92), anchor,
              fmt::format("{:.1f} mm ({:+.2f} D){}", best_mm, result.lens.power_D, axis)) +
         text(
             beside, axes.y(0.86), anchor,
             fmt::format("thin black: ln(sharpness) curves by {:.2g} /mm²", result.radius_curvature_per_mm2));
}

}  // namespace

std::string sweep_csv(const PlanoCylinderResult& result) {
  std::string csv = "radius_mm,power_D,gradient_energy,laplacian_variance,mtf_weighted\n";
  for (const SweepRow& row : result.sweep)
    csv += fmt::format("{:.4f},{:.5f},{:.7f},{:.7f},{:.7f}\n", row.radius_mm, row.power_D, row.sharpness[0],
                       row.sharpness[1], row.sharpness[2]);
  return csv;
}

std::string sweep_svg(const PlanoCylinderResult& result, SharpnessCriterion criterion) {
  const Axes axes{std::abs(result.sweep.front().radius_mm), std::abs(result.sweep.back().radius_mm)};
  // Each criterion against its own best: they have no common unit.
  std::array<double, all_criteria.size()> most{};
  for (const SweepRow& row : result.sweep)
    for (std::size_t k = 0; k < most.size(); ++k) most[k] = std::max(most[k], row.sharpness[k]);

  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0:.0f} {1:.0f}\" width=\"{0:.0f}\" "
      "height=\"{1:.0f}\" font-family=\"DejaVu Sans, sans-serif\" font-size=\"12\" role=\"img\" "
      "aria-label=\"Image sharpness against the radius of the plano-cylinder\">\n<rect width=\"100%\" "
      "height=\"100%\" fill=\"white\"/>\n",
      width, height);
  const std::string grid = "stroke=\"#dddddd\"", frame = "stroke=\"#444444\"";
  const bool minus = result.lens.power_D < 0;
  for (const double radius_mm : ticks_mm(axes.first_mm, axes.last_mm)) {
    svg += line(axes.x(radius_mm), axes.y(0), axes.x(radius_mm), axes.y(1), grid);
    svg += text(axes.x(radius_mm), axes.y(0) + 16, "middle",
                fmt::format("{}{:.0f}", minus ? "" : "-", radius_mm));
  }
  for (const double relative : {0.0, 0.25, 0.5, 0.75, 1.0}) {
    svg += line(left, axes.y(relative), width - right, axes.y(relative), relative == 0 ? frame : grid);
    svg += text(left - 6, axes.y(relative) + 4, "end", fmt::format("{:.2f}", relative));
  }
  svg += line(left, axes.y(0), left, axes.y(1), frame);
  for (std::size_t k = 0; k < curves.size(); ++k) {
    const std::string style =
        fmt::format("fill=\"none\" stroke=\"{}\" stroke-width=\"2\" stroke-dasharray=\"{}\"",
                    curves[k].colour, curves[k].dashes);
    svg += "<polyline " + style + " points=\"";
    for (const SweepRow& row : result.sweep)
      svg += fmt::format("{:.1f},{:.1f} ", axes.x(row.radius_mm), axes.y(row.sharpness[k] / most[k]));
    svg += "\"/>\n";
    const double x = left + 14 + 180 * static_cast<double>(k);
    svg += line(x, top - 16, x + 26, top - 16, style) + text(x + 32, top - 12, "start", curves[k].name);
  }
  const auto k = static_cast<std::size_t>(criterion);
  svg += optimum_mark(result, k, most[k], axes);
  svg +=
      text((left + width - right) / 2, height - 16, "middle", "radius of the cylinder's back surface (mm)");
  svg += fmt::format(
      "<text transform=\"translate(16 {:.0f}) rotate(-90)\" text-anchor=\"middle\">sharpness, relative to "
      "its best</text>\n",
      (axes.y(0) + axes.y(1)) / 2);
  return svg + "</svg>\n";
}

}  // namespace emmetrope::correction
