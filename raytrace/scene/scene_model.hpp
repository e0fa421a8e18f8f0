#pragma once
#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "raytrace/scene/scene.hpp"

namespace emmetrope::raytrace {

/// Linear light, 0 to 1 of the display's white; row after row from the top, channels interleaved, sRGB
/// primaries.
struct Texture {
  int width = 0, height = 0;
  int channels = 1;  ///< 1: achromatic, 3: red, green, blue
  std::vector<float> values;
};

/// A flat picture in space: centre +- right +- up, mm in the eye's frame before gaze. The texture's left
/// column lies at centre - right, its top row at centre + up, as the patient sees it.
struct TexturedPlane {
  Eigen::Vector3d centre_mm{0, 0, 1000};
  Eigen::Vector3d right_mm{-100, 0, 0};  ///< half the width, towards the patient's right (eye -x)
  Eigen::Vector3d up_mm{0, 100, 0};      ///< half the height
  bool at_infinity = false;  ///< the three vectors are then directions: tangents of visual angle, z = 1
  std::shared_ptr<const Texture> texture;
};

/// What the eye looks at: flat pictures that show their texture as it is (a print in even light, or a
/// display).
class Scene {
 public:
  std::string name;
  std::vector<TexturedPlane> planes;    ///< the nearest hides what is behind it
  Eigen::Vector3d background{1, 1, 1};  ///< linear light where a ray meets nothing
};

}  // namespace emmetrope::raytrace
