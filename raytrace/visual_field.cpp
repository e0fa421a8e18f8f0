#include "raytrace/visual_field.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/base/measured.hpp"
#include "raytrace/case/retina_ellipse.hpp"
#include "raytrace/retina/field_points.hpp"
#include "raytrace/retina/geodesic.hpp"
#include "raytrace/retina/pupil_aim.hpp"
#include "raytrace/retina/retina_arc.hpp"

namespace emmetrope::raytrace {
namespace {

/// One direction of the field.
struct Seen {
  int eccentricity_deg, meridian_deg;
  Eigen::Vector3d direction, retina_mm;
};

std::vector<Seen> field_of(const EyeModel& eye, const TraceSettings& settings, double wavelength_nm) {
  constexpr int step_deg = 5, most_deg = 125, meridian_step_deg = 15;
  RetinalGrid grid = settings.grid;
  grid.projection = Projection::visual_angle;
  const FieldPoints points(eye, grid, wavelength_nm);
  std::vector<Seen> field;
  for (int towards_deg = 0; towards_deg < 360; towards_deg += meridian_step_deg)
    for (int away_deg = towards_deg == 0 ? 0 : step_deg; away_deg <= most_deg; away_deg += step_deg) {
      const double angle = towards_deg * degree;
      const Eigen::Vector2d place = away_deg * Eigen::Vector2d(std::cos(angle), -std::sin(angle));
      const std::optional<RetinaPoint> point = points.at(place);
      if (!point) break;  // the eye sees no further
      field.push_back({away_deg, towards_deg, points.direction(place), point->position_mm});
    }
  return field;
}

Json number_or_null(const std::optional<double>& value) { return value ? Json(*value) : Json(nullptr); }

Json columns_of(const EyeModel& eye, const std::vector<Seen>& field) {
  Json columns = Json::object();
  for (const Seen& seen : field) {
    columns["eccentricity_deg"].push_back(seen.eccentricity_deg);
    columns["meridian_deg"].push_back(seen.meridian_deg);
    columns["direction"].push_back(to_json_vector(seen.direction));
    columns["retina_mm"].push_back(to_json_vector(seen.retina_mm));
    columns["retina_arc_mm"].push_back(number_or_null(retina_arc_mm(eye, seen.retina_mm)));
  }
  return columns;
}

void add_ellipses(Json& columns, const std::vector<Seen>& field, const UncertainField& uncertain,
                  double wavelength_nm) {
  std::vector<Eigen::Vector3d> directions;
  for (const Seen& seen : field) directions.push_back(seen.direction);
  for (const auto& ellipse : retina_ellipses(uncertain.optics, uncertain.as_it_looks, directions,
                                             wavelength_nm, uncertain.threads)) {
    const auto axes = [&] { return Json{ellipse->semi_axes_mm.x(), ellipse->semi_axes_mm.y()}; };
    columns["ellipse95_semi_axes_mm"].push_back(ellipse ? axes() : Json(nullptr));
    columns["ellipse95_axis_deg"].push_back(ellipse ? Json(ellipse->axis_deg) : Json(nullptr));
  }
}

/// A landmark where it lies.
struct Placed {
  const char* name;
  double sigma_mm;
  Eigen::Vector3d retina_mm;
};

std::vector<Placed> placed(const EyeModel& eye, const Landmarks& landmarks) {
  std::vector<Placed> all{{"pole", 0, retina_point(eye, 0, 0).position_mm}};
  const auto add = [&](const char* name, const std::optional<Landmark>& mark) {
    if (!mark) return;
    all.push_back({name, mark->sigma_mm,
                   retina_point(eye, mark->from_pole_mm.x(), mark->from_pole_mm.y()).position_mm});
  };
  add("fovea", landmarks.fovea);
  add("disc", landmarks.disc);
  return all;
}

Json landmarks_json(const EyeModel& eye, const std::vector<Placed>& marks, double wavelength_nm) {
  const ChiefRays chief_rays(eye, wavelength_nm);
  Json json = Json::object();
  for (const Placed& mark : marks) {
    const std::optional<Ray> sight = chief_rays.line_of_sight(mark.retina_mm);
    json[mark.name] = {{"retina_mm", to_json_vector(mark.retina_mm)},
                       {"direction", sight ? to_json_vector(sight->direction) : Json(nullptr)},
                       {"retina_arc_mm", number_or_null(retina_arc_mm(eye, mark.retina_mm))}};
    if (mark.sigma_mm > 0) json[mark.name]["sigma_mm"] = mark.sigma_mm;
  }
  return json;
}

Json distances_json(const EyeModel& eye, const std::vector<Placed>& marks) {
  Json json = Json::object();
  for (std::size_t a = 0; a < marks.size(); ++a)
    for (std::size_t b = a + 1; b < marks.size(); ++b) {
      const std::optional<double> way_mm = geodesic_mm(eye, marks[a].retina_mm, marks[b].retina_mm);
      const double sigma_mm = std::hypot(marks[a].sigma_mm, marks[b].sigma_mm);
      Json& distance = json[fmt::format("{}_{}_mm", marks[a].name, marks[b].name)] = number_or_null(way_mm);
      if (!way_mm || sigma_mm == 0) continue;
      Measured measured = Measured::from_sigma(*way_mm, sigma_mm, "given");
      measured.ci95[0] = std::max(measured.ci95[0], 0.0);  // no way is shorter than none
      distance = measured;
    }
  return json;
}

}  // namespace

void Landmark::check(const char* option) const {
  if (!(sigma_mm >= 0 && sigma_mm <= 5))
    throw usage_error(fmt::format("{}: a standard deviation of {:g} mm is out of range", option, sigma_mm),
                      "give 0 to 5 mm behind +-");
}

void require_on_retina(const EyeModel& eye, const Landmarks& landmarks) {
  const auto require = [&](const char* option, const std::optional<Landmark>& mark) {
    if (mark && !meet_retina(eye, mark->from_pole_mm))
      throw input_error(fmt::format("{}: the retina does not reach {:g}, {:g} mm from its pole", option,
                                    mark->from_pole_mm.x(), mark->from_pole_mm.y()),
                        "give eye x and y behind the equator, in mm");
  };
  require("--fovea", landmarks.fovea);
  require("--disc", landmarks.disc);
}

void write_visual_field(const EyeModel& eye, const TraceSettings& settings, const Landmarks& landmarks,
                        const UncertainField* uncertain, const std::filesystem::path& folder) {
  const double wavelength_nm = settings.wavelength_nm.value_or(eye.reference_wavelength_nm);
  const std::vector<Seen> field = field_of(eye, settings, wavelength_nm);
  Json json = columns_of(eye, field);
  if (uncertain != nullptr) add_ellipses(json, field, *uncertain, wavelength_nm);
  require_on_retina(eye, landmarks);
  const std::vector<Placed> marks = placed(eye, landmarks);
  json["eye"] = eye.name;
  json["wavelength_nm"] = wavelength_nm;
  json["landmarks"] = landmarks_json(eye, marks, wavelength_nm);
  json["distances"] = distances_json(eye, marks);
  write_json(folder / "visual-field.json", json);
}

}  // namespace emmetrope::raytrace
