#include "pipeline/report/figures/peripheral_map.hpp"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>

#include "pipeline/base/frames.hpp"
#include "pipeline/report/document/numbers.hpp"

namespace emmetrope::report {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int figure_width_px = 400, figure_height_px = 376;
constexpr double left_px = 36, top_px = 22, field_px = 294, bottom_px = top_px + field_px;
constexpr double bar_left_px = 342, bar_width_px = 12;
constexpr double least_number_px = 8;                   ///< smaller ones nobody reads
constexpr double line_width = 0.9, line_height = 0.52;  ///< room for a line below the number, of a cell

/// Red and blue stay apart for the colour-blind; the corneal elevation has the same.
struct ColourStop {
  double at;  ///< -1 to 1
  Vector3d rgb;
};
const std::array<ColourStop, 5>& colour_stops() {
  static const std::array<ColourStop, 5> all{{{-1, {33, 102, 172}},
                                              {-0.25, {146, 197, 222}},
                                              {0, {247, 247, 247}},
                                              {0.25, {244, 165, 130}},
                                              {1, {178, 24, 43}}}};
  return all;
}

Vector3d colour_at(double share) {
  share = std::clamp(share, -1.0, 1.0);
  auto above = colour_stops().begin() + 1;
  while (above->at < share) ++above;
  const ColourStop& below = *(above - 1);
  return below.rgb + (share - below.at) / (above->at - below.at) * (above->rgb - below.rgb);
}

std::string hex_of(const Vector3d& rgb) {
  return fmt::format("#{:02x}{:02x}{:02x}", std::lround(rgb.x()), std::lround(rgb.y()), std::lround(rgb.z()));
}

/// Black or white, whichever has more contrast (WCAG's relative luminance; 0.179 is where they are equal).
const char* ink_on(const Vector3d& rgb) {
  const auto linear = [](double byte) {
    const double c = byte / 255;
    return c <= 0.03928 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4);
  };
  const double luminance = 0.2126 * linear(rgb.x()) + 0.7152 * linear(rgb.y()) + 0.0722 * linear(rgb.z());
  return luminance > 0.179 ? "#000" : "#fff";
}

/// The minus cylinder's power along its axis, to the right and downwards. Axes are the examiner's: seen from
/// behind the eye they are mirrored.
Vector2d cylinder_on_map_D(const PowerVector& power) {
  const double axis = 0.5 * std::atan2(power.J45_D, power.J0_D);
  return 2 * std::hypot(power.J0_D, power.J45_D) * Vector2d(std::cos(axis), std::sin(axis));
}

std::string map_label(double x, double y, const char* anchor, const std::string& text) {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\">{}</text>", x, y, anchor, text);
}

/// Where a map's cells lie.
class FieldCells {
 public:
  explicit FieldCells(const FieldMap& map) : map_(map) {}
  double side() const { return field_px / (2 * map_.rings + 1); }
  double number_size() const { return std::min(13.0, side() / 3.8); }
  double line_px_per_D(const FieldScale& scale) const { return scale.line_per_D * side(); }
  /// The corner at the upper left. The patient's left, where angles are positive, is on the left.
  Vector2d corner(double horizontal_deg, double vertical_deg) const {
    return Vector2d(left_px, top_px) + side() * Vector2d(map_.rings - horizontal_deg / map_.step_deg,
                                                         map_.rings - vertical_deg / map_.step_deg);
  }

 private:
  const FieldMap& map_;
};

std::string cylinder_line(const PowerVector& power, const Vector2d& middle, double px_per_D,
                          const char* ink) {
  const Vector2d half = 0.5 * px_per_D * cylinder_on_map_D(power);
  return fmt::format(
      "<path class=\"cylinder\" d=\"M{:.2f} {:.2f}L{:.2f} {:.2f}\" stroke=\"{}\" stroke-width=\"2\"/>",
      middle.x() - half.x(), middle.y() - half.y(), middle.x() + half.x(), middle.y() + half.y(), ink);
}

