#include "raytrace/scene/scene.hpp"

#include <array>
#include <filesystem>

#include "raytrace/scene/chart.hpp"
#include "raytrace/scene/scene_json.hpp"

namespace emmetrope::raytrace {
namespace {

/// Four letter charts side by side at 250, 500, 1000 and 4000 mm, each 8 degrees wide: what is near and far
/// at once.
Scene cards() {
  Scene scene;
  scene.name = "cards";
  scene.background = Eigen::Vector3d::Constant(0.6);
  const std::array<double, 4> distances_mm{250, 500, 1000, 4000};
  for (std::size_t i = 0; i < distances_mm.size(); ++i) {
    ChartSpec spec;
    spec.distance_mm = distances_mm[i];
    spec.logmar = 1.1;
    spec.logmar_given = true;
    spec.extent_deg = 8;
    TexturedPlane card = draw_chart(spec).planes.front();
    const double offset = 0.0787 * distances_mm[i];  // 4.5 degrees
    card.centre_mm.x() = i % 2 == 0 ? offset : -offset;
    card.centre_mm.y() = i < 2 ? offset : -offset;
    scene.planes.push_back(std::move(card));
  }
  return scene;
}

}  // namespace

std::shared_ptr<const Scene> make_scene(const std::string& name_or_file) {
  const std::filesystem::path path = name_or_file;
  if (path.extension() == ".json") return std::make_shared<const Scene>(read_scene(path));
  if (name_or_file == "cards") return std::make_shared<const Scene>(cards());
  return std::make_shared<const Scene>(draw_chart(parse_chart(name_or_file)));
}

}  // namespace emmetrope::raytrace
