#include "pipeline/report/figures/retina_map.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "pipeline/base/frames.hpp"
#include "pipeline/report/figures/chart.hpp"

namespace emmetrope::report {
namespace {

using Rings = std::vector<std::vector<double>>;

constexpr int cells = 121;

/// Uniform Catmull-Rom through the two middle values.
double between(const std::array<double, 4>& p, double t) {
  return p[1] + t / 2 *
                    (p[2] - p[0] +
                     t * (2 * p[0] - 5 * p[1] + 4 * p[2] - p[3] + t * (3 * (p[1] - p[2]) + p[3] - p[0])));
}

/// The distance between values that are equally far apart from 0 on, or nothing.
std::optional<double> step_of(const Json& values, std::size_t fewest) {
  const auto numbers = values.get<std::vector<double>>();
  if (numbers.size() < fewest || numbers[0] != 0 || !(numbers[1] > 0)) return std::nullopt;
  for (std::size_t i = 0; i < numbers.size(); ++i)
    if (std::abs(numbers[i] - static_cast<double>(i) * numbers[1]) > 1e-6) return std::nullopt;
  return numbers[1];
}

bool has_shape(const Rings& rings, std::size_t ring_count, std::size_t meridian_count) {
  if (rings.size() != ring_count || rings[0].size() != 1) return false;
  return std::all_of(rings.begin() + 1, rings.end(),
                     [&](const std::vector<double>& ring) { return ring.size() == meridian_count; });
}

}  // namespace

double RetinaMap::largest_height_mm() const {
  double largest = 0;
  for (const auto& ring : height_mm)
    for (const double height : ring) largest = std::max(largest, std::abs(height));
  return largest;
}

double RetinaMap::at(const Rings& rings, double eccentricity_deg, double meridian_deg) const {
  const auto count = static_cast<int>(rings[1].size()), last = static_cast<int>(rings.size()) - 1;
  const auto on_ring = [&](int ring, double at) {
    if (ring < 0) at += count / 2.0;  // beyond the pole, the meridian opposite
    const std::vector<double>& values = rings[static_cast<std::size_t>(std::min(std::abs(ring), last))];
    if (values.size() == 1) return values[0];
    const int before = static_cast<int>(std::floor(at));
    std::array<double, 4> four{};
    for (int k = 0; k < 4; ++k)
      four[static_cast<std::size_t>(k)] =
          values[static_cast<std::size_t>(((before - 1 + k) % count + count) % count)];
    return between(four, at - before);
  };
  const double ring = eccentricity_deg / ring_step_deg, at = meridian_deg / meridian_step_deg;
  const int before = std::min(static_cast<int>(ring), last - 1);
  std::array<double, 4> four{};
  for (int k = 0; k < 4; ++k) four[static_cast<std::size_t>(k)] = on_ring(before - 1 + k, at);
  if (before + 2 > last) four[3] = 2 * four[2] - four[1];
  return between(four, ring - before);
}

std::optional<RetinaMap> read_retina_map(const Json& retina) {
  if (!retina.is_object() || !retina.contains("map") || !retina["map"].is_object()) return std::nullopt;
  const Json& json = retina["map"];
  for (const char* key : {"eccentricity_deg", "meridian_deg", "height_mm", "height_half_ci95_mm"})
    if (!json.contains(key)) return std::nullopt;
  const auto ring_step = step_of(json.at("eccentricity_deg"), 3),
             meridian_step = step_of(json.at("meridian_deg"), 4);
  if (!ring_step || !meridian_step) return std::nullopt;
  RetinaMap map{*ring_step, *meridian_step, json.at("height_mm").get<Rings>(),
                json.at("height_half_ci95_mm").get<Rings>()};
  const std::size_t rings = json["eccentricity_deg"].size(), meridians = json["meridian_deg"].size();
  if (std::abs(static_cast<double>(meridians) * *meridian_step - 360) > 1e-6 || meridians % 2 != 0 ||
      !has_shape(map.height_mm, rings, meridians) || !has_shape(map.half_ci95_mm, rings, meridians))
    return std::nullopt;
  return map;
}

bool draw_retina_map(Figure& figure, const RetinaMap& map, double range_mm, bool is_right_eye) {
  const double reach = map.reach_deg();
  // Two pictures one over the other: grey with a mask, and the colours where the height is sure.
  std::string script = "$map << EOD\n";
  for (int row = 0; row < cells; ++row) {
    for (int column = 0; column < cells; ++column) {
      const auto along = [&](int index) { return (2.0 * index / (cells - 1) - 1) * reach; };
      const double x = along(column), y = along(row), eccentricity = std::hypot(x, y);
      const bool is_seen = eccentricity <= reach;
      const double meridian = std::atan2(y, x) / degree + (y < 0 ? 360 : 0);
      const double height = is_seen ? map.at(map.height_mm, eccentricity, meridian) : 0;
      const bool is_sure = is_seen && std::abs(height) > map.at(map.half_ci95_mm, eccentricity, meridian);
      script += fmt::format("{:.1f} {:.1f} {} {}\n", x, y, is_seen ? 255 : 0,
                            is_sure ? fmt::format("{:.4f}", height) : "NaN");
    }
    script += "\n";
  }
  script += "EOD\n";
  script +=
      examiner_axes(reach, 30, "degrees from the pole", "", is_right_eye) +
      fmt::format(
          "set cbrange [-{0}:{0}]\nset cbtics {0}/2.\nset cblabel 'Height (mm)'\nset palette maxcolors 16 defined "
          "(-1 '#2166ac', -0.25 '#92c5de', 0 '#f7f7f7', 0.25 '#f4a582', 1 '#b2182b')\n",
          range_mm);
  // gnuplot's SVG repeats a border's colour only where it differs from the last.
  for (const auto& [ring, colour] : {std::pair{reach / 2, "#6a6a6a"}, std::pair{reach, "#6a6a6b"}})
    script +=
        fmt::format("set object circle at 0,0 size {:.1f} front fs empty border lc rgb '{}'\n", ring, colour);
  script += "plot $map using 1:2:(201):(201):(201):3 with rgbalpha, $map using 1:2:4 with image\n";
  return draw_chart(figure, script);
}

}  // namespace emmetrope::report
