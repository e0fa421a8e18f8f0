#include "raytrace/scene/scene.hpp"

#include "raytrace/scene/chart.hpp"

namespace emmetrope::raytrace {

std::shared_ptr<const Scene> make_scene(const std::string& name_or_file) {
  return std::make_shared<const Scene>(draw_chart(parse_chart(name_or_file)));
}

}  // namespace emmetrope::raytrace
