#include "correction/what_if.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "correction/ablation.hpp"
#include "correction/iol_formulas.hpp"
#include "correction/retinal_sharpness.hpp"
#include "pipeline/base/error.hpp"
#include "raytrace/eye/mesh_shape.hpp"
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

TEST(WhatIf, IolFormulasAreThePublishedExpressions) {
  // Each as printed by its authors, for a target refraction too.
  constexpr double a_constant = 118.4, na = 1.336, V = 12;
  for (const double L : {21.5, 23.2, 23.5, 26.0})
    for (const double K : {41.0, 43.5, 46.0})
      for (const double target : {0.0, -1.5}) {
        SCOPED_TRACE(testing::Message() << L << " mm, " << K << " D, " << target << " D");
        const IolBiometry biometry{L, K, 3.2};
        const double r = 337.5 / K;
        const auto third_generation = [&](double length, double nc_minus_1, double lens) {
          const double x = na * r - nc_minus_1 * length, y = na * r - nc_minus_1 * lens;
          return 1000 * na * (x - 0.001 * target * (V * x + length * r)) /
                 ((length - lens) * (y - 0.001 * target * (V * y + lens * r)));
        };
        const double lcor = L > 24.2 ? -3.446 + 1.716 * L - 0.0237 * L * L : L;
        const double cw = -5.41 + 0.58412 * lcor + 0.098 * K;
        const double srkt_lens = r - std::sqrt(r * r - cw * cw / 4) + 0.62467 * a_constant - 68.747 - 3.336;
        EXPECT_NEAR(iol_power_D(srkt_eye(biometry, a_constant), target),
                    third_generation(L + 0.65696 - 0.02029 * L, 0.333, srkt_lens), 1e-9);
        const double ag = std::min(13.5, 12.5 * L / 23.45), rag = std::max(r, 7.0);
        const double holladay_lens =
            0.56 + rag - std::sqrt(rag * rag - ag * ag / 4) + 0.5663 * a_constant - 65.6;
        EXPECT_NEAR(iol_power_D(holladay_eye(biometry, a_constant), target),
                    third_generation(L + 0.2, 1.0 / 3, holladay_lens), 1e-9);

        const double R = target / (1 - 0.012 * target), d = 3.14159265358979 / 180;
        const double M = L > 23 ? -1 : 1, G = L > 23 ? 23.5 : 28;
        const double acd = 0.58357 * a_constant - 63.896 + 0.3 * (L - 23.5) + std::pow(std::tan(K * d), 2) +
                           0.1 * M * std::pow(23.5 - L, 2) * std::tan(0.1 * std::pow(G - L, 2) * d) - 0.99166;
        EXPECT_NEAR(iol_power_D(hoffer_q_eye(biometry, a_constant), target),
                    1336 / (L - acd - 0.05) - 1.336 / (1.336 / (K + R) - (acd + 0.05) / 1000), 1e-9);

        const double a0 = 0.62467 * a_constant - 68.747 - 0.4 * 3.37 - 0.1 * 23.39;
        const double haigis_lens = a0 + 0.4 * 3.2 + 0.1 * L, z = 331.5 / r + R;
        EXPECT_NEAR(iol_power_D(haigis_eye(biometry, a_constant), target),
                    1336 / (L - haigis_lens) - 1336 / (1336 / z - haigis_lens), 1e-9);
      }
}

TEST(WhatIf, IolFormulasAgreeForAnAverageEye) {
  // All were fitted to patients, who are mostly like this. Haigis' constants, taken from A alone and not
  // optimised for the lens, are known to give more.
  const IolBiometry average{23.5, 43.5, 3.2};
  const double srkt_D = iol_power_D(srkt_eye(average, 118.4), 0);
  EXPECT_NEAR(iol_power_D(holladay_eye(average, 118.4), 0), srkt_D, 0.5);
  EXPECT_NEAR(iol_power_D(hoffer_q_eye(average, 118.4), 0), srkt_D, 0.5);
  EXPECT_NEAR(iol_power_D(haigis_eye(average, 118.4), 0), srkt_D, 1.25);
}

TEST(WhatIf, RayTracedLensHitsItsTargetAndIsNearTheFormula) {
  const EyeModel narrow = with_pupil(make_eye("navarro"), 1);  // no spherical aberration between the two
  // The formula lengthens what it is given to the photoreceptors, which lie 24 mm deep here.
  const ThinLensEye formula = srkt_eye({(24.0 - 0.65696) / (1 - 0.02029), 337.5 / 7.72, 3.6}, 118.4);
  EXPECT_NEAR(formula.length_mm, 24, 1e-9);
  const double power_D = ray_traced_iol_D(narrow, formula.lens_mm, 0, 589.3);
  EXPECT_NEAR(paraxial_refraction(with_iol(narrow, power_D, formula.lens_mm), 589.3).M_D, 0, 0.05);
  // The formula's cornea of index 1.333 and its thin lens are not the eye's: they agree within a dioptre.
  EXPECT_NEAR(power_D, iol_power_D(formula, 0), 1.0);
}

