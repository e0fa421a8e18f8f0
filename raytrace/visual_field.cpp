#include "raytrace/visual_field.hpp"

#include <cmath>

#include "pipeline/base/files.hpp"
#include "pipeline/base/frames.hpp"
#include "raytrace/retina/field_points.hpp"
#include "raytrace/retina/retina_arc.hpp"

namespace emmetrope::raytrace {

void write_visual_field(const EyeModel& eye, const TraceSettings& settings,
                        const std::filesystem::path& folder) {
  constexpr int step_deg = 5, most_deg = 125, meridian_step_deg = 15;
  RetinalGrid grid = settings.grid;
  grid.projection = Projection::visual_angle;
  const double wavelength_nm = settings.wavelength_nm.value_or(eye.reference_wavelength_nm);
  const FieldPoints points(eye, grid, wavelength_nm);
  Json eccentricity = Json::array(), meridian = Json::array(), direction = Json::array(),
       retina = Json::array(), arc = Json::array();
  for (int towards_deg = 0; towards_deg < 360; towards_deg += meridian_step_deg)
    for (int away_deg = towards_deg == 0 ? 0 : step_deg; away_deg <= most_deg; away_deg += step_deg) {
      const double angle = towards_deg * degree;
      const Eigen::Vector2d place = away_deg * Eigen::Vector2d(std::cos(angle), -std::sin(angle));
      const std::optional<RetinaPoint> point = points.at(place);
      if (!point) break;  // the eye sees no further
      const std::optional<double> arc_mm = retina_arc_mm(eye, point->position_mm);
      eccentricity.push_back(away_deg);
      meridian.push_back(towards_deg);
      direction.push_back(to_json_vector(points.direction(place)));
      retina.push_back(to_json_vector(point->position_mm));
      arc.push_back(arc_mm ? Json(*arc_mm) : Json(nullptr));
    }
  write_json(folder / "visual-field.json", {{"eye", eye.name},
                                            {"wavelength_nm", wavelength_nm},
                                            {"eccentricity_deg", eccentricity},
                                            {"meridian_deg", meridian},
                                            {"direction", direction},
                                            {"retina_mm", retina},
                                            {"retina_arc_mm", arc}});
}

}  // namespace emmetrope::raytrace
