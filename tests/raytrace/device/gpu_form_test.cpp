// The form of the kernels that GPUs run, a ray a work-item, on the device at hand: it draws what the form for
// CPUs draws.
#include <gtest/gtest.h>

#include <cmath>

#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "raytrace/tracer/tracer.hpp"

namespace emmetrope::raytrace {
namespace {

struct Way {
  const char* eye;
  Representation representation;
  Method method;
  bool spectral;
};
class GpuForm : public testing::TestWithParam<Way> {};

TEST_P(GpuForm, DrawsWhatTheCpuFormDraws) {
  const Way& way = GetParam();
  const EyeModel eye = make_eye(way.eye, {0, {}, 4.0});
  const auto scene = make_scene("letters:logmar=1,distance_mm=500");
  TraceSettings settings;
  settings.grid = {20, 20, 0.5, 0.5, {0, 0}};
  settings.samples = 1024;
  settings.representation = way.representation;
  settings.method = way.method;
  if (!way.spectral) settings.wavelength_nm = 589.3;
  if (way.method == Method::paper) settings.samples = 64;
  settings.vertices = {400};
  settings.verbosity.quiet = true;
  const auto cpu = Tracer("", 0, 16).trace(eye, *scene, settings),
             gpu = Tracer("", 0, 1).trace(eye, *scene, settings);
  double mean = 0, square = 0;
  const auto count = static_cast<double>(cpu.image.values.size());
  for (std::size_t i = 0; i < cpu.image.values.size(); ++i) {
    const double difference = double(cpu.image.values[i]) - gpu.image.values[i];
    mean += difference / count;
    square += difference * difference / count;
  }
  // Where both forms take the same samples (formulas, the map, the paper's) pictures are equal up to rounding
  // and rays at the rim; through meshes the CPU's tiles have samples of their own.
  const bool tiles =
      way.representation == Representation::smooth || way.representation == Representation::triangles;
  EXPECT_LT(std::abs(mean), tiles ? 1e-3 : 1e-4);
  EXPECT_LT(std::sqrt(square), tiles ? 5e-3 : 1e-3);
  EXPECT_EQ(cpu.rays, gpu.rays);
  for (const auto& [state, rays] : cpu.states)
    EXPECT_NEAR(static_cast<double>(rays), static_cast<double>(gpu.states.at(state)),
                2e-3 * static_cast<double>(cpu.rays))
        << to_string(state);
}
INSTANTIATE_TEST_SUITE_P(Ways, GpuForm,
                         testing::Values(Way{"navarro", Representation::analytic, Method::pupil, false},
                                         Way{"navarro", Representation::analytic, Method::pupil, true},
                                         Way{"liou-brennan", Representation::analytic, Method::pupil, true},
                                         Way{"navarro", Representation::smooth, Method::pupil, true},
                                         Way{"navarro", Representation::triangles, Method::pupil, false},
                                         Way{"navarro", Representation::fast, Method::pupil, true},
                                         Way{"navarro", Representation::every_triangle, Method::paper,
                                             false}));

}  // namespace
}  // namespace emmetrope::raytrace
