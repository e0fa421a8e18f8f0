// Rays a second of every way through the eye, with scalar C++ and Embree in the same run:
// docs/performance.md. emmetrope-benchmark [--samples N] [--rounds N] [--vertices N] [--device D] [--threads
// N]: one JSON document.
#include <CLI/CLI.hpp>
#include <ctime>
#include <iostream>
#include <thread>

#include "benchmark_baselines.hpp"
#include "pipeline/base/json.hpp"
#include "raytrace/scene/scene_model.hpp"
#include "raytrace/spectacle/spectacle.hpp"
#include "raytrace/tracer/pupil_aim.hpp"
#include "raytrace/tracer/retina_pixels.hpp"
#include "raytrace/tracer/sheet_mesh.hpp"
#include "raytrace/tracer/tracer.hpp"

using namespace emmetrope;
using namespace emmetrope::raytrace;

namespace {

constexpr double distance_mm = 1000;

double cpu_s() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

/// Best of several rounds: rays a second by the wall, and by the processor time of all threads over the
/// number of threads, which a busy machine does not slow.
struct Rate {
  double wall = 0, cpu = 0, result = 0;
};
template <typename Run>
Rate measure(int rounds, int threads, double rays, const Run& run) {
  Rate best;
  for (int round = 0; round < rounds; ++round) {
    const auto begin = std::chrono::steady_clock::now();
    const double cpu = cpu_s();
    best.result = run();
    const double used = cpu_s() - cpu;
    best.wall = std::max(
        best.wall, rays / std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
    best.cpu = std::max(best.cpu, rays / used * threads);
  }
  return best;
}

/// Gullstrand's spheres in the order of a ray from the retina.
std::vector<BaselineSphere> baseline_of(const EyeModel& eye) {
  std::vector<BaselineSphere> result;
  float stop = 0;
  for (int i = static_cast<int>(eye.surfaces.size()) - 2; i >= 0; --i) {
    const Surface& s = eye.surfaces[i];
    if (s.is_stop()) {
      stop = static_cast<float>(s.stop_diameter_mm / 2);
      continue;
    }
    int before = i - 1;
    while (before >= 0 && eye.surfaces[before].is_stop()) --before;
    const double front = before < 0 ? 1 : eye.medium(eye.surfaces[before].medium_after).index;
    result.push_back({static_cast<float>(-s.position_mm),
                      static_cast<float>(s.shape->vertex_curvature()(0, 0)),
                      static_cast<float>(eye.medium(s.medium_after).index / front), 0});
    if (stop > 0 && result.size() > 1) {
      result[result.size() - 1].stop_radius_mm = 0;
      stop = 0;
    }
  }
  // The iris stands at the lens front: it is tested before that surface is met.
  for (std::size_t k = 0; k < result.size(); ++k)
    if (std::abs(-result[k].vertex_z_mm - eye.stop()->position_mm) < 1e-6)
      result[k].stop_radius_mm = static_cast<float>(eye.stop()->stop_diameter_mm / 2);
  return result;
}

double mean_of(const LinearImage& image) {
  double sum = 0;
  for (const float v : image.values) sum += v;
  return sum / static_cast<double>(image.values.size());
}

}  // namespace

int main(int argc, char** argv) {
  int samples = 64, rounds = 3, vertices = 800, threads = 0;
  std::string device;
  CLI::App app("Rays a second of every way through the eye");
  app.add_option("--samples", samples, "Rays a pixel")->capture_default_str();
  app.add_option("--rounds", rounds, "The best of so many")->capture_default_str();
  app.add_option("--vertices", vertices, "A surface")->capture_default_str();
  app.add_option("--threads", threads, "0: all cores");
  app.add_option("--device", device, "OpenCL device");
  CLI11_PARSE(app, argc, argv);
  if (threads == 0) threads = static_cast<int>(std::thread::hardware_concurrency());

  const Tracer tracer(device, threads);
  const EyeModel eye = make_eye("gullstrand", {0, {}, 4.0});
  const auto scene = make_scene("letters:distance_mm=1000,extent_deg=24");
  TraceSettings settings;
  settings.samples = samples;
  settings.wavelength_nm = 589.3;
  settings.vertices = {vertices};
  settings.verbosity.quiet = true;
  const double rays = 500.0 * 500.0 * samples;
  Json answer{
      {"device", tracer.device_name()}, {"threads", threads}, {"samples", samples}, {"vertices", vertices}};
  Json& rates = answer["million_rays_per_s"];
  const auto report = [&](const std::string& name, const Rate& rate) {
    rates[name] = {{"cpu_normalised", rate.cpu / 1e6}, {"wall", rate.wall / 1e6}, {"mean", rate.result}};
    std::cerr << name << ": " << rate.cpu / 1e6 << " M/s by processor time, " << rate.wall / 1e6
              << " by the wall\n";
    return rate.cpu;
  };
  const auto trace = [&](const std::string& name, const EyeModel& e,
                         std::optional<Representation> representation, int sheet_vertices,
                         const std::vector<CurvatureTangent>& tangents = {}) {
    TraceSettings s = settings;
    s.representation = representation;
    s.vertices = {sheet_vertices};
    tracer.trace(e, *scene, s, tangents);  // kernels compiled
    return report(name, measure(rounds, threads, rays,
                                [&] { return mean_of(tracer.trace(e, *scene, s, tangents).image); }));
  };

  const double analytic = trace("analytic", eye, Representation::analytic, vertices);
  const double smooth = trace("smooth", eye, Representation::smooth, vertices);
  const double triangles = trace("triangles", eye, Representation::triangles, vertices);
  const double smooth_12800 = trace("smooth 12800 vertices", eye, Representation::smooth, 12800);
  const double triangles_12800 = trace("triangles 12800 vertices", eye, Representation::triangles, 12800);
  const EyeModel glasses = with_thin_lens(eye, {-1, 0.25, 0}, 12);
  const double with_lens = trace("analytic with spectacle", glasses, Representation::analytic, vertices);
  const double derivative =
      trace("analytic with spectacle and one derivative", glasses, Representation::analytic, vertices,
            {{"spectacle_back", Eigen::Matrix2d::Identity() * -2e-3}});

  // The baselines take the same rays, pixels and texture.
  const PupilAim aim(eye, settings.grid, 589.3);
  const RetinaPixels pixels = make_pixels(eye, settings.grid, aim, threads);
  const TexturedPlane& plane = scene->planes.front();
  const Texture& texture = *plane.texture;
  const float texels_per_mm = static_cast<float>(texture.width / (2 * plane.right_mm.norm()));
  const auto system = baseline_of(eye);
  const auto z = static_cast<float>(aim.plane_z_mm());
  const double scalar = report("scalar C++, spheres", measure(rounds, threads, rays, [&] {
                                 return scalar_spheres(system, pixels.values, z, samples, texture.values,
                                                       texture.width, texels_per_mm, distance_mm, threads);
                               }));
  std::vector<TriangleMesh> sheets;
  for (int i = static_cast<int>(eye.surfaces.size()) - 2; i >= 0; --i) {
    const Surface& s = eye.surfaces[i];
    if (s.is_stop()) continue;
    TriangleMesh sheet = sheet_mesh(*s.shape, default_semi_diameter_mm(s), vertices, 0.25);
    for (auto& vertex : sheet.vertices) vertex.z() -= s.position_mm;
    sheets.push_back(std::move(sheet));
  }
  const int few = std::min(samples, 16);
  const double embree = report("Embree rtcIntersect1", measure(rounds, threads, 250000.0 * few, [&] {
                                 return embree_sheets(sheets, system, pixels.values, z, few, texture.values,
                                                      texture.width, texels_per_mm, distance_mm, threads);
                               }));
  answer["ratios"] = {
      {"analytic over scalar C++", analytic / scalar},
      {"smooth over Embree", smooth / embree},
      {"triangles over Embree", triangles / embree},
      {"smooth: cost of 12800 vertices over " + std::to_string(vertices), smooth / smooth_12800},
      {"triangles: cost of 12800 vertices over " + std::to_string(vertices), triangles / triangles_12800},
      {"cost of one derivative", with_lens / derivative}};
  std::cout << answer.dump(2) << "\n";
}
