#include <algorithm>
#include <cmath>

#include "pipeline/report/content/content.hpp"
#include "pipeline/report/content/content_tables.hpp"
#include "pipeline/report/figures/retina_map.hpp"

namespace emmetrope::report {

Section retina_section(const CaseData& data, Notes& notes) {
  Section section{"retina", "Back of the eye", {}};
  std::vector<std::pair<const EyeData*, RetinaMap>> maps;
  double largest_mm = 0;
  for (const auto& eye : data.eyes) {
    if (!eye.biometry.is_object()) continue;
    if (auto map = read_retina_map(eye.biometry.value("retina", Json::object()))) {
      largest_mm = std::max(largest_mm, map->largest_height_mm());
      maps.emplace_back(&eye, std::move(*map));
    }
  }
  // One scale for both eyes; 0.4 mm holds what real eyes have within 40 degrees (docs/evidence/real-scans.md).
  const double range_mm = std::max(0.4, std::ceil(largest_mm / 0.2) * 0.2);
  FigureRow row;
  row.caption =
      "Height of the inner surface of the back of the globe over the sphere nearest to it: red bulges outwards, blue lies "
      "flatter, grey cannot be told from the sphere. As the examiner sees it, about the pole, where the eye's axis meets "
      "it, which is not the fovea. N nasal, T temporal. Bulges narrower than 40 degrees are told too flat.";
  for (const auto& [eye, map] : maps) {
    Figure figure;
    figure.id = "retina-height-" + eye->id();
    figure.title = short_name(*eye) + ", height";
    figure.alt = "Colour map of the height of the back of the eye over its best-fit sphere";
    figure.width_px = 400;
    figure.height_px = 300;
    if (draw_retina_map(figure, map, range_mm, eye->laterality == Laterality::od))
      row.figures.push_back(std::move(figure));
    else
      notes.push_back(
          short_name(*eye) +
          ": the map of the back of the eye is missing, because gnuplot is not installed or failed.");
  }
  if (!row.figures.empty()) section.blocks.push_back({row, Paper::if_room});
  return section;
}

}  // namespace emmetrope::report
