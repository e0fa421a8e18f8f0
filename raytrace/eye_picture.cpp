#include "raytrace/eye_picture.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "pipeline/base/frames.hpp"
#include "pipeline/base/log.hpp"
#include "pipeline/eye/optics/chief_ray.hpp"
#include "pipeline/eye/optics/retina_point.hpp"

namespace emmetrope::raytrace {
namespace {

/// The angle that the lines of sight of two retinal points make, nothing where one does not leave the eye.
Json between_lines_of_sight_arcmin(const ChiefRays& chief_rays, const EyeModel& eye,
                                   const Eigen::Vector2d& from_mm, const Eigen::Vector2d& to_mm) {
  const auto from = meet_retina(eye, from_mm), to = meet_retina(eye, to_mm);
  const auto a = from ? chief_rays.line_of_sight(from->position_mm) : std::nullopt,
             b = to ? chief_rays.line_of_sight(to->position_mm) : std::nullopt;
  if (!a || !b) return nullptr;
  return std::atan2(a->direction.cross(b->direction).norm(), a->direction.dot(b->direction)) / degree * 60;
}

/// What a pixel is on the retina and, in the picture's middle, as an angle of the scene.
Json scale_of(const EyeModel& eye, const TraceSettings& settings) {
  const RetinalGrid& grid = settings.grid;
  const Eigen::Vector2d pixel_mm(grid.field_x_mm / grid.width, grid.field_y_mm / grid.height);
  const ChiefRays chief_rays(eye, settings.wavelength_nm.value_or(eye.reference_wavelength_nm));
  Json arcmin = Json::array();
  for (int k = 0; k < 2; ++k) {
    const Eigen::Vector2d half = 0.5 * pixel_mm[k] * Eigen::Vector2d::Unit(k);
    arcmin.push_back(
        between_lines_of_sight_arcmin(chief_rays, eye, grid.centre_mm - half, grid.centre_mm + half));
  }
  return {{"um_per_pixel", {1000 * pixel_mm.x(), 1000 * pixel_mm.y()}}, {"arcmin_per_pixel", arcmin}};
}

}  // namespace

void warn_of_doubts(const TraceResult& result, const TraceSettings& settings) {
  const auto [darkest, brightest] =
      std::minmax_element(result.image.values.begin(), result.image.values.end());
  if (*brightest - *darkest < 1e-4F)
    spdlog::warn(
        "the picture is blank: what the scene holds lies outside the field or between its pixels' centres, "
        "from which rays start; use a smaller --field-mm, or a coarser logmar for a chart");
  const std::uint64_t stopped = result.states.at(RayState::missed_surface) + result.states.at(RayState::tir);
  if (20 * stopped > result.rays)
    spdlog::warn(
        "{:.0f} % of the rays stop inside the eye: they miss a surface or are totally reflected, and the "
        "picture is made of the rest; emmetrope ray shows where a ray ends",
        100.0 * static_cast<double>(stopped) / static_cast<double>(result.rays));
  if (result.error && *result.error > *settings.target_error)
    spdlog::warn(
        "--target-error {}: the standard error is still {:.3g} after {} rays a pixel; raise --samples",
        *settings.target_error, *result.error, result.samples);
}

Json picture_json(const TraceResult& result, const std::string& image, const EyeModel& eye,
                  const TraceSettings& settings) {
  Json states = Json::object();
  for (const auto& [state, count] : result.states) states[to_string(state)] = count;
  Json json{{"rays", result.rays},      {"wall_s", result.wall_s}, {"rays_per_s", result.rays_per_s()},
            {"device", result.device},  {"states", states},        {"image", image},
            {"samples", result.samples}};
  if (result.error) json["standard_error_levels"] = *result.error;
  json["scale"] = scale_of(eye, settings);
  return json;
}

std::string picture_line(const std::string& eye, const Json& picture) {
  return fmt::format("{}: {:.1f} million rays in {:.2f} s ({:.1f} million a second), {}\n", eye,
                     picture["rays"].get<double>() / 1e6, picture["wall_s"].get<double>(),
                     picture["rays_per_s"].get<double>() / 1e6, picture["image"].get<std::string>());
}

}  // namespace emmetrope::raytrace
