#pragma once
#include <memory>
#include <string>

namespace emmetrope::raytrace {

/// What the eye looks at, in the eye's frame before gaze (z out of the eye, mm): textured planes and meshes,
/// and a background. The definition is the tracer's own; users make scenes by name or from scene.json.
class Scene;

/// \param name_or_file  "letters:logmar=0.3,distance_mm=6000", "dial", "siemens:...", or a scene.json
/// \throw Error (usage) for an unknown name or key, (input_invalid) for a bad file
std::shared_ptr<const Scene> make_scene(const std::string& name_or_file);

}  // namespace emmetrope::raytrace