std::string field_cell(const FieldCells& cells, const FieldDirection& direction, double relative_D,
                       const FieldScale& scale) {
  const Vector2d corner = cells.corner(direction.horizontal_deg, direction.vertical_deg);
  const Vector3d colour = colour_at(relative_D / scale.relative_M_D);
  const char* ink = ink_on(colour);
  std::string svg = fmt::format(
      "<rect class=\"cell\" x=\"{:.2f}\" y=\"{:.2f}\" width=\"{:.2f}\" height=\"{:.2f}\" fill=\"{}\"/>",
      corner.x(), corner.y(), cells.side() - 1, cells.side() - 1, hex_of(colour));
  const double size = cells.number_size();
  if (size >= least_number_px)
    svg += fmt::format(
        "<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"middle\" font-size=\"{:.1f}\" fill=\"{}\">{}</text>",
        corner.x() + cells.side() / 2, corner.y() + 0.31 * cells.side(), size, ink,
        signed_fixed(relative_D, 2));
  return svg + cylinder_line(direction.refraction, corner + cells.side() * Vector2d(0.49, 0.67),
                             cells.line_px_per_D(scale), ink);
}

/// Degrees along two sides, and what lies where.
std::string field_frame(const FieldMap& map, const FieldCells& cells, Laterality eye) {
  const double middle_px = left_px + field_px / 2;
  std::string svg;
  for (int ring = -map.rings; ring <= map.rings; ++ring) {
    const double angle_deg = ring * map.step_deg;
    const Vector2d corner = cells.corner(angle_deg, angle_deg);
    const std::string text = fmt::format("{:g}\u00b0", std::abs(angle_deg));
    svg += map_label(corner.x() + cells.side() / 2, bottom_px + 14, "middle", text) +
           map_label(left_px - 4, corner.y() + cells.side() / 2 + 4, "end", text);
  }
  const bool is_right = eye == Laterality::od;
  return svg + map_label(middle_px, top_px - 8, "middle", "superior field") +
         map_label(middle_px, bottom_px + 31, "middle", "inferior field") +
         map_label(left_px, bottom_px + 31, "start", is_right ? "nasal field" : "temporal field") +
         map_label(left_px + field_px, bottom_px + 31, "end", is_right ? "temporal field" : "nasal field") +
         fmt::format("<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"#8a8a8a\"/>",
                     left_px - 1, top_px - 1, field_px + 1, field_px + 1);
}

std::string colour_bar(const std::string& id, const FieldScale& scale) {
  std::string svg = fmt::format("<linearGradient id=\"{}-colours\" x1=\"0\" y1=\"1\" x2=\"0\" y2=\"0\">", id);
  for (const ColourStop& stop : colour_stops())
    svg += fmt::format("<stop offset=\"{:g}\" stop-color=\"{}\"/>", (stop.at + 1) / 2, hex_of(stop.rgb));
  svg += fmt::format(
      "</linearGradient><rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"url(#{}-colours)\" "
      "stroke=\"#8a8a8a\"/>",
      bar_left_px, top_px, bar_width_px, field_px, id);
  for (const double share : {-1.0, -0.5, 0.0, 0.5, 1.0})
    svg += map_label(bar_left_px + bar_width_px + 4, top_px + field_px * (1 - share) / 2 + 4 + 3 * share,
                     "start", fmt::format(share == 0 ? "{:g} D" : "{:+g} D", share * scale.relative_M_D));
  return svg + map_label(figure_width_px, top_px - 9, "end", "hyperopic") +
         map_label(figure_width_px, bottom_px + 17, "end", "myopic");
}

std::string cylinder_key(double px_per_D) {
  return fmt::format("<path d=\"M{} {}h{:.2f}\" stroke=\"currentColor\" stroke-width=\"2\"/>", left_px,
                     figure_height_px - 10, px_per_D) +
         map_label(left_px + px_per_D + 8, figure_height_px - 6, "start",
                   "cylinder of 1 D, along its minus axis");
}

/// The least distance between two different coordinates.
double least_step_deg(const std::vector<FieldDirection>& directions) {
  std::vector<double> angles_deg;
  for (const FieldDirection& direction : directions)
    angles_deg.insert(angles_deg.end(), {direction.horizontal_deg, direction.vertical_deg});
  std::sort(angles_deg.begin(), angles_deg.end());
  constexpr double same_deg = 1e-6;
  double step_deg = 0;
  for (std::size_t i = 1; i < angles_deg.size(); ++i)
    if (const double gap = angles_deg[i] - angles_deg[i - 1]; gap > same_deg)
      step_deg = step_deg > 0 ? std::min(step_deg, gap) : gap;
  return step_deg;
}

}  // namespace

