// What a myope of 4 D sees of letters at 6 m, without and with glasses.
#include <cstdio>

#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "raytrace/spectacle/spectacle.hpp"
#include "raytrace/tracer/tracer.hpp"

int main() {
  using namespace emmetrope;
  const EyeModel eye = make_eye("atchison:-4");
  const auto scene = raytrace::make_scene("letters:logmar=0.7,distance_mm=6000");
  const raytrace::Tracer tracer("");  // the first OpenCL device
  raytrace::TraceSettings settings;
  settings.grid.width = settings.grid.height = 200;
  settings.grid.field_x_mm = settings.grid.field_y_mm = 0.6;  // on the retina
  settings.samples = 64;

  raytrace::write_png("without.png", tracer.trace(eye, *scene, settings).image);
  const EyeModel corrected = raytrace::with_spectacle(eye, raytrace::ThinLens{{-4, 0, 0}, 12, {}});
  const raytrace::TraceResult seen = tracer.trace(corrected, *scene, settings);
  raytrace::write_png("with.png", seen.image);
  std::printf("%.1f million rays a second on %s\n", seen.rays_per_s() / 1e6, seen.device.c_str());
}
