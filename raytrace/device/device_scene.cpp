#include "raytrace/device/device_scene.hpp"

#include <algorithm>
#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/parallel.hpp"
#include "raytrace/system/int_bits.hpp"

namespace emmetrope::raytrace {
namespace {

float luminance(const float* rgb) { return 0.2126F * rgb[0] + 0.7152F * rgb[1] + 0.0722F * rgb[2]; }

std::uint32_t quantised(float value, float largest) {
  constexpr float half = 0.5F;  // to the nearest
  return static_cast<std::uint32_t>(std::clamp(value, 0.F, 1.F) * largest + half);
}

/// Texels as kernels/textures.cl reads them.
/// Grey: a texel holds its right and lower neighbours too, at the rim its own value in their place.
/// Coloured: the last row is repeated once and one more texel follows, so that a look-up at the rim reads
/// valid ones.
void append(std::vector<std::uint32_t>& texels, const Texture& texture, int channels, int threads) {
  const std::size_t width = texture.width, height = texture.height, first = texels.size();
  const bool colour = texture.channels == 3;
  const auto row_of = [&](std::size_t row) {
    return &texture.values[std::min(row, height - 1) * width * texture.channels];
  };
  if (channels == 3) {
    texels.resize(first + width * (height + 1) + 1);
    on_threads(threads, height + 1, [&](std::size_t row) {
      const float* t = row_of(row);
      std::uint32_t* to = texels.data() + first + row * width;
      for (std::size_t x = 0; x < width; ++x, t += texture.channels)
        to[x] = quantised(t[0], 2047) | quantised(t[colour ? 1 : 0], 2047) << 11U |
                quantised(t[colour ? 2 : 0], 1023) << 22U;
    });
    return;
  }
  texels.resize(first + 2 * width * height);
  const std::size_t wanted = 4 * static_cast<std::size_t>(threads),
                    rows_a_part = (height + wanted - 1) / wanted;
  on_threads(threads, (height + rows_a_part - 1) / rows_a_part, [&](std::size_t part) {
    // Own and right neighbour's grey of a row, and of the next.
    std::vector<std::uint32_t> pairs(width), below(width);
    const auto read = [&](std::size_t row, std::vector<std::uint32_t>& to) {
      const float* t = row_of(row);
      for (std::size_t x = 0; x < width; ++x) to[x] = quantised(colour ? luminance(t + 3 * x) : t[x], 65535);
      for (std::size_t x = 0; x < width; ++x) to[x] |= (to[std::min(x + 1, width - 1)] & 0xffffU) << 16U;
    };
    const std::size_t begin = part * rows_a_part, end = std::min(begin + rows_a_part, height);
    read(begin, below);
    for (std::size_t row = begin; row < end; ++row) {
      pairs.swap(below);
      read(row + 1, below);
      std::uint32_t* to = texels.data() + first + 2 * row * width;
      for (std::size_t x = 0; x < width; ++x) {
        to[2 * x] = pairs[x];
        to[2 * x + 1] = below[x];
      }
    }
  });
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
  planes.push_back(int_bits(plane.texture->width));
  planes.push_back(int_bits(first_texel));
  planes.insert(planes.end(), 3, 0.F);
}

}  // namespace

DeviceScene make_device_scene(const Scene& scene, const Eigen::Isometry3d& eye_from_scene, bool monochromatic,
                              int threads) {
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
    const std::size_t first = result.texels.size() / (result.channels == 1 ? 2 : 1);
    append(result.texels, texture, result.channels, threads);
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
