#include "raytrace/visual_field.hpp"

#include <gtest/gtest.h>

#include "pipeline/base/files.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/optics/exact_trace.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope::raytrace {
namespace {

TEST(VisualField, EveryEntryIsAChiefRayToTheRetina) {
  const test::TemporaryFolder folder;
  const EyeModel eye = make_eye("navarro");
  TraceSettings settings;
  settings.wavelength_nm = 555;
  write_visual_field(eye, settings, folder.path());
  const Json json = read_json(folder.path() / "visual-field.json");
  ASSERT_GT(json["retina_mm"].size(), 400U);
  double widest_deg = 0;
  const auto vector = [](const Json& values) {
    return Eigen::Vector3d(values[0].get<double>(), values[1].get<double>(), values[2].get<double>());
  };
  // Its retina is a sphere of 12 mm; it sees in all directions alike, the patient's right (eye -x) at 0 degrees.
  const Eigen::Vector3d centre(0, 0, -eye.axial_length_mm() + 12);
  for (std::size_t i = 0; i < json["retina_mm"].size(); ++i) {
    const double eccentricity = json["eccentricity_deg"][i].get<double>() * degree,
                 meridian = json["meridian_deg"][i].get<double>() * degree;
    const Eigen::Vector3d direction = vector(json["direction"][i]), retina = vector(json["retina_mm"][i]);
    const Eigen::Vector3d expected(-std::sin(eccentricity) * std::cos(meridian),
                                   std::sin(eccentricity) * std::sin(meridian), std::cos(eccentricity));
    EXPECT_NEAR((direction - expected).norm(), 0, 1e-9);
    EXPECT_NEAR((retina - centre).norm(), 12, 1e-9);
    const double polar = std::atan2((retina - centre).head<2>().norm(), -(retina - centre).z());
    EXPECT_NEAR(json["retina_arc_mm"][i].get<double>(), 12 * polar, 1e-3);
    EXPECT_LE((retina.head<2>().normalized() + direction.head<2>().normalized()).norm(),
              1e-6 + 2 * (eccentricity == 0));
    widest_deg = std::max(widest_deg, eccentricity / degree);
  }
  EXPECT_GE(widest_deg, 100);  // as people see temporally
}

}  // namespace
}  // namespace emmetrope::raytrace
