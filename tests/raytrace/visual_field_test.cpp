#include "raytrace/visual_field.hpp"

#include <gtest/gtest.h>

#include "pipeline/base/error.hpp"
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
  write_visual_field(eye, settings, {}, nullptr, folder.path());
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

TEST(VisualField, LandmarksAndTheWaysBetweenThem) {
  const test::TemporaryFolder folder;
  const EyeModel eye = make_eye("navarro");
  Landmarks landmarks;
  landmarks.fovea = Landmark{{1.2, 0}, 0.1};
  landmarks.disc = Landmark{{-3.5, 0.5}, 0.2};
  write_visual_field(eye, {}, landmarks, nullptr, folder.path());
  const Json json = read_json(folder.path() / "visual-field.json");
  const auto unit = [](double x, double y) -> Eigen::Vector3d {
    return Eigen::Vector3d(x, y, -std::sqrt(144 - x * x - y * y)) / 12;
  };
  const auto way = [&](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
    return 12 * std::acos(a.dot(b));
  };
  const Json& distances = json["distances"];
  EXPECT_NEAR(distances["pole_fovea_mm"]["value"].get<double>(), way(unit(0, 0), unit(1.2, 0)), 1e-4);
  const double wanted = way(unit(1.2, 0), unit(-3.5, 0.5)), sigma = std::hypot(0.1, 0.2);
  EXPECT_NEAR(distances["fovea_disc_mm"]["value"].get<double>(), wanted, 1e-4);
  EXPECT_NEAR(distances["fovea_disc_mm"]["ci95"][1].get<double>(), wanted + 1.96 * sigma, 1e-3);
  EXPECT_EQ(json["landmarks"]["disc"]["sigma_mm"], 0.2);
  // The retina left of the pole (+x) looks to the right.
  EXPECT_LT(json["landmarks"]["fovea"]["direction"][0].get<double>(), 0);
  landmarks.disc = Landmark{{13, 0}, 0};
  EXPECT_THROW(write_visual_field(eye, {}, landmarks, nullptr, folder.path()), Error);
}

}  // namespace
}  // namespace emmetrope::raytrace
