#include "raytrace/tracer/device_scene.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "pipeline/base/error.hpp"

namespace emmetrope::raytrace {
namespace {

float bits(std::size_t value) {
  const auto integer = static_cast<std::int32_t>(value);
  float result = 0;
  std::memcpy(&result, &integer, sizeof result);
  return result;
}

float luminance(const float* rgb) { return 0.2126F * rgb[0] + 0.7152F * rgb[1] + 0.0722F * rgb[2]; }

std::uint32_t quantised(float value, float largest) {
  return static_cast<std::uint32_t>(std::clamp(value, 0.F, 1.F) * largest + 0.5F);
}

/// The last row is repeated once, so that a bilinear look-up at the rim reads valid texels; one more texel is
/// what the last one's right neighbour would be.
void append(std::vector<std::uint32_t>& texels, const Texture& texture, int channels) {
  const std::size_t width = texture.width, first = texels.size();
  const bool colour = texture.channels == 3;
  texels.resize(first + width * (texture.height + 1) + 1);
  std::uint32_t* to = texels.data() + first;
  for (int row = 0; row <= texture.height; ++row, to += width) {
    const float* t = &texture.values[std::min(row, texture.height - 1) * width * texture.channels];
    if (channels == 1) {
      const auto grey = [&](std::size_t x) { return quantised(colour ? luminance(t + 3 * x) : t[x], 65535); };
      std::uint32_t next = grey(0);
      for (std::size_t x = 0; x < width; ++x) {
        const std::uint32_t own = next;
        next = x + 1 < width ? grey(x + 1) : own;
        to[x] = own | next << 16U;
      }
    } else {
      for (std::size_t x = 0; x < width; ++x, t += texture.channels)
        to[x] = quantised(t[0], 2047) | quantised(t[colour ? 1 : 0], 2047) << 11U |
                quantised(t[colour ? 2 : 0], 1023) << 22U;
    }
  }
}

void append(std::vector<float>& planes, const TexturedPlane& plane, const Eigen::Isometry3d& eye_from_scene,
            std::size_t first_texel) {
  const Eigen::Matrix3d turn = eye_from_scene.linear();
  const Eigen::Vector3d centre =
      plane.at_infinity ? Eigen::Vector3d(turn * plane.centre_mm) : eye_from_scene * plane.centre_mm;
  const Eigen::Vector3d right = turn * plane.right_mm, up = turn * plane.up_mm;
  const Eigen::Vector3d normal = right.cross(up).normalized();
  // Along the plane and free of the other edge, should the two not be at right angles.
  const Eigen::Vector3d across_up = up.cross(normal), across_right = normal.cross(right);
  const Eigen::Vector3d a = across_up / across_up.dot(right) * (0.5 * plane.texture->width);
  const Eigen::Vector3d b = -across_right / across_right.dot(up) * (0.5 * plane.texture->height);
  const double a0 = 0.5 * plane.texture->width - 0.5 - a.dot(centre),
               b0 = 0.5 * plane.texture->height - 0.5 - b.dot(centre);
  for (int i = 0; i < 3; ++i) planes.push_back(static_cast<float>(normal[i]));
  planes.push_back(static_cast<float>(normal.dot(centre)));
  for (int i = 0; i < 3; ++i) planes.push_back(static_cast<float>(a[i]));
  planes.push_back(static_cast<float>(a0));
  for (int i = 0; i < 3; ++i) planes.push_back(static_cast<float>(b[i]));
  planes.push_back(static_cast<float>(b0));
  planes.push_back(plane.at_infinity ? 0.F : 1.F);
  planes.push_back(static_cast<float>(plane.texture->width - 1));
  planes.push_back(static_cast<float>(plane.texture->height - 1));
  planes.push_back(bits(plane.texture->width));
  planes.push_back(bits(first_texel));
  planes.insert(planes.end(), 3, 0.F);
}

}  // namespace

DeviceScene make_device_scene(const Scene& scene, const Eigen::Isometry3d& eye_from_scene,
                              bool monochromatic) {
  DeviceScene result;
  const auto is_grey = [](const Eigen::Vector3d& c) { return c.x() == c.y() && c.y() == c.z(); };
  bool coloured = !is_grey(scene.background) || !is_grey(scene.ambient);
  for (const auto& plane : scene.planes) coloured |= plane.texture->channels == 3;
  for (const auto& light : scene.lights) coloured |= !is_grey(light.colour);
  for (const auto& mesh : scene.meshes)
    coloured |= !is_grey(mesh.material.colour) || !mesh.colours.empty() ||
                (mesh.material.texture && mesh.material.texture->channels == 3);
  result.channels = coloured && !monochromatic ? 3 : 1;
  result.plane_count = static_cast<int>(scene.planes.size());
  const auto store = [&](const Texture& texture) {
    if (result.texels.size() > (std::size_t{1} << 30U))
      throw input_error("the scene's textures hold more than 2^30 texels", "use smaller pictures");
    const std::size_t first = result.texels.size();
    append(result.texels, texture, result.channels);
    return first;
  };
  for (const auto& plane : scene.planes) append(result.planes, plane, eye_from_scene, store(*plane.texture));
  if (!scene.meshes.empty())
    result.meshes = make_device_meshes(scene, eye_from_scene, result.channels, store);
  const Eigen::Vector3f background = scene.background.cast<float>();
  if (result.channels == 1)
    result.background = {luminance(background.data())};
  else
    result.background = {background.x(), background.y(), background.z()};
  return result;
}

}  // namespace emmetrope::raytrace
