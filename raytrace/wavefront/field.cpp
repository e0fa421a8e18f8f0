#include "raytrace/wavefront/field.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/base/parallel.hpp"
#include "pipeline/eye/optics/retina_point.hpp"
#include "raytrace/picture/float_files.hpp"
#include "raytrace/retina/retina_arc.hpp"

namespace emmetrope::raytrace {
namespace {

/// Pixels of a page, an odd number.
constexpr int page_side = 129;
/// Of the light that a page is wide enough for.
constexpr double light_in_page = 0.995;

constexpr std::array<const char*, 3> field_files{"psf-grid.tiff", "psf-grid.png", "field.json"};

/// One direction with all that is said of it.
struct FieldEntry {
  FieldWavefront at;
  ImageQuality quality;
  LinearImage page;  ///< the point spread, unit sum over the whole
  std::optional<double> pitch_arcmin;
};

/// Half the side of the square about the middle that holds `light_in_page`, in pixels.
int reach_of_light(const PointSpread& spread) {
  const int half = spread.size / 2;
  std::vector<double> by_ring(half + 1, 0);
  for (int row = 0; row < spread.size; ++row)
    for (int column = 0; column < spread.size; ++column) {
      const int ring = std::max(std::abs(row - half), std::abs(column - half));
      by_ring[std::min(ring, half)] += spread.values[static_cast<std::size_t>(row) * spread.size + column];
    }
  double sum = 0;
  int ring = 0;
  for (; ring < half && (sum += by_ring[ring]) < light_in_page; ++ring) {
  }
  return ring;
}

/// The spread summed over squares of an odd side, so few of them that its light fits into a page.
void draw_page(FieldEntry& entry, const PointSpread& spread) {
  constexpr int middle = page_side / 2;
  entry.page = {page_side, page_side, 1, std::vector<float>(std::size_t{page_side} * page_side)};
  if (spread.wraps) return;
  const int half = spread.size / 2;
  const int together = 2 * ((reach_of_light(spread) + middle) / page_side) + 1;
  for (int row = 0; row < spread.size; ++row)
    for (int column = 0; column < spread.size; ++column) {
      const auto page_of = [&](int pixel) {
        return static_cast<int>(std::floor((pixel - half + 0.5 * together) / together)) + middle;
      };
      const int to_row = page_of(row), to_column = page_of(column);
      if (std::min(to_row, to_column) < 0 || std::max(to_row, to_column) >= page_side) continue;
      entry.page.values[static_cast<std::size_t>(to_row) * page_side + to_column] +=
          spread.values[static_cast<std::size_t>(row) * spread.size + column];
    }
  entry.pitch_arcmin = together * spread.pitch_arcmin;
}

std::vector<FieldEntry> measure_field(const EyeModel& eye, const FieldGrid& grid,
                                      const WavefrontSettings& settings, int threads, Verbosity verbosity) {
  const std::vector<Eigen::Vector2d> directions = grid.directions_deg();
  const ChiefRays chief_rays(eye, settings.wavelength_nm.value_or(eye.reference_wavelength_nm));
  std::vector<std::optional<FieldEntry>> found(directions.size());
  Progress progress("measuring the field", directions.size(), verbosity);
  on_threads(threads, directions.size(), [&](std::size_t k) {
    if (auto at = wavefront_towards(eye, chief_rays, directions[k], settings)) {
      FieldEntry entry;
      entry.quality = image_quality(at->wavefront);
      draw_page(entry, point_spread(at->wavefront));
      entry.at = std::move(*at);
      found[k] = std::move(entry);
    }
    progress.advance();
  });
  std::vector<FieldEntry> entries;
  for (std::optional<FieldEntry>& entry : found)
    if (entry) entries.push_back(std::move(*entry));
  if (entries.empty()) throw no_result_error("no direction of --psf-grid is seen by the retina");
  return entries;
}

template <typename Value>
Json column(const std::vector<FieldEntry>& entries, const Value& value) {
  Json json = Json::array();
  for (const FieldEntry& entry : entries) json.push_back(value(entry));
  return json;
}

Json power_columns(const std::vector<FieldEntry>& entries, PowerVector Wavefront::*criterion) {
  const auto part = [&](double PowerVector::*value) {
    return column(entries, [&](const FieldEntry& e) { return e.at.wavefront.*criterion.*value; });
  };
  return {{"M_D", part(&PowerVector::M_D)},
          {"J0_D", part(&PowerVector::J0_D)},
          {"J45_D", part(&PowerVector::J45_D)}};
}

/// Of equal length for all: nothing beyond a pupil's cut-off.
Json mtf_columns(const std::vector<FieldEntry>& entries) {
  std::vector<double> longest;
  for (const FieldEntry& entry : entries)
    if (entry.quality.cpd.size() > longest.size()) longest = entry.quality.cpd;
  const auto padded = [&](std::vector<double> ImageQuality::*curve) {
    return column(entries, [&](const FieldEntry& e) {
      std::vector<double> values = e.quality.*curve;
      values.resize(longest.size(), 0);
      return values;
    });
  };
  return {{"cpd", longest},
          {"tangential", padded(&ImageQuality::mtf_tangential)},
          {"sagittal", padded(&ImageQuality::mtf_sagittal)}};
}

Json field_json(const EyeModel& eye, const FieldGrid& grid, const std::vector<FieldEntry>& entries) {
  using Entry = FieldEntry;
  const Wavefront& first = entries.front().at.wavefront;
  const auto of = [&](const auto& value) { return column(entries, value); };
  const auto of_wavefront = [&](const auto& value) {
    return of([&](const Entry& e) { return value(e.at.wavefront); });
  };
  return {{"eye", eye.name},
          {"wavelength_nm", first.wavelength_nm},
          {"stiles_crawford_per_mm2", first.stiles_crawford_per_mm2},
          {"reach_deg", grid.reach_deg},
          {"step_deg", grid.step_deg},
          {"horizontal_deg", of([](const Entry& e) { return e.at.direction_deg.x(); })},
          {"vertical_deg", of([](const Entry& e) { return e.at.direction_deg.y(); })},
          {"retina_mm", of([](const Entry& e) { return to_json_vector(e.at.retina_mm); })},
          {"retina_arc_mm", of([&](const Entry& e) {
             const std::optional<double> arc_mm = retina_arc_mm(eye, e.at.retina_mm);
             return arc_mm ? Json(*arc_mm) : Json(nullptr);
           })},
          {"pupil_mm", of_wavefront([](const Wavefront& w) { return w.pupil_mm; })},
          {"pupil_area_mm2", of_wavefront([](const Wavefront& w) { return w.rim.area_mm2(); })},
          {"paraxial", power_columns(entries, &Wavefront::paraxial)},
          {"minimum_rms_wavefront", power_columns(entries, &Wavefront::minimum_rms_wavefront)},
          {"minimum_rms_spot", power_columns(entries, &Wavefront::minimum_rms_spot)},
          {"zernike_um", of_wavefront([](const Wavefront& w) { return w.zernike_um; })},
          {"rms_um", of_wavefront([](const Wavefront& w) { return w.rms_um(); })},
          {"higher_order_rms_um", of_wavefront([](const Wavefront& w) { return w.higher_order_rms_um(); })},
          {"spot_rms_arcmin", of_wavefront([](const Wavefront& w) { return w.spot_rms_arcmin(); })},
          {"strehl", of([](const Entry& e) { return e.quality.strehl; })},
          {"vsotf", of([](const Entry& e) { return e.quality.vsotf; })},
          {"tangential_deg", of_wavefront([](const Wavefront& w) {
             return normalise_axis_deg(std::atan2(w.tangential.y(), w.tangential.x()) / degree);
           })},
          {"mtf", mtf_columns(entries)},
          {"psf",
           {{"file", "psf-grid.tiff"},
            {"side", page_side},
            {"pitch_arcmin",
             of([](const Entry& e) { return e.pitch_arcmin ? Json(*e.pitch_arcmin) : Json(nullptr); })},
            {"middle_arcmin", of_wavefront([](const Wavefront& w) {
               const Eigen::Vector2d middle = w.tilt_mrad() / 1000 / degree * 60;
               return Json{middle.x(), middle.y()};
             })}}}};
}

/// All spreads where they are seen, each to its own peak, all at the scale of the widest.
LinearImage at_a_glance(const FieldGrid& grid, const std::vector<FieldEntry>& entries) {
  constexpr int tile = 33, middle = tile / 2;
  double widest_arcmin = 0;
  for (const FieldEntry& entry : entries)
    widest_arcmin = std::max(widest_arcmin, page_side * entry.pitch_arcmin.value_or(0));
  const double tile_pitch_arcmin = widest_arcmin / tile;
  const int steps = static_cast<int>(std::floor(grid.reach_deg / grid.step_deg + 1e-9)),
            tiles = 2 * steps + 1;
  LinearImage picture{tiles * tile, tiles * tile, 1,
                      std::vector<float>(std::size_t{1} * tiles * tile * tiles * tile)};
  for (const FieldEntry& entry : entries) {
    if (!entry.pitch_arcmin) continue;
    const float peak = *std::max_element(entry.page.values.begin(), entry.page.values.end());
    // As the patient looks out: +x, the patient's left, on the left.
    const auto left =
                   static_cast<int>(std::lround(steps - entry.at.direction_deg.x() / grid.step_deg)) * tile,
               top = static_cast<int>(std::lround(steps - entry.at.direction_deg.y() / grid.step_deg)) * tile;
    for (int row = 0; row < tile; ++row)
      for (int column = 0; column < tile; ++column) {
        const auto in_page = [&](int pixel) {
          return static_cast<int>(std::lround((pixel - middle) * tile_pitch_arcmin / *entry.pitch_arcmin)) +
                 page_side / 2;
        };
        const int from_row = in_page(row), from_column = in_page(column);
        if (std::min(from_row, from_column) < 0 || std::max(from_row, from_column) >= page_side) continue;
        picture.values[static_cast<std::size_t>(top + row) * picture.width + left + column] =
            entry.page.at(from_column, from_row, 0) / peak;
      }
  }
  return picture;
}

}  // namespace

void FieldGrid::check() const {
  if (!(reach_deg > 0 && reach_deg < 90) || !(step_deg >= 0.1 && step_deg <= reach_deg))
    throw usage_error("--psf-grid: a reach below 90 degrees and a step from 0.1 to the reach are wanted",
                      "write 60:5");
  if (directions_deg().size() > 5000)
    throw usage_error("--psf-grid: more than 5000 directions", "take a larger step");
}

std::vector<Eigen::Vector2d> FieldGrid::directions_deg() const {
  const int steps = static_cast<int>(std::floor(reach_deg / step_deg + 1e-9));
  std::vector<Eigen::Vector2d> directions;
  for (int row = steps; row >= -steps; --row)
    for (int column = -steps; column <= steps; ++column) {
      const Eigen::Vector2d angle_deg = step_deg * Eigen::Vector2d(column, row);
      const double eccentricity = std::atan((angle_deg * degree).array().tan().matrix().norm()) / degree;
      if (eccentricity <= reach_deg + 1e-9) directions.push_back(angle_deg);
    }
  return directions;
}

std::optional<Eigen::Vector3d> retina_seeing(const ChiefRays& chief_rays,
                                             const Eigen::Vector2d& direction_deg) {
  const double most_deg = direction_deg.cwiseAbs().maxCoeff(),
               least_deg = direction_deg.cwiseAbs().minCoeff();
  if (!direction_deg.allFinite() || most_deg > 180 || (most_deg >= 90 && least_deg != 0))
    throw usage_error(fmt::format("horizontal_deg and vertical_deg: {:g} and {:g} are no direction",
                                  direction_deg.x(), direction_deg.y()),
                      "give two angles below 90 degrees, or one up to 180 and 0");
  const Eigen::Array2d angle = direction_deg.array() * degree;
  const Eigen::Array2d sine = angle.sin(), cosine = angle.cos();
  const std::optional<RetinaPoint> image =
      chief_rays.image_of({sine.x() * cosine.y(), cosine.x() * sine.y(), cosine.x() * cosine.y()});
  return image ? std::optional(image->position_mm) : std::nullopt;
}

std::optional<FieldWavefront> wavefront_towards(const EyeModel& eye, const ChiefRays& chief_rays,
                                                const Eigen::Vector2d& direction_deg,
                                                WavefrontSettings settings) {
  const std::optional<Eigen::Vector3d> image = retina_seeing(chief_rays, direction_deg);
  const auto behind_equator = image ? meet_retina(eye, image->head<2>()) : std::nullopt;
  if (!behind_equator || (behind_equator->position_mm - *image).norm() > 1e-6) return std::nullopt;
  settings.fovea_mm = image->head<2>();
  try {
    return FieldWavefront{direction_deg, *image, measure_wavefront(eye, settings)};
  } catch (const Error& error) {
    if (error.status() != ExitStatus::no_result) throw;
    return std::nullopt;
  }
}

void remove_field(const std::filesystem::path& folder) {
  for (const char* file : field_files) std::filesystem::remove(folder / file);
}

void write_field(const EyeModel& eye, const FieldGrid& grid, const WavefrontSettings& settings,
                 const std::filesystem::path& folder, int threads, Verbosity verbosity) {
  const std::vector<FieldEntry> entries = measure_field(eye, grid, settings, threads, verbosity);
  std::vector<LinearImage> pages;
  for (const FieldEntry& entry : entries) pages.push_back(entry.page);
  write_tiff_pages(folder / "psf-grid.tiff", pages);
  write_png(folder / "psf-grid.png", at_a_glance(grid, entries));
  write_json(folder / "field.json", field_json(eye, grid, entries));
}

}  // namespace emmetrope::raytrace
