// Rays a second of every way through the eye, with scalar C++ and Embree in the same run:
// docs/evidence/performance.md. emmetrope-benchmark [--samples N] [--rounds N] [--vertices N] [--device D] [--threads
// N] [--large] [--only WAY...]: one JSON document.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <ctime>
#include <functional>
#include <iostream>
#include <thread>

#include "pipeline/base/json.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "raytrace/retina/pupil_aim.hpp"
#include "raytrace/retina/retina_pixels.hpp"
#include "raytrace/scene/scene_model.hpp"
#include "raytrace/spectacle/spectacle.hpp"
#include "raytrace/system/sheet_mesh.hpp"
#include "raytrace/tracer/tracer.hpp"
#include "tests/benchmarks/benchmark_baselines.hpp"

using namespace emmetrope;
using namespace emmetrope::raytrace;

namespace {

constexpr double distance_mm = 1000;

double cpu_s() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

/// One way to trace: its rays, and what a run of it gives.
struct Way {
  std::string name;
  double rays = 0;
  std::function<Json()> run;  ///< traces once; what else is worth reporting
  double wall = 0, cpu = 0;   ///< best so far, rays a second
  Json last{};
};

/// Runs all ways one after the other, several times, so that what disturbs the machine disturbs all of them;
/// keeps the best of each: rays a second by the wall, and by the processor time of all threads over the
/// number of threads, which a busy machine slows less.
void measure(std::vector<Way>& ways, int rounds, int threads) {
  for (Way& way : ways) way.run();  // kernels compiled
  for (int round = 0; round < rounds; ++round)
    for (Way& way : ways) {
      const auto begin = std::chrono::steady_clock::now();
      const double cpu = cpu_s();
      Json found = way.run();
      if (way.last.contains("trace_s") && way.last["trace_s"] < found["trace_s"])
        found["trace_s"] = way.last["trace_s"];
      way.last = std::move(found);
      const double used = cpu_s() - cpu;
      way.wall = std::max(
          way.wall,
          way.rays / std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
      way.cpu = std::max(way.cpu, way.rays / used * threads);
      std::cerr << way.name << ": " << way.cpu / 1e6 << " M/s by processor time, " << way.wall / 1e6
                << " by the wall\n";
    }
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

EyeModel with_thicker_lens(EyeModel eye, double by_mm) {
  eye.surface("lens_posterior").position_mm += by_mm;
  return eye;
}

double mean_of(const LinearImage& image) {
  double sum = 0;
  for (const float v : image.values) sum += v;
  return sum / static_cast<double>(image.values.size());
}

}  // namespace

int main(int argc, char** argv) {
  int samples = 64, rounds = 3, vertices = 800, threads = 0;
  bool large = false;
  std::string device;
  std::vector<std::string> only;
  CLI::App app("Rays a second of every way through the eye");
  app.add_option("--samples", samples, "Rays a pixel")->capture_default_str();
  app.add_option("--rounds", rounds, "The best of so many")->capture_default_str();
  app.add_option("--vertices", vertices, "A surface")->capture_default_str();
  app.add_option("--threads", threads, "0: all cores");
  app.add_flag("--large", large, "200 000 vertices too");
  app.add_option("--device", device, "OpenCL device");
  app.add_option("--only", only, "These ways alone, by name");
  CLI11_PARSE(app, argc, argv);
  if (threads == 0) threads = static_cast<int>(std::thread::hardware_concurrency());

  const Tracer tracer(device, threads);
  const EyeModel eye = make_eye("gullstrand", {0, {}, 4.0});
  const auto scene = make_scene("letters:distance_mm=1000,extent_deg=24");
  TraceSettings settings;
  settings.samples = samples;
  settings.wavelength_nm = 589.3;
  settings.verbosity.quiet = true;
  Json answer{
      {"device", tracer.device_name()}, {"threads", threads}, {"samples", samples}, {"vertices", vertices}};

  std::vector<Way> ways;
  const auto add = [&](const std::string& name, const EyeModel& e, Representation representation,
                       int sheet_vertices, int pixels = 500, const std::vector<EyeTangent>& tangents = {}) {
    TraceSettings s = settings;
    s.representation = representation;
    s.vertices = {sheet_vertices};
    s.grid.width = s.grid.height = pixels;
    if (representation == Representation::every_triangle) s.samples = 32;
    ways.push_back({name, 1.0 * pixels * pixels * s.samples, [=, &tracer] {
                      const TraceResult result = tracer.trace(e, *scene, s, tangents);
                      const double left = static_cast<double>(result.states.at(RayState::reached));
                      return Json{{"mean", mean_of(result.image)},
                                  {"reached", left / static_cast<double>(result.rays)},
                                  {"prepare_s", result.prepare_s},
                                  {"trace_s", result.wall_s - result.prepare_s},
                                  {"device_bytes", result.device_bytes}};
                    }});
  };
  const EyeModel glasses = with_thin_lens(eye, {-1, 0.25, 0}, 12);
  add("analytic", eye, Representation::analytic, vertices);
  add("smooth", eye, Representation::smooth, vertices);
  add("triangles", eye, Representation::triangles, vertices);
  add("fast", eye, Representation::fast, vertices);
  add("smooth 12800 vertices", eye, Representation::smooth, 12800);
  add("triangles 12800 vertices", eye, Representation::triangles, 12800);
  if (large) {
    add("smooth 200000 vertices", eye, Representation::smooth, 200000);
    add("triangles 200000 vertices", eye, Representation::triangles, 200000);
  }
  add("analytic with spectacle", glasses, Representation::analytic, vertices);
  add("analytic with spectacle and one derivative", glasses, Representation::analytic, vertices, 500,
      {{with_thin_lens(eye, {-0.875, 0.25, 0}, 12), with_thin_lens(eye, {-1.125, 0.25, 0}, 12), 0.25}});
  add("analytic and a derivative by the lens's thickness", eye, Representation::analytic, vertices, 500,
      {{with_thicker_lens(eye, 0.05), with_thicker_lens(eye, -0.05), 0.1}});
  if (threads <= 16)
    add("every triangle (the paper's method)", eye, Representation::every_triangle, vertices, 64);

  // The baselines take the same rays, pixels and texture.
  const PupilAim aim(eye, settings.grid, 589.3);
  const RetinaPixels pixels = make_pixels(eye, settings.grid, aim, threads);
  const TexturedPlane& plane = scene->planes.front();
  const Texture& texture = *plane.texture;
  const float texels_per_mm = static_cast<float>(texture.width / (2 * plane.right_mm.norm()));
  const auto system = baseline_of(eye);
  const auto z = static_cast<float>(aim.plane_z_mm());
  std::vector<TriangleMesh> sheets;
  for (int i = static_cast<int>(eye.surfaces.size()) - 2; i >= 0; --i) {
    const Surface& s = eye.surfaces[i];
    if (s.is_stop()) continue;
    TriangleMesh sheet = sheet_mesh(*s.shape, default_semi_diameter_mm(s), vertices, 0.25);
    for (auto& vertex : sheet.vertices) vertex.z() -= s.position_mm;
    sheets.push_back(std::move(sheet));
  }
  const int some = std::min(samples, 64), few = std::min(samples, 16);
  ways.push_back({"scalar C++, spheres", 250000.0 * some, [&] {
                    return Json{{"mean", scalar_spheres(system, pixels.values, z, some, texture.values,
                                                        texture.width, texels_per_mm, distance_mm, threads)}};
                  }});
  ways.push_back({"Embree rtcIntersect1", 250000.0 * few, [&] {
                    return Json{{"mean", embree_sheets(sheets, system, pixels.values, z, few, texture.values,
                                                       texture.width, texels_per_mm, distance_mm, threads)}};
                  }});
  const auto unwanted = [&](const Way& way) {
    return !only.empty() && std::find(only.begin(), only.end(), way.name) == only.end();
  };
  ways.erase(std::remove_if(ways.begin(), ways.end(), unwanted), ways.end());
  measure(ways, rounds, threads);

  std::map<std::string, double> rate;
  for (const Way& way : ways) {
    rate[way.name] = way.cpu;
    Json& entry = answer["ways"][way.name] = way.last;
    entry["million_rays_per_s_by_processor_time"] = way.cpu / 1e6;
    entry["million_rays_per_s_by_the_wall"] = way.wall / 1e6;
  }
  const auto ratio = [&](const std::string& a, const std::string& b) {
    if (rate.count(a) > 0 && rate.count(b) > 0) answer["ratios"][a + " over " + b] = rate[a] / rate[b];
  };
  ratio("analytic", "scalar C++, spheres");
  for (const char* way : {"smooth", "triangles", "fast"}) ratio(way, "Embree rtcIntersect1");
  ratio("triangles", "every triangle (the paper's method)");
  for (const std::string way : {"smooth", "triangles"})
    for (const char* more : {" 12800 vertices", " 200000 vertices"}) ratio(way, way + more);
  ratio("analytic with spectacle", "analytic with spectacle and one derivative");
  ratio("analytic", "analytic and a derivative by the lens's thickness");
  std::cout << answer.dump(2) << "\n";
}
