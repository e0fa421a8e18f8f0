// The paper's validation: meshes against formulas, measured against the noise of two runs of formulas. The
// whole of it is tracer-study paper (docs/evidence/performance.md).
#include <gtest/gtest.h>

#include "tests/support/image_difference.hpp"

namespace emmetrope::raytrace {
namespace {

TEST(ImageDifference, IsThatOfWang2004) {
  // Constant pictures: only luminance differs, SSIM = (2 a b + c1) / (a^2 + b^2 + c1).
  const std::vector<double> a(400, 100), b(400, 120);
  EXPECT_NEAR(ssim(a, b, 20, 20), (2 * 100 * 120 + 6.5025) / (100 * 100 + 120 * 120 + 6.5025), 1e-9);
  EXPECT_NEAR(ssim(a, a, 20, 20), 1, 1e-12);
  EXPECT_NEAR(msd(a, b), 400, 1e-12);
}

TEST(PaperValidation, MeshesDifferFromFormulasByNoiseOnly) {
  constexpr int pixels = 64;
  const Tracer tracer("");
  PaperValidation run(pixels, 4096);
  const auto formulas = grey_levels(run.image(tracer, Representation::analytic, 1).image),
             again = grey_levels(run.image(tracer, Representation::analytic, 2).image);
  const double noise = msd(formulas, again);
  EXPECT_GT(edge_share(formulas, pixels, pixels, 8), 0.2);
  for (const Representation way : {Representation::triangles, Representation::smooth, Representation::fast}) {
    const auto levels = grey_levels(run.image(tracer, way, 3).image);
    std::printf("way %d: MSD %.3f (noise %.3f), SSIM %.5f\n", static_cast<int>(way), msd(formulas, levels),
                noise, ssim(formulas, levels, pixels, pixels));
    EXPECT_LE(msd(formulas, levels), 1 + 1.2 * noise);
    EXPECT_GE(ssim(formulas, levels, pixels, pixels), 0.999);
  }
}

}  // namespace
}  // namespace emmetrope::raytrace