int FieldMap::unseen() const {
  return (2 * rings + 1) * (2 * rings + 1) - static_cast<int>(directions.size());
}

std::optional<double> FieldMap::relative_sphere_D(double horizontal_deg, double vertical_deg) const {
  for (const FieldDirection& direction : directions)
    if (std::hypot(direction.horizontal_deg - horizontal_deg, direction.vertical_deg - vertical_deg) <
        step_deg / 2)
      return direction.refraction.M_D - centre.M_D;
  return std::nullopt;
}

std::optional<FieldMap> make_field_map(std::vector<FieldDirection> directions) {
  constexpr int most_rings = 20;
  constexpr double off_grid = 0.01;  // of a step
  FieldMap map;
  map.step_deg = least_step_deg(directions);
  if (!(map.step_deg > 0)) return std::nullopt;
  const FieldDirection* centre = nullptr;
  for (const FieldDirection& direction : directions) {
    const Vector2d steps = Vector2d(direction.horizontal_deg, direction.vertical_deg) / map.step_deg;
    const Vector2d whole = steps.array().round();
    if ((steps - whole).norm() > off_grid || whole.cwiseAbs().maxCoeff() > most_rings) return std::nullopt;
    map.rings = std::max(map.rings, static_cast<int>(whole.cwiseAbs().maxCoeff()));
    if (whole.isZero()) centre = &direction;
  }
  if (centre == nullptr) return std::nullopt;
  map.centre = centre->refraction;
  map.directions = std::move(directions);
  return map;
}

FieldScale common_scale(const std::vector<FieldMap>& maps) {
  FieldScale scale;
  for (const FieldMap& map : maps)
    for (const FieldDirection& direction : map.directions) {
      scale.relative_M_D =
          std::max(scale.relative_M_D, std::ceil(std::abs(direction.refraction.M_D - map.centre.M_D)));
      const Vector2d line_D = cylinder_on_map_D(direction.refraction).cwiseAbs();
      scale.line_per_D = std::min({scale.line_per_D, line_width / line_D.x(), line_height / line_D.y()});
    }
  return scale;
}

Figure draw_peripheral_map(const std::string& id, const FieldMap& map, const FieldScale& scale,
                           Laterality eye) {
  const FieldCells cells(map);
  Figure figure;
  figure.id = id;
  figure.width_px = figure_width_px;
  figure.height_px = figure_height_px;
  figure.svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {}\"><g font-family=\"DejaVu Sans\" "
      "font-size=\"11\" fill=\"currentColor\" stroke-linecap=\"round\">",
      figure_width_px, figure_height_px);
  for (const FieldDirection& direction : map.directions)
    figure.svg += field_cell(cells, direction, direction.refraction.M_D - map.centre.M_D, scale);
  figure.svg += field_frame(map, cells, eye) + colour_bar(id, scale) +
                cylinder_key(cells.line_px_per_D(scale)) + "</g></svg>";
  return figure;
}

}  // namespace emmetrope::report
