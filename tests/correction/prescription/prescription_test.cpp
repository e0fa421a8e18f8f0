// Eyes at the end of what lenses are sought for.
#include "correction/prescription/prescription.hpp"

#include <gmock/gmock.h>

#include "correction/sharpness/refraction_chart.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/eye/optics/paraxial.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"

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
