#include "tests/benchmarks/benchmark_baselines.hpp"
#include "tests/support/embree.hpp"

#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <thread>

namespace emmetrope::raytrace {
namespace {

constexpr int pixel_floats = 12;

struct Ray32 {
  float x, y, z, L, M, N;
};

std::uint32_t scramble(std::uint32_t h) {
  h = h * 747796405U + 2891336453U;
  const std::uint32_t w = ((h >> ((h >> 28U) + 4U)) ^ h) * 277803737U;
  return (w >> 22U) ^ w;
}

Ray32 start(const float* pixel, float aim_z, std::uint32_t n, std::uint32_t shift_1, std::uint32_t shift_2) {
  const float u1 = static_cast<float>((n * 3242174889U + shift_1) >> 8U) * (1.F / 16777216.F);
  const float u2 = static_cast<float>((n * 2447445414U + shift_2) >> 8U) * (1.F / 16777216.F);
  const float rho = std::sqrt(u1), angle = 6.2831853F * u2, c = rho * std::cos(angle),
              s = rho * std::sin(angle);
  const float dx = pixel[3] + pixel[5] * c + pixel[6] * s - pixel[0],
              dy = pixel[4] + pixel[7] * c + pixel[8] * s - pixel[1], dz = aim_z - pixel[2],
              scale = 1 / std::sqrt(dx * dx + dy * dy + dz * dz);
  return {pixel[0], pixel[1], pixel[2], dx * scale, dy * scale, dz * scale};
}

/// Bilinear, zero outside.
float look(const Ray32& r, const std::vector<float>& texture, int size, float texels_per_mm,
           float distance_mm) {
  const float t = (distance_mm - r.z) / r.N;
  const float half = 0.5F * static_cast<float>(size) - 0.5F, last = static_cast<float>(size) - 1.001F;
  const float u = std::min(std::max(half - texels_per_mm * (r.x + t * r.L), 0.F), last);
  const float v = std::min(std::max(half - texels_per_mm * (r.y + t * r.M), 0.F), last);
  const int iu = static_cast<int>(u), iv = static_cast<int>(v);
  const float fu = u - static_cast<float>(iu), fv = v - static_cast<float>(iv);
  const float* p = &texture[static_cast<std::size_t>(iv) * size + iu];
  return (p[0] * (1 - fu) + p[1] * fu) * (1 - fv) + (p[size] * (1 - fu) + p[size + 1] * fu) * fv;
}

bool stopped(const Ray32& r, const BaselineSphere& s, float stop_z) {
  const float t = (stop_z - r.z) / r.N, x = r.x + t * r.L, y = r.y + t * r.M;
  return x * x + y * y > s.stop_radius_mm * s.stop_radius_mm;
}

/// Mean over all rays of what `trace` makes of one: pixels are dealt out row-wise to the threads.
double over_pixels(const std::vector<float>& pixels, float aim_z, int samples, int threads,
                   const std::function<double(const float*, std::uint32_t, std::uint32_t)>& trace_pixel) {
  (void)aim_z;
  const int count = static_cast<int>(pixels.size()) / pixel_floats;
  std::vector<double> sums(threads, 0);
  std::vector<std::thread> workers;
  for (int t = 0; t < threads; ++t)
    workers.emplace_back([&, t] {
      for (int i = t; i < count; i += threads) {
        const std::uint32_t shift_1 = scramble(i), shift_2 = scramble(shift_1);
        sums[t] += trace_pixel(&pixels[static_cast<std::size_t>(i) * pixel_floats], shift_1, shift_2);
      }
    });
  for (auto& worker : workers) worker.join();
  double sum = 0;
  for (const double part : sums) sum += part;
  return sum / count / samples;
}

/// Refraction with a unit normal along the ray's own side.
bool refract(Ray32& r, float nx, float ny, float nz, float ratio) {
  const float c = nx * r.L + ny * r.M + nz * r.N, k = 1 - ratio * ratio * (1 - c * c);
  if (k < 0) return false;
  const float g = std::sqrt(k) - ratio * c;
  r.L = ratio * r.L + g * nx;
  r.M = ratio * r.M + g * ny;
  r.N = ratio * r.N + g * nz;
  return true;
}

}  // namespace

double scalar_spheres(const std::vector<BaselineSphere>& spheres, const std::vector<float>& pixels,
                      float aim_z, int samples, const std::vector<float>& texture, int texture_size,
                      float texels_per_mm, float distance_mm, int threads) {
  return over_pixels(
      pixels, aim_z, samples, threads, [&](const float* pixel, std::uint32_t shift_1, std::uint32_t shift_2) {
        float sum = 0;
        for (int n = 0; n < samples; ++n) {
          Ray32 r = start(pixel, aim_z, n, shift_1, shift_2);
          bool alive = true;
          for (const auto& s : spheres) {
            if (s.stop_radius_mm > 0) alive = alive && !stopped(r, s, s.vertex_z_mm);
            const float z = r.z - s.vertex_z_mm, c = s.curvature_per_mm;
            const float g = r.N + c * (r.x * r.L + r.y * r.M + z * r.N),
                        f = c * (r.x * r.x + r.y * r.y + z * z) + 2 * z;
            const float e = std::max(0.F, g * g - c * f), nd = std::sqrt(e), t = -f / (g + nd);
            r.x += t * r.L;
            r.y += t * r.M;
            r.z += t * r.N;
            alive = refract(r, c * r.x, c * r.y, 1 + c * (r.z - s.vertex_z_mm), s.ratio) && alive;
          }
          if (alive) sum += look(r, texture, texture_size, texels_per_mm, distance_mm);
        }
        return static_cast<double>(sum);
      });
}

double embree_sheets(const std::vector<TriangleMesh>& sheets, const std::vector<BaselineSphere>& system,
                     const std::vector<float>& pixels, float aim_z, int samples,
                     const std::vector<float>& texture, int texture_size, float texels_per_mm,
                     float distance_mm, int threads) {
  RTCDevice device = rtcNewDevice(nullptr);
  std::vector<RTCScene> scenes;
  std::vector<std::vector<std::array<float, 3>>> normals;
  for (const auto& sheet : sheets) {
    RTCScene scene = rtcNewScene(device);
    rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(
        geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), sheet.vertices.size()));
    for (std::size_t i = 0; i < sheet.vertices.size(); ++i)
      for (int c = 0; c < 3; ++c) vertices[3 * i + c] = static_cast<float>(sheet.vertices[i][c]);
    auto* indices = static_cast<unsigned*>(rtcSetNewGeometryBuffer(
        geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(unsigned), sheet.triangles.size()));
    for (std::size_t i = 0; i < sheet.triangles.size(); ++i)
      for (int c = 0; c < 3; ++c) indices[3 * i + c] = static_cast<unsigned>(sheet.triangles[i][c]);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(scene);
    scenes.push_back(scene);
    normals.emplace_back();
    for (const auto& n : sheet.normals)
      normals.back().push_back(
          {static_cast<float>(n.x()), static_cast<float>(n.y()), static_cast<float>(n.z())});
  }
  const double mean = over_pixels(
      pixels, aim_z, samples, threads, [&](const float* pixel, std::uint32_t shift_1, std::uint32_t shift_2) {
        float sum = 0;
        for (int sample = 0; sample < samples; ++sample) {
          Ray32 r = start(pixel, aim_z, sample, shift_1, shift_2);
          bool alive = true;
          for (std::size_t k = 0; k < scenes.size() && alive; ++k) {
            if (system[k].stop_radius_mm > 0 && stopped(r, system[k], system[k].vertex_z_mm)) {
              alive = false;
              break;
            }
            RTCRayHit hit{};
            hit.ray.org_x = r.x;
            hit.ray.org_y = r.y;
            hit.ray.org_z = r.z;
            hit.ray.dir_x = r.L;
            hit.ray.dir_y = r.M;
            hit.ray.dir_z = r.N;
            hit.ray.tfar = std::numeric_limits<float>::infinity();
            hit.ray.mask = ~0U;
            hit.hit.geomID = RTC_INVALID_GEOMETRY_ID;
            test::nearest_hit(scenes[k], hit);
            if (hit.hit.geomID == RTC_INVALID_GEOMETRY_ID) {
              alive = false;
              break;
            }
            const auto& t = sheets[k].triangles[hit.hit.primID];
            const auto &a = normals[k][t[0]], &b = normals[k][t[1]], &c = normals[k][t[2]];
            const float u = hit.hit.u, v = hit.hit.v, w = 1 - u - v;
            float nx = w * a[0] + u * b[0] + v * c[0], ny = w * a[1] + u * b[1] + v * c[1],
                  nz = w * a[2] + u * b[2] + v * c[2];
            const float scale = 1 / std::sqrt(nx * nx + ny * ny + nz * nz);
            r.x += hit.ray.tfar * r.L;
            r.y += hit.ray.tfar * r.M;
            r.z += hit.ray.tfar * r.N;
            alive = refract(r, nx * scale, ny * scale, nz * scale, system[k].ratio);
          }
          if (alive) sum += look(r, texture, texture_size, texels_per_mm, distance_mm);
        }
        return static_cast<double>(sum);
      });
  for (RTCScene scene : scenes) rtcReleaseScene(scene);
  rtcReleaseDevice(device);
  return mean;
}

}  // namespace emmetrope::raytrace
