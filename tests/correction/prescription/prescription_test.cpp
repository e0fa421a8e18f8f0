// Eyes at the end of what lenses are sought for.
#include "correction/prescription/prescription.hpp"

#include <gmock/gmock.h>

#include "correction/sharpness/refraction_chart.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/optics/chief_ray.hpp"
#include "pipeline/eye/optics/paraxial.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "raytrace/scene/scene_model.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope::correction {
namespace {

EyeModel navarro_of_length(double length_mm) {
  EyeModel eye = make_eye("navarro", {});
  eye.surface("retina").position_mm = length_mm;
  return eye;
}

TEST(SharpestLens, IsFoundForTheLongestEyesThatLive) {
  PrescriptionSettings settings;
  settings.vertex_distance_mm = 12;
  settings.verbosity.quiet = true;
  const EyeModel eye = navarro_of_length(38);
  const SearchResult search = sharpest_lens(raytrace::Tracer("", 0), eye, settings);
  // Paraxial, independent of rays: -24.3 D at the cornea.
  const double at_cornea_D = paraxial_refraction(eye, settings.wavelength_nm).M_D;
  const double at_lens_D = at_cornea_D / (1 + 1e-3 * settings.vertex_distance_mm * at_cornea_D);
  EXPECT_NEAR(search.family.power(search.best.lens).M_D, at_lens_D, 1);
}

TEST(SharpestLens, OfAVeryShortEyeIsAContactLensToo) {
  PrescriptionSettings settings;
  settings.vertex_distance_mm = 12;
  settings.verbosity.quiet = true;
  const EyeModel eye = navarro_of_length(14.8);  // +40 D at the cornea
  const raytrace::Tracer tracer("", 0);
  const SearchResult search = sharpest_lens(tracer, eye, settings);
  const PowerVector thin = search.family.power(search.best.lens);
  const auto levels =
      imaging_levels(settings.criterion, settings.pupil_mm, settings.wavelength_nm, {0, 0}, 1);
  const auto lenses = sharpest_real_lenses(tracer, refraction_chart(), eye, levels.back(), settings.spectacle,
                                           thin, settings.vertex_distance_mm);
  EXPECT_EQ(lenses.back().kind, "contact lens");
  EXPECT_EQ(lenses.back().reason, "");
  EXPECT_NEAR(lenses.back().power.M_D, paraxial_refraction(eye, settings.wavelength_nm).M_D, 2.5);
}

TEST(SharpestLens, IsNotSoughtWhereNoneIsMade) {
  PrescriptionSettings settings;
  settings.vertex_distance_mm = 12;
  settings.verbosity.quiet = true;
  try {
    sharpest_lens(raytrace::Tracer("", 0), navarro_of_length(100), settings);
    ADD_FAILURE() << "was found";
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), ExitStatus::no_result);
    EXPECT_THAT(error.what(), testing::HasSubstr("by its wavefront this eye needs a lens of M -132"));
    EXPECT_THAT(error.what(), testing::HasSubstr("lenses are sought up to M 40, J 20 D"));
  }
}

// The chart of 17 degrees stands where the retina looks, which 3 mm beside the pole is 10.5 degrees off the axis.
TEST(SharpestLens, OfAPointOffTheAxisIsItsWavefronts) {
  const EyeModel eye = make_eye("navarro", {});
  const raytrace::Tracer tracer("", 0);
  const auto sharpest_at = [&](const Eigen::Vector2d& retina_mm) {
    PrescriptionSettings settings;
    settings.verbosity.quiet = true;
    settings.fovea_mm = retina_mm;
    const SearchResult search = sharpest_lens(tracer, eye, settings);
    raytrace::WavefrontSettings wavefront;
    wavefront.wavelength_nm = settings.wavelength_nm;
    wavefront.fovea_mm = retina_mm;
    const Eigen::Vector3d by_wavefront =
        as_vector(raytrace::refraction_by_wavefront(with_pupil(eye, settings.pupil_mm), wavefront,
                                                    settings.vertex_distance_mm)
                      .minimum_rms_wavefront);
    EXPECT_LT((search.best.lens - by_wavefront).norm(), 0.1) << retina_mm.transpose();
    return search.best.lens;
  };
  const Eigen::VectorXd beside = sharpest_at({3, 0}), below = sharpest_at({0, -3});
  sharpest_at({4, 0});
  // The eye is round: a quarter turn about its axis changes the sign of J0.
  EXPECT_LT((beside - Eigen::Vector3d(below[0], -below[1], below[2])).norm(), 0.03);
}

