// Studies too long for the test suite; docs/evidence/performance.md and docs/evidence/mesh-accuracy.md show what they print.
//   tracer-study paper [PIXELS SAMPLES [CHART]]   the paper's validation: MSD and SSIM of every way
//   tracer-study samples      image error against rays a pixel, ours and random ones
//   tracer-study watertight   ten million rays at vertices and edges; fails where one is lost
//   tracer-study parity       exit directions against the host's float64; fails beyond 0.01 arcmin
// EMMETROPE_DEVICE names the OpenCL device, as --device does elsewhere.
#include <fmt/format.h>

#include <cstdlib>
#include <iostream>
#include <random>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/optics/exact_trace.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "raytrace/retina/pupil_aim.hpp"
#include "raytrace/system/sheet_mesh.hpp"
#include "tests/support/image_difference.hpp"

using namespace emmetrope;
using namespace emmetrope::raytrace;

namespace {

void paper(const Tracer& tracer, int pixels, int samples, const std::string& chart) {
  PaperValidation run(pixels, samples, chart);
  const auto formulas = grey_levels(run.image(tracer, Representation::analytic, 1).image);
  fmt::print("{0} x {0} pixels, {1} rays each, edges on {2:.0f} % of the pixels\nway,MSD,SSIM,wall_s\n",
             pixels, samples, 100 * edge_share(formulas, pixels, pixels, 8));
  const auto report = [&](const char* name, const TraceResult& result) {
    const auto levels = grey_levels(result.image);
    fmt::print("{},{:.3f},{:.5f},{:.1f}\n", name, msd(formulas, levels),
               ssim(formulas, levels, pixels, pixels), result.wall_s);
    std::fflush(stdout);
  };
  report("analytic, another seed", run.image(tracer, Representation::analytic, 2));
  report("triangles", run.image(tracer, Representation::triangles, 3));
  report("smooth", run.image(tracer, Representation::smooth, 3));
  try {
    report("fast", run.image(tracer, Representation::fast, 3));
  } catch (const Error& refused) {
    fmt::print("fast,refused: {}\n", refused.what());
  }
}

/// Rms error of single pictures against 16 384 rays a pixel, over four seeds, in grey levels of linear light.
void samples(const Tracer& tracer) {
  PaperValidation run(64, 16384);
  fmt::print("rays_a_pixel,ours_rms,random_rms\n");
  const auto reference = [&](Method method) {
    return run.image(tracer, Representation::analytic, 1, method).image;
  };
  const LinearImage ours = reference(Method::pupil), random = reference(Method::paper);
  for (const int count : {32, 64, 96, 128, 256, 512, 1024}) {
    run.settings.samples = count;
    const auto error = [&](Method method, const LinearImage& truth) {
      double sum = 0;
      for (int seed = 2; seed < 6; ++seed) {
        const LinearImage image = run.image(tracer, Representation::analytic, seed, method).image;
        for (std::size_t i = 1; i < image.values.size(); i += 3)
          sum += std::pow(255 * (double(image.values[i]) - truth.values[i]), 2);
      }
      return std::sqrt(sum / 4 / (64.0 * 64.0));
    };
    fmt::print("{},{:.3f},{:.3f}\n", count, error(Method::pupil, ours), error(Method::paper, random));
    std::fflush(stdout);
  }
}

bool watertight(const Tracer& tracer) {
  EyeModel eye = make_eye("gullstrand-emsley", {0, {}, 20.0});
  for (auto& surface : eye.surfaces)
    if (!surface.is_stop() && surface.name != "retina") surface.semi_diameter_mm = 5;
  TraceSettings settings;
  settings.representation = Representation::triangles;
  const Surface& last = eye.surfaces[eye.surfaces.size() - 2];
  std::uint64_t rays_sent = 0, lost = 0;
  for (const int vertices : {800, 3200, 12800, 51200}) {
    settings.vertices = {vertices};
    const TriangleMesh sheet = sheet_mesh(*last.shape, default_semi_diameter_mm(last), vertices, 0.25);
    const int steps = 1 + 2'600'000 / static_cast<int>(sheet.triangles.size() / 4 * 3);
    std::vector<Ray> rays;
    for (const auto& t : sheet.triangles)
      for (int e = 0; e < 3; ++e)
        for (int k = 0; k < steps; ++k) {
          const Eigen::Vector3d p =
              sheet.vertices[t[e]] +
              (sheet.vertices[t[(e + 1) % 3]] - sheet.vertices[t[e]]) * (k / double(steps));
          if (p.head<2>().norm() < 2.5)
            rays.push_back({{p.x(), p.y(), -last.position_mm - 3}, Eigen::Vector3d::UnitZ()});
        }
    std::uint64_t lost_here = 0;
    for (const auto& exit : tracer.exit_rays(eye, rays, settings))
      lost_here += exit.state != RayState::reached;
    fmt::print("{} vertices: {} rays at vertices and edges, {} lost\n", vertices, rays.size(), lost_here);
    std::fflush(stdout);
    rays_sent += rays.size();
    lost += lost_here;
  }
  fmt::print("{} rays, {} lost\n", rays_sent, lost);
  return rays_sent > 10'000'000 && lost == 0;
}

/// Exit directions of rays over 6 x 6 mm of retina and a 4 mm pupil, device against float64. Smooth sheets
/// are compared with the formulas they were made from, which they follow to 0.0005 arcmin.
bool parity(const Tracer& tracer) {
  bool held = true;
  fmt::print("eye,way,rms_arcmin,max_arcmin,rays\n");
  const auto check = [&](const std::string& name, Representation way, const char* way_name) {
    const EyeModel eye = make_eye(name, {0, {}, 4.0});
    RetinalGrid grid;
    const PupilAim aim(eye, grid, eye.reference_wavelength_nm);
    const ExactTracer exact(eye, eye.reference_wavelength_nm);
    std::mt19937 random(7);
    std::uniform_real_distribution<double> unit(0, 1);
    std::vector<Ray> rays;
    for (int i = 0; i < 20000; ++i) {
      const double x = 6 * (unit(random) - 0.5), y = 6 * (unit(random) - 0.5);
      const Eigen::Vector3d retina = retina_point(eye, x, y).position_mm;
      const AimEllipse ellipse = aim.at(x, y);
      const double rho = 0.99 * std::sqrt(unit(random)), angle = 2 * pi * unit(random);
      const Eigen::Vector2d p =
          ellipse.centre_mm + ellipse.from_disc * (rho * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
      rays.push_back({retina, (Eigen::Vector3d(p.x(), p.y(), aim.plane_z_mm()) - retina).normalized()});
    }
    TraceSettings settings;
    settings.representation = way;
    const auto found = tracer.exit_rays(eye, rays, settings);
    double square = 0, largest = 0;
    int reached = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const auto end = exact.trace_end(rays[i]);
      if (end.state != RayState::reached || found[i].state != RayState::reached) continue;
      const double angle = found[i].direction.normalized().cross(end.direction).norm() / (degree / 60);
      square += angle * angle;
      largest = std::max(largest, angle);
      ++reached;
    }
    const double rms = std::sqrt(square / reached);
    held = held && reached > 19000 && rms <= 0.01;
    fmt::print("{},{},{:.5f},{:.5f},{}\n", name, way_name, rms, largest, reached);
    std::fflush(stdout);
  };
  for (const auto& name : {"gullstrand", "navarro", "le-grand", "arizona", "liou-brennan", "atchison:-4"})
    check(name, Representation::analytic, "analytic");
  for (const auto& name : {"gullstrand", "navarro"}) check(name, Representation::smooth, "smooth");
  return held;
}

}  // namespace

int main(int argc, char** argv) {
  const std::string study = argc > 1 ? argv[1] : "";
  const char* device = std::getenv("EMMETROPE_DEVICE");
  const Tracer tracer(device == nullptr ? "" : device);
  if (study == "paper") {
    paper(tracer, argc > 3 ? std::atoi(argv[2]) : 500, argc > 3 ? std::atoi(argv[3]) : 4096,
          argc > 4 ? argv[4] : "letters:logmar=1.3,distance_mm=92,extent_deg=22");
  } else if (study == "samples") {
    samples(tracer);
  } else if (study == "watertight") {
    return watertight(tracer) ? 0 : 1;
  } else if (study == "parity") {
    return parity(tracer) ? 0 : 1;
  } else {
    std::cerr << "tracer-study paper [PIXELS SAMPLES] | samples | watertight | parity\n";
    return 2;
  }
}
