// Eyes at the end of what lenses are sought for.
#include "correction/prescription/prescription.hpp"

#include <gmock/gmock.h>

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
    EXPECT_THAT(error.what(), testing::HasSubstr("lenses are sought up to 40 D"));
  }
}

}  // namespace
}  // namespace emmetrope::correction
