#include "raytrace/scene/chart.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <charconv>
#include <cmath>
#include <functional>
#include <limits>
#include <set>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/base/log.hpp"
#include "raytrace/scene/optotypes.hpp"

namespace emmetrope::raytrace {
namespace {

/// Largest texture: 64 MB of floats would gain nothing that a retinal image of 500 pixels shows.
constexpr double largest_texture = 2048;
constexpr int texels_per_detail = 8;
constexpr double fewest_texels = 1.5;  ///< of a detail: below, strokes are lost
/// In texels that an outline crosses: a lattice on which no two share a row or a column, so that upright
/// edges are as fine as slanting ones.
constexpr int subsamples = 16, lattice_step = 7;

/// Whether (x, y) is ink, in units of one minute of arc on the chart (x to the patient's right, y up, from
/// its centre).
using Ink = std::function<bool(double x, double y)>;

/// Repeatable choice among n for cell (i, j).
unsigned pick(int i, int j, unsigned n) {
  unsigned h = static_cast<unsigned>(i) * 747796405U + static_cast<unsigned>(j) * 2891336453U + 12345U;
  h = ((h >> ((h >> 28U) + 4U)) ^ h) * 277803737U;
  return ((h >> 22U) ^ h) % n;
}

/// One optotype of 5 x 5 units about its centre; cell (i, j) decides which.
using Optotype = bool (*)(int i, int j, double x, double y);

/// The number of a row or a column, from 0 at the centre; of a plane of a scene file there may be more than an int holds.
int cell(double number) { return static_cast<int>(std::fmod(number, 0x1p30)); }

/// Optotypes of one size, one letter's width apart, as many as the chart holds whole.
Ink even_rows(Optotype optotype, double detail, double extent) {
  const double pitch = 10 * detail;
  const double most = std::floor((0.5 * extent - 2.6 * detail) / pitch);
  return [=](double x, double y) {
    const double i = std::round(x / pitch), j = std::round(y / pitch);
    return std::abs(i) <= most && std::abs(j) <= most &&
           optotype(cell(i), cell(j), (x - i * pitch) / detail, (y - j * pitch) / detail);
  };
}

/// Of a chart of optotypes.
struct ChartRow {
  double centre, height;  ///< minutes of arc
};

/// ETDRS layout (Ferris 1982): five optotypes a row, gaps of one optotype, rows of falling size a row's
/// height apart, as many as the chart holds; logMAR falls by 0.1 a row.
std::vector<ChartRow> falling_rows(double extent) {
  const double ratio = std::pow(10, -0.1);
  // rows of height h r^k with gaps of the lower row's height: (h + h r) / (1 - r) high altogether
  const double first = std::min(extent / 9.8, extent * 0.97 * (1 - ratio) / (1 + ratio));
  std::vector<ChartRow> rows;
  double top = 0.485 * extent, height = first;
  while (height > 5 && rows.size() < 40) {
    rows.push_back({top - height / 2, height});
    top -= height * (1 + ratio);
    height *= ratio;
  }
  return rows;
}

Ink in_rows(Optotype optotype, const std::vector<ChartRow>& rows) {
  return [=](double x, double y) {
    for (std::size_t k = 0; k < rows.size(); ++k) {
      const auto& row = rows[k];
      if (std::abs(y - row.centre) > row.height / 2) continue;
      const double pitch = 2 * row.height, i = std::round(x / pitch);
      const double detail = row.height / 5;
      return std::abs(i) <= 2 &&
             optotype(int(i), int(k), (x - i * pitch) / detail, (y - row.centre) / detail);
    }
    return false;
  };
}

bool sloan(int i, int j, double x, double y) {
  return sloan_ink(sloan_letters[pick(i, j, 10)], x + 2.5, y + 2.5);
}
bool landolt(int i, int j, double x, double y) { return landolt_ink(x, y, 45.0 * pick(i, j, 8)); }
bool tumbling_e(int i, int j, double x, double y) { return tumbling_e_ink(x, y, 90.0 * pick(i, j, 4)); }

/// Bars of one detail's width every 15 degrees, from a tenth of the chart outwards.
Ink dial(double detail, double extent) {
  return [=](double x, double y) {
    const double r = std::hypot(x, y);
    if (r < 0.1 * extent || r > 0.48 * extent) return false;
    const double nearest = std::round(std::atan2(y, x) / (15 * degree)) * 15 * degree;
    return std::abs(y * std::cos(nearest) - x * std::sin(nearest)) <= detail / 2;
  };
}

Ink siemens(double spokes, double extent) {
  return [=](double x, double y) {
    const double phase = std::atan2(y, x) / (2 * pi) * spokes;
    return std::hypot(x, y) <= 0.48 * extent && phase - std::floor(phase) < 0.5;
  };
}

/// Patches of three bars each (USAF 1951 form, bars 1 x 5), in four orientations.
bool bars(int i, int j, double x, double y) {
  const double angle = 45.0 * pick(i, j, 4) * degree, c = std::cos(angle), s = std::sin(angle);
  const double u = c * x + s * y, v = c * y - s * x;
  const double k = std::round(v / 2);
  return std::abs(u) <= 2.5 && std::abs(k) <= 1 && std::abs(v - 2 * k) <= 0.5;
}

/// Single strokes 1 x 5 at angles in steps of 15 degrees: detail of every orientation in every part of the
/// field.
bool dashes(int i, int j, double x, double y) {
  const double angle = 15.0 * pick(i, j, 12) * degree, c = std::cos(angle), s = std::sin(angle);
  return std::abs(c * x + s * y) <= 2.5 && std::abs(c * y - s * x) <= 0.5;
}

Ink ink_of(const ChartSpec& spec, double extent) {
  const double detail = std::pow(10, spec.logmar);
  const auto rows = [&](Optotype optotype) {
    return spec.logmar_given ? even_rows(optotype, detail, extent) : in_rows(optotype, falling_rows(extent));
  };
  // NOLINTBEGIN(clang-analyzer-cplusplus.NewDeleteLeaks): the analyser loses sight of what std::function
  // owns.
  if (spec.name == "letters") return rows(sloan);
  if (spec.name == "landolt") return rows(landolt);
  if (spec.name == "tumbling-e") return rows(tumbling_e);
  // NOLINTEND(clang-analyzer-cplusplus.NewDeleteLeaks)
  if (spec.name == "siemens") return siemens(spec.spokes, extent);
  if (spec.name == "dial") return dial(detail, extent);
  if (spec.name == "bars") return even_rows(bars, detail, extent);
  if (spec.name == "dashes") return even_rows(dashes, detail, extent);
  if (spec.name == "point") return [=](double x, double y) { return std::hypot(x, y) <= detail / 2; };
  return [=](double x, double y) {  // grid: lines a degree apart
    const auto near_line = [&](double v) { return std::abs(v - 60 * std::round(v / 60)) <= detail / 2; };
    return near_line(x) || near_line(y);
  };
}

/// The chart is flat: minutes of arc are counted at its centre, and its edge lies where extent_deg / 2 is seen.
double extent_arcmin(const ChartSpec& spec) {
  return 2 * std::tan(0.5 * spec.extent_deg * degree) / std::tan(degree / 60);
}

/// Detail that a chart has where none is asked for, logMAR: what a 20 degree field of 500 pixels shows.
double default_logmar(const std::string& name) { return name == "point" ? 0 : 0.9; }

/// Share of ink in every texel. A texel whose corners and centre agree holds no outline, as strokes are
/// texels wide.
std::vector<float> rasterise(const Ink& ink, int width, int height, const Eigen::Vector2d& extent) {
  const double step_x = extent.x() / width, step_y = extent.y() / height;
  const auto x_at = [&](double column) { return (column - 0.5 * width) * step_x; };
  const auto y_at = [&](double row) { return (0.5 * height - row) * step_y; };
  std::vector<float> share(static_cast<std::size_t>(width) * height);
  std::vector<char> above(width + 1), below(width + 1);
  for (int i = 0; i <= width; ++i) below[i] = ink(x_at(i), y_at(0));
  for (int j = 0; j < height; ++j) {
    above.swap(below);
    for (int i = 0; i <= width; ++i) below[i] = ink(x_at(i), y_at(j + 1));
    for (int i = 0; i < width; ++i) {
      const int corners = above[i] + above[i + 1] + below[i] + below[i + 1];
      const bool centre = ink(x_at(i + 0.5), y_at(j + 0.5));
      float value = centre ? 1.F : 0.F;
      if (corners != (centre ? 4 : 0)) {
        int inside = 0;
        for (int k = 0; k < subsamples; ++k)
          inside += ink(x_at(i + (k + 0.5) / subsamples),
                        y_at(j + (k * lattice_step % subsamples + 0.5) / subsamples));
        value = static_cast<float>(inside) / subsamples;
      }
      share[static_cast<std::size_t>(j) * width + i] = value;
    }
  }
  return share;
}

double number(const std::string& key, const std::string& text) {
  if (text == "inf" || text == "infinity") return std::numeric_limits<double>::infinity();
  double value = 0;
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (fault != std::errc() || end != text.data() + text.size())
    throw usage_error(key + "=" + text + " is no number");
  return value;
}

void check(bool good, const std::string& key, double value, const std::string& range) {
  if (!good) throw usage_error(fmt::format("{}={:g} is out of range", key, value), "give " + range);
}

}  // namespace

std::vector<std::string> chart_names() {
  return {"letters", "landolt", "tumbling-e", "siemens", "dial", "bars", "dashes", "point", "grid"};
}

ChartSpec parse_chart(const std::string& text) {
  ChartSpec spec;
  const auto colon = text.find(':');
  spec.name = text.substr(0, colon);
  const auto names = chart_names();
  if (std::find(names.begin(), names.end(), spec.name) == names.end()) {
    throw usage_error(
        fmt::format("no chart is called \"{}\"", spec.name),
        fmt::format("charts are {}; scenes of their own are cards, perimeter, pyramids and scene.json files",
                    fmt::join(names, ", ")));
  }
  spec.logmar = default_logmar(spec.name);
  if (spec.name == "point") spec.extent_deg = 2;  // all else is dark anyway, and its texels are fine
  std::set<std::string> given;
  for (std::size_t at = colon; at != std::string::npos;) {
    const std::size_t next = text.find(',', at + 1);
    const std::string pair = text.substr(at + 1, next == std::string::npos ? next : next - at - 1);
    const auto equals = pair.find('=');
    if (equals == std::string::npos)
      throw usage_error("\"" + pair + "\" is no key=value", "write NAME:key=value,key=value");
    const std::string key = pair.substr(0, equals);
    const double value = number(key, pair.substr(equals + 1));
    if (!given.insert(key).second) throw usage_error(key + " is given twice");
    if (key == "spokes" && spec.name != "siemens")
      throw usage_error("spokes belong to siemens, not to " + spec.name);
    if (key == "distance_mm")
      spec.distance_mm = value;
    else if (key == "logmar")
      spec.logmar = value, spec.logmar_given = true;
    else if (key == "extent_deg")
      spec.extent_deg = value;
    else if (key == "contrast")
      spec.contrast = value;
    else if (key == "spokes")
      spec.spokes = value;
    else
      throw usage_error(fmt::format("{} has no key \"{}\"", spec.name, key),
                        "known keys: distance_mm, logmar, extent_deg, contrast, spokes");
    at = next;
  }
  check(spec.distance_mm >= least_distance_mm, "distance_mm", spec.distance_mm,
        fmt::format("a distance of at least {:g} mm, or inf", least_distance_mm));
  check(spec.logmar >= -1 && spec.logmar <= 3, "logmar", spec.logmar, "-1 to 3");
  check(spec.extent_deg > 0.01 && spec.extent_deg <= 120, "extent_deg", spec.extent_deg,
        "0.01 to 120 degrees");
  check(spec.contrast >= 0 && spec.contrast <= 1, "contrast", spec.contrast, "0 to 1");
  check(spec.spokes >= 2 && spec.spokes <= 360 && spec.spokes == std::floor(spec.spokes), "spokes",
        spec.spokes, "a whole number from 2 to 360");
  return spec;
}

std::vector<double> logmar_of_rows(const ChartSpec& spec) {
  if (spec.name != "letters" && spec.name != "landolt" && spec.name != "tumbling-e") return {};
  if (spec.logmar_given) return {spec.logmar};
  std::vector<double> logmar;
  for (const ChartRow& row : falling_rows(extent_arcmin(spec))) logmar.push_back(std::log10(row.height / 5));
  return logmar;
}

Scene draw_chart(const ChartSpec& spec, const Eigen::Vector2d& shown) {
  const double half = std::tan(0.5 * spec.extent_deg * degree);
  const double extent = extent_arcmin(spec);
  const double detail = spec.logmar_given || spec.name != "letters" ? std::pow(10, spec.logmar) : 1;
  // A double until it is clamped: a plane of a scene file may be wider than an int has texels for.
  const int size = int(std::clamp(std::ceil(extent * texels_per_detail / detail), 64.0, largest_texture));
  if (const double texels = size * detail / extent;
      spec.logmar_given && texels < fewest_texels && spec.name != "siemens")
    spdlog::warn(
        "the chart's detail of {:.2g} arcmin is {:.1f} texels wide and is not drawn as it should be; give "
        "extent_deg={:.2g} or less",
        detail, texels, spec.extent_deg * texels / 4);

  const bool bright = spec.name == "point";  // a star on a dark ground; all others are ink on paper
  Texture texture;
  const auto texels_of = [&](double share) { return std::max(2, int(std::ceil(share * size))); };
  texture.width = texels_of(shown.x());
  texture.height = texels_of(shown.y());
  texture.values = rasterise(ink_of(spec, extent), texture.width, texture.height, extent * shown);
  for (float& value : texture.values) value = bright ? value : 1 - static_cast<float>(spec.contrast) * value;

  Scene scene;
  scene.name = spec.name;
  scene.background = Eigen::Vector3d::Constant(bright ? 0 : 1);
  TexturedPlane plane;
  plane.at_infinity = std::isinf(spec.distance_mm);
  const double distance = plane.at_infinity ? 1 : spec.distance_mm;
  plane.centre_mm = {0, 0, distance};
  plane.right_mm = {-half * shown.x() * distance, 0, 0};
  plane.up_mm = {0, half * shown.y() * distance, 0};
  plane.texture = std::make_shared<const Texture>(std::move(texture));
  scene.planes.push_back(std::move(plane));
  return scene;
}

}  // namespace emmetrope::raytrace
