#include "correction/sharpness/refraction_chart.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <random>

#include "pipeline/base/frames.hpp"
#include "raytrace/scene/scene_model.hpp"

namespace emmetrope::correction {
namespace {

constexpr int texels = 1024;  // 1 arcmin each; the tracer packs them anew for every image
constexpr double coarsest_cpd = 0.1, finest_cpd = 25;
/// Turned against the rows of the picture by a slope that no simple fraction comes near (1 / golden ratio):
/// parallel to them, points at some multiple of the texels' distance would all fall on like places between
/// texels, and the interpolation there would pass for more or less detail (1 % at three pixels to two
/// texels).
const double turn_rad = std::atan(2 / (1 + std::sqrt(5.0)));

/// What linear interpolation between texels leaves of a wave's amplitude, on average.
double left_by_interpolation(int signed_bin) {
  const double x = pi * signed_bin / texels;
  return x == 0 ? 1 : std::pow(std::sin(x) / x, 2);
}

}  // namespace

std::shared_ptr<const raytrace::Scene> refraction_chart(const Eigen::Vector3d& towards, double extent_deg,
                                                        std::uint64_t seed) {
  // White noise, filtered: the amplitude falls as f^-1.5 and ends at the finest frequency, steeply enough for
  // what an eye resolves to weigh the same when a lens magnifies it.
  std::mt19937_64 random(seed);
  cv::Mat noise(texels, texels, CV_32F);
  for (int row = 0; row < texels; ++row)
    for (int column = 0; column < texels; ++column)
      noise.at<float>(row, column) = static_cast<float>(random() >> 40U) / 16777216.0F - 0.5F;
  cv::Mat spectrum;
  cv::dft(noise, spectrum, cv::DFT_COMPLEX_OUTPUT);
  const auto signed_bin = [](int bin) { return bin <= texels / 2 ? bin : bin - texels; };
  const double degrees_per_texel = extent_deg / texels;
  for (int row = 0; row < texels; ++row)
    for (int column = 0; column < texels; ++column) {
      const double f_cpd = std::hypot(signed_bin(row), signed_bin(column)) / texels / degrees_per_texel;
      auto& value = spectrum.at<cv::Vec2f>(row, column);
      // Fixed modulus, random phase: the texture's spectrum is then exactly the same in every direction.
      const auto modulus = std::hypot(value[0], value[1]);
      const double wanted =
          f_cpd < coarsest_cpd
              ? 0
              : std::pow(f_cpd, -1.5) * std::exp(-std::pow(f_cpd / finest_cpd, 8)) /
                    (left_by_interpolation(signed_bin(row)) * left_by_interpolation(signed_bin(column)));
      value *= modulus > 0 ? static_cast<float>(wanted) / modulus : 0.0F;
    }
  cv::Mat pattern;
  cv::dft(spectrum, pattern, cv::DFT_INVERSE | cv::DFT_REAL_OUTPUT | cv::DFT_SCALE);
  cv::Scalar mean, deviation;
  cv::meanStdDev(pattern, mean, deviation);

  raytrace::Texture texture;
  texture.width = texture.height = texels;
  texture.values.reserve(static_cast<std::size_t>(texels) * texels);
  const double contrast = 0.2;  // four standard deviations stay between black and white
  for (int row = 0; row < texels; ++row)
    for (int column = 0; column < texels; ++column)
      texture.values.push_back(static_cast<float>(
          std::clamp(0.5 + contrast * 0.5 * pattern.at<float>(row, column) / deviation[0], 0.0, 1.0)));

  const double half = std::tan(extent_deg / 2 * degree);
  raytrace::TexturedPlane plane;
  plane.at_infinity = true;
  plane.centre_mm = Eigen::Vector3d::UnitZ();
  const double along = half * std::cos(turn_rad), across = half * std::sin(turn_rad);
  plane.right_mm = {-along, across, 0};
  plane.up_mm = {across, along, 0};
  plane.texture = std::make_shared<const raytrace::Texture>(std::move(texture));
  auto scene = std::make_shared<raytrace::Scene>();
  scene->name = "refraction chart";
  scene->background = Eigen::Vector3d::Constant(0.5);
  scene->planes.push_back(turned_towards(towards, std::move(plane)));
  return scene;
}

raytrace::TexturedPlane turned_towards(const Eigen::Vector3d& direction, raytrace::TexturedPlane plane) {
  const Eigen::Vector3d ahead = direction.normalized(),
                        left = Eigen::Vector3d::UnitY().cross(ahead).normalized();
  Eigen::Matrix3d turn;
  turn << left, ahead.cross(left), ahead;
  for (Eigen::Vector3d* side : {&plane.centre_mm, &plane.right_mm, &plane.up_mm}) *side = turn * *side;
  return plane;
}

}  // namespace emmetrope::correction
