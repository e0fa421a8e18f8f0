#include "correction/sweep.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>
#include <vector>

namespace emmetrope::correction {
namespace {

struct Curve {
  const char* name;
  const char* colour;
  const char* dashes;
};
/// In the order of all_measures; distinguishable without colour.
constexpr std::array<Curve, all_measures.size()> curves{{{"gradient energy", "#1f5fa8", "none"},
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

/// ln(sharpness) as the search's derivatives say it bends at the optimum: a parabola, until a third is lost.
std::vector<std::pair<double, double>> osculating_curve(const PlanoCylinderResult& result, double peak) {
  std::vector<std::pair<double, double>> points;
  const double reach_mm = std::sqrt(-0.8 / result.radius_curvature_per_mm2);
  constexpr int steps = 24;
  for (int i = -steps; i <= steps; ++i) {
    const double off_mm = reach_mm * i / steps;
    points.emplace_back(result.lens.radius_mm + off_mm,
                        peak * std::exp(result.radius_curvature_per_mm2 / 2 * off_mm * off_mm));
  }
  return points;
}

}  // namespace

std::string sweep_csv(const PlanoCylinderResult& result) {
  std::string csv = "radius_mm,power_D,gradient_energy,laplacian_variance,mtf_weighted\n";
  for (const SweepRow& row : result.sweep)
    csv += fmt::format("{:.4f},{:.5f},{:.7f},{:.7f},{:.7f}\n", row.radius_mm, row.power_D, row.sharpness[0],
                       row.sharpness[1], row.sharpness[2]);
  return csv;
}

std::string sweep_svg(const PlanoCylinderResult& result, Measure criterion) {
  const double first = std::log10(std::abs(result.sweep.front().radius_mm));
  const double last = std::log10(std::abs(result.sweep.back().radius_mm));
  const auto x_of = [&](double radius_mm) {
    return left + (std::log10(std::abs(radius_mm)) - first) / (last - first) * (width - left - right);
  };
  // Each measure against its own best: they have no common unit.
  std::array<double, all_measures.size()> most{};
  for (const SweepRow& row : result.sweep)
    for (std::size_t k = 0; k < most.size(); ++k) most[k] = std::max(most[k], row.sharpness[k]);
  const auto y_of = [&](double relative) { return height - bottom - relative * (height - top - bottom); };

  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0:.0f} {1:.0f}\" width=\"{0:.0f}\" "
      "height=\"{1:.0f}\" "
      "font-family=\"DejaVu Sans, sans-serif\" font-size=\"12\" role=\"img\" aria-label=\"Image sharpness "
      "against the "
      "radius of the plano-cylinder\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n",
      width, height);
  const std::string grid = "stroke=\"#dddddd\"", frame = "stroke=\"#444444\"";
  const bool minus = result.lens.power_D < 0;
  for (const double radius_mm : ticks_mm(std::pow(10, first), std::pow(10, last))) {
    svg += line(x_of(radius_mm), y_of(0), x_of(radius_mm), y_of(1), grid);
    svg +=
        text(x_of(radius_mm), y_of(0) + 16, "middle", fmt::format("{}{:.0f}", minus ? "" : "-", radius_mm));
  }
  for (const double relative : {0.0, 0.25, 0.5, 0.75, 1.0}) {
    svg += line(left, y_of(relative), width - right, y_of(relative), relative == 0 ? frame : grid);
    svg += text(left - 6, y_of(relative) + 4, "end", fmt::format("{:.2f}", relative));
  }
  svg += line(left, y_of(0), left, y_of(1), frame);
  for (std::size_t k = 0; k < curves.size(); ++k) {
    const std::string style =
        fmt::format("fill=\"none\" stroke=\"{}\" stroke-width=\"2\" stroke-dasharray=\"{}\"",
                    curves[k].colour, curves[k].dashes);
    svg += "<polyline " + style + " points=\"";
    for (const SweepRow& row : result.sweep)
      svg += fmt::format("{:.1f},{:.1f} ", x_of(row.radius_mm), y_of(row.sharpness[k] / most[k]));
    svg += "\"/>\n";
    const double x = left + 14 + 180 * static_cast<double>(k);
    svg += line(x, top - 16, x + 26, top - 16, style) + text(x + 32, top - 12, "start", curves[k].name);
  }
  const double best_mm = std::abs(result.lens.radius_mm);
  if (std::log10(best_mm) >= first && std::log10(best_mm) <= last && result.radius_curvature_per_mm2 < 0) {
    svg +=
        line(x_of(best_mm), y_of(0), x_of(best_mm), y_of(1), "stroke=\"#222222\" stroke-dasharray=\"4 4\"");
    const auto of_best = std::find_if(result.sweep.begin(), result.sweep.end(), [&](const SweepRow& row) {
      return std::abs(std::abs(row.radius_mm) - best_mm) < 1e-9 * best_mm;
    });
    const auto k = static_cast<std::size_t>(criterion);
    if (of_best != result.sweep.end()) {
      svg += "<polyline fill=\"none\" stroke=\"#222222\" stroke-width=\"1\" points=\"";
      for (const auto& [radius_mm, relative] : osculating_curve(result, of_best->sharpness[k] / most[k]))
        if (const double log = std::log10(std::abs(radius_mm)); log >= first && log <= last)
          svg += fmt::format("{:.1f},{:.1f} ", x_of(radius_mm), y_of(relative));
      svg += "\"/>\n";
    }
    const bool on_right = x_of(best_mm) > width / 2;
    const double x = x_of(best_mm) + (on_right ? -6 : 6);
    const char* anchor = on_right ? "end" : "start";
    svg += text(x, y_of(0.11), anchor,
                result.axis_matters ? fmt::format("{:.1f} mm ({:+.2f} D) x {:.0f}", result.lens.radius_mm,
                                                  result.lens.power_D, result.lens.axis_deg)
                                    : fmt::format("{:.1f} mm ({:+.2f} D), any axis", result.lens.radius_mm,
                                                  result.lens.power_D));
    svg += text(
        x, y_of(0.05), anchor,
        fmt::format("thin black: curvature {:.2g} /mm² of ln(sharpness)", result.radius_curvature_per_mm2));
  }
  svg +=
      text((left + width - right) / 2, height - 16, "middle", "radius of the cylinder's back surface (mm)");
  svg += fmt::format(
      "<text transform=\"translate(16 {:.0f}) rotate(-90)\" text-anchor=\"middle\">sharpness, relative to "
      "its best</text>\n",
      (y_of(0) + y_of(1)) / 2);
  return svg + "</svg>\n";
}

}  // namespace emmetrope::correction
