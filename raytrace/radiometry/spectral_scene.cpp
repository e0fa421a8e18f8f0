#include "raytrace/radiometry/spectral_scene.hpp"

#include <algorithm>

#include "raytrace/radiometry/observer.hpp"

namespace emmetrope::raytrace {
namespace {

Texture grey(const Texture& texture, const Eigen::Vector3d& share) {
  if (texture.channels == 1) {  // white of every grade
    Texture result = texture;
    for (float& value : result.values) value *= static_cast<float>(share.sum());
    return result;
  }
  Texture result{texture.width, texture.height, 1, {}};
  result.values.reserve(texture.values.size() / 3);
  for (std::size_t i = 0; i < texture.values.size(); i += 3)
    result.values.push_back(static_cast<float>(share.x() * texture.values[i] +
                                               share.y() * texture.values[i + 1] +
                                               share.z() * texture.values[i + 2]));
  return result;
}

Eigen::Vector3d grey(const Eigen::Vector3d& colour, const Eigen::Vector3d& share) {
  return Eigen::Vector3d::Constant(share.dot(colour));
}

/// Whether anything shines in the display's light; surfaces do where they are lit.
bool shows_colours(const Scene& scene) {
  return !scene.background.isZero(0) || !scene.meshes.empty() ||
         std::any_of(scene.planes.begin(), scene.planes.end(),
                     [](const TexturedPlane& plane) { return !plane.spectrum; });
}

float brightest(const Texture& texture) {
  return *std::max_element(texture.values.begin(), texture.values.end());
}

}  // namespace

DisplayLight::DisplayLight(double luminance_cd_m2) {
  double luminance = 0;
  constexpr double step_nm = 1;
  for (double nm = 380; nm <= 780; nm += step_nm)
    luminance += photopic_efficacy * luminous_efficiency(nm) * primaries_.at(nm).sum() * step_nm;
  scale_ = luminance_cd_m2 / luminance;
}

Eigen::Vector3d DisplayLight::radiance(double wavelength_nm) const {
  return scale_ * primaries_.at(wavelength_nm);
}

SceneAtWavelength at_wavelength(const Scene& scene, const DisplayLight& display, double wavelength_nm) {
  const Eigen::Vector3d primaries = display.radiance(wavelength_nm);
  const double white = primaries.sum();
  // Pictures are held in steps of the unit: white is in it only where the scene shows any.
  SceneAtWavelength result{scene, shows_colours(scene) ? white : 0};
  std::vector<Texture> spectral(scene.planes.size());
  for (std::size_t i = 0; i < scene.planes.size(); ++i)
    if (scene.planes[i].spectrum) {
      spectral[i] = scene.planes[i].spectrum->at(wavelength_nm);
      result.unit = std::max<double>(result.unit, brightest(spectral[i]));
    }
  for (const Light& light : scene.lights)
    if (light.radiance) result.unit = std::max(result.unit, light.radiance->at(wavelength_nm));
  if (result.unit == 0) return result;
  const Eigen::Vector3d share = primaries / result.unit,
                        // Where the display has no light a colour is as grey as its mean.
      in_white = white > 0 ? Eigen::Vector3d(primaries / white) : Eigen::Vector3d::Constant(1.0 / 3);
  result.scene.background = grey(scene.background, share);
  for (std::size_t i = 0; i < scene.planes.size(); ++i) {
    Texture texture = std::move(spectral[i]);
    if (scene.planes[i].spectrum)
      for (float& value : texture.values) value /= static_cast<float>(result.unit);
    else
      texture = grey(*scene.planes[i].texture, share);
    result.scene.planes[i].texture = std::make_shared<const Texture>(std::move(texture));
  }
  // Lights carry the unit, surfaces their share of the light.
  result.scene.ambient = grey(scene.ambient, share);
  for (Light& light : result.scene.lights)
    light.colour = light.radiance ? Eigen::Vector3d::Constant(light.radiance->at(wavelength_nm) / result.unit)
                                  : grey(light.colour, share);
  for (MeshObject& mesh : result.scene.meshes) {
    Material& material = mesh.material;
    material.colour = material.reflectance
                          ? Eigen::Vector3d::Constant(material.reflectance->held_at(wavelength_nm))
                          : grey(material.colour, in_white);
    for (Eigen::Vector3d& colour : mesh.colours) colour = grey(colour, in_white);
    if (material.texture)
      material.texture = std::make_shared<const Texture>(grey(*material.texture, in_white));
  }
  return result;
}

}  // namespace emmetrope::raytrace
