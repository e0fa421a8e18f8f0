#include "correction/what_if.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "correction/retinal_sharpness.hpp"
#include "pipeline/base/error.hpp"
#include "raytrace/eye/paraxial.hpp"

namespace emmetrope::correction {
namespace {

TEST(WhatIf, AmplitudeAndNearPoint) {
  EXPECT_NEAR(accommodation_amplitude(40).average_D, 6.5, 1e-12);
  EXPECT_EQ(accommodation_amplitude(70).average_D, 0);
  // An emmetrope with 4 D sees from infinity to 25 cm; a 4 D myope sees there without any.
  EXPECT_NEAR(near_point_mm(0, 4), 250, 1e-9);
  EXPECT_NEAR(near_point_mm(-4, 0), 250, 1e-9);
  EXPECT_TRUE(std::isinf(near_point_mm(0, 0)));
  // A corrected myope needs less accommodation than an emmetrope: the lens at 12 mm sees to it.
  const double lens_D = move_towards_eye({-8, 0, 0}, -12).M_D;
  EXPECT_TRUE(std::isinf(near_point_with_lens_mm(-8, 0, lens_D, 12)) ||
              std::abs(near_point_with_lens_mm(-8, 0, lens_D, 12)) > 1e9);
  EXPECT_LT(near_point_with_lens_mm(-8, 4, lens_D, 12), near_point_with_lens_mm(0, 4, 0, 12));
}

TEST(WhatIf, SrktAgreesWithThinLensVergence) {
  // The formula is the vergence of a cornea of index 1.333 and a thin lens at its expected position in an eye
  // lengthened by the retina's thickness.
  for (const double length_mm : {21.5, 23.5, 26.0})
    for (const double k_D : {41.0, 43.5, 46.0}) {
      const double position_mm = srkt_lens_position_mm(length_mm, k_D, 118.4);
      const double optical_mm = length_mm + 0.65696 - 0.02029 * length_mm;
      const double cornea_D = 1000 * 0.333 / (337.5 / k_D);
      const double thin_D = 1336 / (optical_mm - position_mm) - 1336 / (1336 / cornea_D - position_mm);
      EXPECT_NEAR(srkt_power_D(length_mm, k_D, 118.4, 0), thin_D, 1e-6);
      EXPECT_LT(srkt_power_D(length_mm, k_D, 118.4, 1), srkt_power_D(length_mm, k_D, 118.4, 0));
    }
}

TEST(WhatIf, RayTracedLensHitsItsTargetAndIsNearTheFormula) {
  EyeModel eye = make_eye("navarro");
  const double k_D = 337.5 / 7.72;
  // What a biometer reads on an eye whose photoreceptors lie 24 mm behind the cornea.
  const double length_mm = (24.0 - 0.65696) / (1 - 0.02029);
  const double position_mm = srkt_lens_position_mm(length_mm, k_D, 118.4);
  const EyeModel narrow = with_pupil(eye, 1);  // so that no spherical aberration stands between the two
  const double power_D = ray_traced_iol_D(narrow, position_mm, 0, 589.3);
  EXPECT_NEAR(paraxial_refraction(with_iol(narrow, power_D, position_mm), 589.3).M_D, 0, 0.05);
  // The formula's cornea of index 1.333 and its thin lens are not the eye's: they agree within a dioptre.
  EXPECT_NEAR(power_D, srkt_power_D(length_mm, k_D, 118.4, 0), 1.0);
}

TEST(WhatIf, AblationTakesTheRefractionAway) {
  const EyeModel eye = make_eye("atchison:-4");
  const double wavelength_nm = eye.reference_wavelength_nm;
  const PowerVector before = paraxial_refraction(eye, wavelength_nm);
  const PowerVector after = paraxial_refraction(with_ablation(eye, before), wavelength_nm);
  EXPECT_NEAR(after.M_D, 0, 0.02);
  const PowerVector toric = paraxial_refraction(with_ablation(eye, {before.M_D, 0.5, -0.3}), wavelength_nm);
  EXPECT_NEAR(toric.J0_D, -0.5, 0.02);
  EXPECT_NEAR(toric.J45_D, 0.3, 0.02);
  // Munnerlyn's rule of thumb: zone^2 D / 3 micrometres, to about a tenth.
  EXPECT_NEAR(munnerlyn_depth_um(7.8, -4, 6), 48, 6);
}

}  // namespace
}  // namespace emmetrope::correction
