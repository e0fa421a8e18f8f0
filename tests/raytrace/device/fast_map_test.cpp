// The fast map against the ways it stands for: the same seed sends the same rays, so that pictures are equal
// up to the map's error, which is checked against exact rays whenever a map is made.
#include <gtest/gtest.h>

#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/eye/model/mesh_shape.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "raytrace/system/sheet_mesh.hpp"
#include "raytrace/tracer/tracer.hpp"

namespace emmetrope::raytrace {
namespace {

TraceSettings small() {
  TraceSettings settings;
  settings.grid = {40, 36, 5, 4.5, {0.2, -0.1}};
  settings.samples = 256;
  settings.wavelength_nm = 589.3;
  settings.verbosity.quiet = true;
  return settings;
}

double largest_difference(const LinearImage& a, const LinearImage& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.values.size(); ++i)
    largest = std::max(largest, std::abs(double(a.values[i]) - b.values[i]));
  return largest;
}

/// Pictures by the map and by the formulas; a ray at the stop's rim more or less is 1/256 of a pixel.
void expect_same(const EyeModel& eye, TraceSettings settings, const EyeModel& formulas) {
  const Tracer tracer("");
  const auto scene = make_scene("letters:logmar=1,distance_mm=500");
  const auto exact = tracer.trace(formulas, *scene, settings);
  settings.representation = Representation::fast;
  const auto fast = tracer.trace(eye, *scene, settings);
  EXPECT_LT(largest_difference(fast.image, exact.image), 6e-3) << eye.name;
  double mean = 0;
  for (std::size_t i = 0; i < exact.image.values.size(); ++i)
    mean += std::abs(double(fast.image.values[i]) - exact.image.values[i]);
  EXPECT_LT(mean / static_cast<double>(exact.image.values.size()), 2e-4) << eye.name;
  for (const auto& [state, count] : exact.states)
    EXPECT_NEAR(static_cast<double>(fast.states.at(state)), static_cast<double>(count),
                1e-4 * static_cast<double>(exact.rays))
        << eye.name << " " << to_string(state);
  ASSERT_FALSE(fast.notes.empty());
  EXPECT_NE(fast.notes.back().find("fast map"), std::string::npos);
}
void expect_same(const EyeModel& eye, const TraceSettings& settings) { expect_same(eye, settings, eye); }

TEST(FastMap, DrawsWhatTheFormulasDraw) {
  expect_same(make_eye("gullstrand", {0, {}, 4.0}), small());
  expect_same(make_eye("liou-brennan", {0, {}, 3.0}), small());
}

TEST(FastMap, DrawsInColour) {
  TraceSettings settings = small();
  settings.wavelength_nm.reset();
  expect_same(make_eye("navarro", {0, {}, 4.0}), settings);
}

TEST(FastMap, WeighsByIlluminance) {
  TraceSettings settings = small();
  settings.illuminance = true;
  expect_same(make_eye("navarro", {0, {}, 4.0}), settings);
}

TEST(FastMap, DrawsWhatMeshesDraw) {
  const EyeModel formulas = make_eye("navarro", {0, {}, 4.0});
  EyeModel eye = formulas;
  for (auto& surface : eye.surfaces)
    if (!surface.is_stop() && surface.name != "retina")
      surface.shape = std::make_shared<MeshShape>(
          sheet_mesh(*surface.shape, default_semi_diameter_mm(surface), 800, 0.25),
          MeshInterpolation::smooth);
  expect_same(eye, small(), formulas);
}

TEST(FastMap, IsRefusedWhereRaysDoNotChangeSmoothly) {
  // At full accommodation the nucleus ends 2.3 mm from the axis: beside it rays are bent otherwise.
  TraceSettings settings = small();
  settings.representation = Representation::fast;
  try {
    Tracer("").trace(make_eye("gullstrand", {10.87, {}, 6.0}), *make_scene("point"), settings);
    FAIL() << "a map that cannot hold was accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), ExitStatus::unsupported);
    EXPECT_NE(std::string(error.what()).find("arcmin"), std::string::npos);
  }
}

}  // namespace
}  // namespace emmetrope::raytrace
