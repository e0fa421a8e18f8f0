#pragma once
#include <Eigen/Core>
#include <array>
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

/// A mesh of triangles with its material.
struct SceneMesh {
  std::vector<Eigen::Vector3d> vertices_mm;
  std::vector<Eigen::Vector3d> normals;              ///< a unit vector each vertex, or none (flat faces)
  std::vector<Eigen::Vector2d> texture_coordinates;  ///< (0, 0) the texture's lower left, or none
  std::vector<std::array<int, 3>> triangles;
  Eigen::Vector3d diffuse{0.8, 0.8, 0.8};  ///< reflectance, linear; times the texture where there is one
  double specular = 0, shininess = 32;     ///< Phong
  std::shared_ptr<const Texture> texture;
};

struct Light {
  bool directional = false;
  Eigen::Vector3d position_mm{0, 1000,
                              0};   ///< of a point light; of a directional one the direction towards it
  Eigen::Vector3d colour{1, 1, 1};  ///< radiance of a white diffuse surface that faces it
  bool shadows = true;
};

/// What the eye looks at. Planes show their texture as it is (a print in even light, or a display); meshes
/// are lit.
class Scene {
 public:
  std::string name;
  std::vector<TexturedPlane> planes;
  std::vector<SceneMesh> meshes;
  std::vector<Light> lights;
  Eigen::Vector3d ambient{0.25, 0.25, 0.25};
  Eigen::Vector3d background{1, 1, 1};  ///< linear light where a ray meets nothing
};

}  // namespace emmetrope::raytrace
