#pragma once
#include <Eigen/Core>
#include <array>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "raytrace/scene/sampled_spectrum.hpp"
#include "raytrace/scene/scene.hpp"

namespace emmetrope::raytrace {

/// Linear light, 0 to 1 of the display's white; row after row from the top, channels interleaved, sRGB
/// primaries.
struct Texture {
  int width = 0, height = 0;
  int channels = 1;  ///< 1: achromatic, 3: red, green, blue
  std::vector<float> values;
};

/// Spectral radiance, W / (m^2 sr nm), at rising wavelengths: a page of one channel each, of the same size.
struct SpectralPicture {
  std::vector<double> wavelength_nm;
  std::vector<Texture> pages;
  /// Linear between pages, 0 outside them.
  Texture at(double nm) const;
  /// As a display shows it, linear sRGB, the strongest channel of all texels 1; what no display shows is cut to its gamut.
  Texture coloured() const;
};

/// A flat picture in space: centre +- right +- up, mm in the eye's frame before gaze. The texture's left
/// column lies at centre - right, its top row at centre + up, as the patient sees it.
struct TexturedPlane {
  Eigen::Vector3d centre_mm{0, 0, 1000};
  Eigen::Vector3d right_mm{-100, 0, 0};  ///< half the width, towards the patient's right (eye -x)
  Eigen::Vector3d up_mm{0, 100, 0};      ///< half the height
  bool at_infinity = false;  ///< the three vectors are then directions: tangents of visual angle, z = 1
  std::shared_ptr<const Texture> texture;
  std::shared_ptr<const SpectralPicture>
      spectrum;                        ///< what the texture shows in colours; null where only they are known
  Eigen::Vector3d motion_mm{0, 0, 0};  ///< displacement during the exposure, about the place above
};

/// How a surface answers light: Phong (1975), with the light that comes from everywhere.
struct Material {
  Eigen::Vector3d colour{1, 1, 1};                  ///< linear; share of the light that comes back
  std::shared_ptr<const Texture> texture;           ///< times the colour; may be null
  double specular = 0;                              ///< strength of the highlight
  double shininess = 30;                            ///< its exponent
  std::optional<SampledSpectrum> reflectance = {};  ///< in place of the colour, where it is known
};

/// Triangles of one material, in the scene's frame.
struct MeshObject {
  std::vector<Eigen::Vector3d> positions_mm, normals;
  std::vector<Eigen::Vector3d> colours;              ///< linear, times the material's; a vertex's, or none
  std::vector<Eigen::Vector2d> texture_coordinates;  ///< from the texture's lower left, 1 its size; or none
  std::vector<std::array<int, 3>> triangles;
  Material material;
  Eigen::Vector3d motion_mm{0, 0, 0};
};

struct Light {
  bool directional = false;
  /// Where it stands, or (directional) the unit vector towards it.
  Eigen::Vector3d at{0, 0, 0};
  Eigen::Vector3d colour{1, 1, 1};  ///< linear: what a white surface that faces it shows
  double reference_mm = 0;  ///< of a point light: where it shows that; further away it falls with the square
  std::optional<SampledSpectrum> radiance = {};  ///< of that surface, W / (m^2 sr nm), where it is known
};

/// What the eye looks at: flat pictures that show their texture as it is (a print in even light, or a
/// display), and meshes under lights.
class Scene {
 public:
  std::string name;
  std::vector<std::filesystem::path> files;  ///< that were read to make it: models, their materials, pictures
  std::vector<TexturedPlane> planes;         ///< the nearest hides what is behind it
  std::vector<MeshObject> meshes;
  std::vector<Light> lights;            ///< they light meshes only; meshes cast shadows on meshes
  Eigen::Vector3d ambient{1, 1, 1};     ///< light from everywhere on meshes
  Eigen::Vector3d background{1, 1, 1};  ///< linear light where a ray meets nothing
};

/// The scene a share `time` (-0.5 to 0.5) of the exposure away from its middle.
Scene at_time(const Scene& scene, double time);
bool moves(const Scene& scene);

}  // namespace emmetrope::raytrace
