#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "raytrace/picture/spectrum.hpp"
#include "raytrace/tracer/tracer.hpp"

namespace emmetrope::raytrace {

/// Green as an sRGB picture holds it, 0 to 255 in whole numbers.
inline std::vector<double> grey_levels(const LinearImage& image) {
  std::vector<double> levels;
  for (std::size_t i = 1; i < image.values.size(); i += 3)
    levels.push_back(std::round(255 * srgb_encoded(std::clamp<double>(image.values[i], 0, 1))));
  return levels;
}

/// Mean squared difference.
inline double msd(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return sum / static_cast<double>(a.size());
}

/// Structural similarity, Wang, Bovik, Sheikh and Simoncelli (IEEE Trans. Image Process. 13, 600, 2004):
/// Gaussian window of 11 pixels and 1.5 standard deviation, K1 = 0.01, K2 = 0.03, mean over all places where
/// the window fits.
inline double ssim(const std::vector<double>& a, const std::vector<double>& b, int width, int height) {
  constexpr int size = 11, half = size / 2;
  std::array<double, size> window{};
  double total = 0;
  for (int i = 0; i < size; ++i) total += window[i] = std::exp(-(i - half) * (i - half) / (2 * 1.5 * 1.5));
  for (double& w : window) w /= total;
  const auto blurred = [&](const auto& value) {  // where the window fits
    std::vector<double> across(static_cast<std::size_t>(width) * height), result(across.size());
    for (int y = 0; y < height; ++y)
      for (int x = half; x < width - half; ++x)
        for (int i = 0; i < size; ++i) across[y * width + x] += window[i] * value(y * width + x + i - half);
    for (int y = half; y < height - half; ++y)
      for (int x = half; x < width - half; ++x)
        for (int i = 0; i < size; ++i)
          result[y * width + x] += window[i] * across[(y + i - half) * width + x];
    return result;
  };
  const auto ma = blurred([&](int i) { return a[i]; }), mb = blurred([&](int i) { return b[i]; }),
             aa = blurred([&](int i) { return a[i] * a[i]; }),
             bb = blurred([&](int i) { return b[i] * b[i]; }),
             ab = blurred([&](int i) { return a[i] * b[i]; });
  constexpr double c1 = 0.01 * 255 * 0.01 * 255, c2 = 0.03 * 255 * 0.03 * 255;
  double sum = 0;
  int count = 0;
  for (int y = half; y < height - half; ++y)
    for (int x = half; x < width - half; ++x) {
      const std::size_t i = static_cast<std::size_t>(y) * width + x;
      sum += (2 * ma[i] * mb[i] + c1) * (2 * (ab[i] - ma[i] * mb[i]) + c2) /
             ((ma[i] * ma[i] + mb[i] * mb[i] + c1) * (aa[i] - ma[i] * ma[i] + bb[i] - mb[i] * mb[i] + c2));
      ++count;
    }
  return sum / count;
}

/// Share of the pixels that differ from one of their four neighbours by more than `step`.
inline double edge_share(const std::vector<double>& a, int width, int height, double step) {
  int edges = 0;
  for (int y = 1; y + 1 < height; ++y)
    for (int x = 1; x + 1 < width; ++x) {
      const int i = y * width + x;
      double largest = 0;
      for (const int d : {-1, 1, -width, width}) largest = std::max(largest, std::abs(a[i] - a[i + d]));
      edges += largest > step;
    }
  return edges / static_cast<double>((width - 2) * (height - 2));
}

/// Gullstrand's eye at full accommodation on a chart in its focus, at the vertex counts of Wei, Patkar and
/// Pai (2014).
struct PaperValidation {
  EyeModel eye = make_eye("gullstrand", {10.87, {}, 3.0});
  std::shared_ptr<const Scene> scene;
  TraceSettings settings;
  explicit PaperValidation(int pixels, int samples,
                           const std::string& chart = "letters:logmar=1.3,distance_mm=92,extent_deg=22")
      : scene(make_scene(chart)) {
    settings.grid = {pixels, pixels, 6.0 * pixels / 500, 6.0 * pixels / 500, {0, 0}};
    settings.samples = samples;
    settings.wavelength_nm = 589.3;
    settings.vertices = {973, 1516, 799, 799, 565, 723, 613};
    settings.verbosity.quiet = true;
  }
  TraceResult image(const Tracer& tracer, Representation representation, int seed,
                    Method method = Method::pupil) {
    settings.representation = representation;
    settings.seed = seed;
    settings.method = method;
    return tracer.trace(eye, *scene, settings);
  }
};

}  // namespace emmetrope::raytrace