TEST(JudgedScene, IsWhereTheRetinaLooks) {
  const EyeModel eye = make_eye("navarro", {});
  PrescriptionSettings settings;
  for (const Eigen::Vector2d& retina_mm : {Eigen::Vector2d(3, 0), {1, -2}, {-4, 3}}) {
    settings.fovea_mm = retina_mm;
    const auto scene = judged_scene(eye, settings);
    const raytrace::TexturedPlane& chart = scene->planes.front();
    // From there a ray into the eye comes to that point.
    const auto image = ChiefRays(eye, settings.wavelength_nm).image_of(chart.centre_mm);
    ASSERT_TRUE(image);
    EXPECT_LT((image->position_mm.head<2>() - retina_mm).norm(), 1e-6);
    // Square across that direction, of 17 degrees, and turned about it from upright as it is on the axis.
    const double half = std::tan(8.5 * degree);
    EXPECT_NEAR(chart.right_mm.norm(), half, 1e-12);
    EXPECT_NEAR(chart.up_mm.norm(), half, 1e-12);
    EXPECT_NEAR(chart.right_mm.dot(chart.up_mm), 0, 1e-12);
    EXPECT_LT((chart.up_mm.cross(chart.right_mm).normalized() - chart.centre_mm).norm(), 1e-12);
    const double upright = 2 / (1 + std::sqrt(5.0));
    EXPECT_NEAR((chart.right_mm - upright * chart.up_mm).y(), 0, 1e-12);
  }
  settings.fovea_mm = {0, 0};
  const auto ahead = judged_scene(eye, settings), usual = refraction_chart();
  EXPECT_EQ(ahead->planes.front().centre_mm, usual->planes.front().centre_mm);
  EXPECT_EQ(ahead->planes.front().right_mm, usual->planes.front().right_mm);
  EXPECT_EQ(ahead->planes.front().up_mm, usual->planes.front().up_mm);
}

// Off its middle a dial has strokes along one line only.
TEST(JudgedScene, OfAChartByItsNameIsWhereTheRetinaLooks) {
  const EyeModel eye = make_eye("navarro", {});
  PrescriptionSettings settings;
  settings.fovea_mm = {-4, 3};
  const raytrace::TexturedPlane texture = judged_scene(eye, settings)->planes.front();
  settings.chart = "dial:extent_deg=10";
  const raytrace::TexturedPlane dial = judged_scene(eye, settings)->planes.front();
  EXPECT_LT((dial.centre_mm - texture.centre_mm).norm(), 1e-12);
  EXPECT_NEAR(dial.up_mm.norm(), std::tan(5 * degree), 1e-12);
  EXPECT_NEAR(dial.right_mm.norm(), std::tan(5 * degree), 1e-12);
  EXPECT_NEAR(dial.right_mm.y(), 0, 1e-12);  // upright
  EXPECT_LT((dial.up_mm.cross(dial.right_mm).normalized() - dial.centre_mm).norm(), 1e-12);
}

// 4 mm beside the pole Navarro's eye looks 14.2 degrees off its axis.
TEST(JudgedScene, OfAChartThatIsLookedPastIsAnError) {
  const EyeModel eye = make_eye("navarro", {});
  const test::TemporaryFolder folder;
  PrescriptionSettings settings;
  settings.fovea_mm = {4, 0};
  settings.chart = (folder.path() / "scene.json").string();
  const auto chart_of_half = [&](double half_deg) {
    const double half = std::tan(half_deg * degree);
    write_json(settings.chart, {{"objects",
                                 {{{"type", "plane"},
                                   {"chart", "landolt"},
                                   {"at_infinity", true},
                                   {"centre_mm", {0, 0, 1}},
                                   {"right_mm", {-half, 0, 0}},
                                   {"up_mm", {0, half, 0}}}}}});
  };
  chart_of_half(14);
  try {
    judged_scene(eye, settings);
    ADD_FAILURE() << "was accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), ExitStatus::usage);
    EXPECT_THAT(error.what(), testing::HasSubstr("looks past --chart " + settings.chart + ": 14.2 degrees"));
    EXPECT_THAT(error.remedy(), testing::HasSubstr("widen its planes"));
  }
  chart_of_half(14.5);
  EXPECT_NO_THROW(judged_scene(eye, settings));
  settings.chart = "perimeter";
  EXPECT_NO_THROW(judged_scene(eye, settings));
}

/// Of the library the fields are set, of the command the flags.
TEST(PrescriptionSettings, AreRefusedByFlagAndField) {
  const auto said = [](const auto& change) {
    PrescriptionSettings settings;
    change(settings);
    try {
      settings.check();
      return std::string("was accepted");
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::usage);
      return std::string(error.what());
    }
  };
  EXPECT_EQ(said([](auto& s) { s.spectacle.semi_diameter_mm = 50; }),
            "--lens-diameter (twice spectacle.semi_diameter_mm) is 100 mm, outside 20 to 90");
  EXPECT_EQ(said([](auto& s) { s.spectacle.base_D = -1; }),
            "--base-curve (spectacle.base_D) is -1 D, outside 0 to 20");
  EXPECT_EQ(said([](auto& s) { s.spectacle.centre_thickness_mm = 0; }),
            "--centre-thickness (spectacle.centre_thickness_mm) is 0 mm, outside 0.5 to 20");
  EXPECT_EQ(said([](auto& s) { s.plano_cylinder_distance_mm = 40; }),
            "--plano-cylinder-distance (plano_cylinder_distance_mm) is 40 mm, outside 0 to 30");
  EXPECT_EQ(said([](auto& s) { s.plano_cylinder_index = 1; }),
            "--plano-cylinder-index (plano_cylinder_index) is 1, outside 1.3 to 2");
}

}  // namespace
}  // namespace emmetrope::correction