TEST(WhatIf, AblationTakesTheRefractionAway) {
  const EyeModel eye = make_eye("atchison:-4");
  const double wavelength_nm = eye.reference_wavelength_nm;
  const PowerVector before = paraxial_refraction(eye, wavelength_nm);
  const auto after = [&](const PowerVector& correction) {
    return paraxial_refraction(with_ablation(eye, munnerlyn_profile(eye, correction)), wavelength_nm);
  };
  // The tissue that is gone leaves the eye shorter: -2.56 D a millimetre of length, +1.18 D of chamber.
  const double sunk_mm = 1e-3 * munnerlyn_profile(eye, before).central_depth_um();
  EXPECT_NEAR(after(before).M_D, (2.56 - 1.18) * sunk_mm, 0.02);
  const PowerVector toric = after({before.M_D, 0.5, -0.3});
  EXPECT_NEAR(toric.J0_D, -0.5, 0.02);
  EXPECT_NEAR(toric.J45_D, 0.3, 0.02);
}

TEST(WhatIf, MunnerlynProfileIsTheDifferenceOfTwoSpheres) {
  const Eigen::Matrix2d sphere = Eigen::Matrix2d::Identity() / 7.8;
  const double after_mm = 1 / (1 / 7.8 - 4e-3 / 0.376);
  const auto sag = [](double radius, double r) { return radius - std::sqrt(radius * radius - r * r); };
  const MunnerlynProfile myopic(sphere, {-4, 0, 0}, 0.376);
  const double centre_mm = sag(7.8, 3) - sag(after_mm, 3);
  EXPECT_NEAR(myopic.central_depth_um(), 1e3 * centre_mm, 1e-6);
  EXPECT_NEAR(myopic.central_depth_um(), 6 * 6 * 4 / 3.0, 6);  // the rule of thumb, zone^2 D / 3
  EXPECT_NEAR(myopic.depth_mm(0, 2), centre_mm - sag(7.8, 2) + sag(after_mm, 2), 1e-9);
  EXPECT_NEAR(myopic.depth_mm(3, 0), 0, 1e-9);
  const MunnerlynProfile hyperopic(sphere, {3, 0.5, 0}, 0.376);
  EXPECT_NEAR(hyperopic.central_depth_um(), 0, 1e-9);
  EXPECT_EQ(hyperopic.depth_mm(4.01, 0), 0);
  for (double r = 0; r < 4; r += 0.05) EXPECT_GE(hyperopic.depth_mm(0.6 * r, 0.8 * r), -1e-12) << r;
  EXPECT_THROW(MunnerlynProfile(sphere, {-60, 0, 0}, 0.376), Error);
}

TEST(WhatIf, AblationOfAMeshAgreesWithTheSurgeryOfItsFormula) {
  // The cornea as a fine sheet with exact normals, ablated at its vertices.
  EyeModel eye = with_pupil(make_eye("gullstrand-emsley"), 3);
  const double wavelength_nm = eye.reference_wavelength_nm;
  eye.surfaces.back().position_mm += 1;  // myopic by 2.6 D
  Surface& front = eye.surface("cornea_anterior");
  const ShapePtr formula = front.shape;
  TriangleMesh sheet;
  constexpr int n = 60;
  constexpr double pitch_mm = 0.16;
  for (int i = -n / 2; i <= n / 2; ++i)
    for (int k = -n / 2; k <= n / 2; ++k) {
      const double x = pitch_mm * k, y = pitch_mm * i;
      sheet.vertices.emplace_back(x, y, -*formula->depth_mm(x, y));
      sheet.normals.push_back(*formula->normal(x, y));
      const int at = static_cast<int>(sheet.vertices.size()) - 1;
      if (i == n / 2 || k == n / 2) continue;
      sheet.triangles.push_back({at, at + 1, at + n + 2});
      sheet.triangles.push_back({at, at + n + 2, at + n + 1});
    }
  const PrescriptionSettings settings = [&] {
    PrescriptionSettings s;
    s.vertex_distance_mm = 0;
    s.wavelength_nm = wavelength_nm;
    return s;
  }();
  const PowerVector correction{-2.5, 0.4, -0.3};
  const auto operated = [&] {
    return refraction_by_spot(with_ablation(eye, munnerlyn_profile(eye, correction)), settings);
  };
  // Within the optical zone, which is wider than the pupil, the formula becomes exactly that surface.
  const PowerVector of_formula = operated();
  front.shape = std::make_shared<MeshShape>(sheet, MeshInterpolation::smooth);
  const PowerVector before = refraction_by_spot(eye, settings), after = operated();
  EXPECT_NEAR(after.M_D, of_formula.M_D, 0.03);
  EXPECT_NEAR(after.J0_D, of_formula.J0_D, 0.02);
  EXPECT_NEAR(after.J45_D, of_formula.J45_D, 0.02);
  // What was asked for is taken away, and spherical aberration, which a flatter sphere has less of.
  EXPECT_NEAR(before.M_D - after.M_D, correction.M_D, 0.25);
  EXPECT_NEAR(before.J0_D - after.J0_D, correction.J0_D, 0.1);
  EXPECT_NEAR(before.J45_D - after.J45_D, correction.J45_D, 0.1);
}

}  // namespace
}  // namespace emmetrope::correction
