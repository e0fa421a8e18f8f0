#include "raytrace/eye_picture.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "pipeline/base/frames.hpp"
#include "pipeline/base/log.hpp"
#include "raytrace/retina/field_points.hpp"

namespace emmetrope::raytrace {

Json scale_of(const EyeModel& eye, const TraceSettings& settings) {
  const RetinalGrid& grid = settings.grid;
  const double wavelength_nm = settings.wavelength_nm.value_or(eye.reference_wavelength_nm);
  const FieldPoints points(eye, grid, wavelength_nm);
  const ChiefRays chief_rays(eye, wavelength_nm);
  const Eigen::Vector2d pixel =
      half_of(grid).cwiseProduct(Eigen::Vector2d(2.0 / grid.width, 2.0 / grid.height));
  Json um = Json::array(), arcmin = Json::array();
  for (int k = 0; k < 2; ++k) {
    const Eigen::Vector2d half = 0.5 * pixel[k] * Eigen::Vector2d::Unit(k);
    const auto from = points.at(-half), to = points.at(half);
    const auto a = from ? chief_rays.line_of_sight(from->position_mm) : std::nullopt,
               b = to ? chief_rays.line_of_sight(to->position_mm) : std::nullopt;
    um.push_back(!from || !to ? Json(nullptr)
                 : grid.projection == Projection::retina_plane
                     ? Json(1000 * pixel[k])
                     : Json(1000 * (to->position_mm - from->position_mm).norm()));
    arcmin.push_back(
        !a || !b ? Json(nullptr)
                 : Json(std::atan2(a->direction.cross(b->direction).norm(), a->direction.dot(b->direction)) /
                        degree * 60));
  }
  return {{"projection", to_string(grid.projection)}, {"um_per_pixel", um}, {"arcmin_per_pixel", arcmin}};
}

void warn_of_doubts(const TraceResult& result, const TraceSettings& settings) {
  const auto [darkest, brightest] =
      std::minmax_element(result.image.values.begin(), result.image.values.end());
  if (*brightest - *darkest < 1e-4F)
    spdlog::warn(
        result.states.at(RayState::reached) == 0
            ? "the picture is blank: no ray meets what the scene holds; it lies outside the field or between its "
              "pixels' centres, from which rays start: use another --field-mm"
            : "the picture is blank: what rays meet is everywhere as bright, and as the background; use another "
              "background for a scene, and where a chart's detail lies beyond the field or between the pixels' "
              "centres, another --field-mm or a coarser logmar");
  const std::uint64_t stopped = result.states.at(RayState::missed_surface) + result.states.at(RayState::tir);
  // A wide field's rim loses many.
  if (settings.grid.projection == Projection::retina_plane && 20 * stopped > result.rays)
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
  if (!result.unseen.empty())
    json["unseen_pixels"] = std::count(result.unseen.begin(), result.unseen.end(), 1);
  return json;
}

std::string picture_line(const std::string& eye, const Json& picture) {
  return fmt::format("{}: {:.1f} million rays in {:.2f} s ({:.1f} million a second), {}\n", eye,
                     picture["rays"].get<double>() / 1e6, picture["wall_s"].get<double>(),
                     picture["rays_per_s"].get<double>() / 1e6, picture["image"].get<std::string>());
}

}  // namespace emmetrope::raytrace
