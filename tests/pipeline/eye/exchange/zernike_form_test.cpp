#include "pipeline/eye/exchange/zernike_form.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "pipeline/eye/surfaces/zernike.hpp"

namespace emmetrope {
namespace {

// Noll (1976), table I: number, n, m; even numbers are cosines.
TEST(ZernikeForm, NumbersAreNolls) {
  const struct {
    int noll, n, m;
  } table[] = {{1, 0, 0},   {2, 1, 1},  {3, 1, -1},  {4, 2, 0},  {5, 2, -2},  {6, 2, 2},
               {7, 3, -1},  {8, 3, 1},  {9, 3, -3},  {10, 3, 3}, {11, 4, 0},  {12, 4, 2},
               {13, 4, -2}, {14, 4, 4}, {15, 4, -4}, {16, 5, 1}, {17, 5, -1}, {18, 5, 3},
               {19, 5, -3}, {20, 5, 5}, {21, 5, -5}, {22, 6, 0}};
  for (const auto& [noll, n, m] : table) EXPECT_EQ(noll_number((n * (n + 2) + m) / 2), noll) << n << " " << m;
}

TEST(ZernikeForm, SignsMirrorX) {
  for (int j = 0; j < 45; ++j)
    EXPECT_NEAR(zernike_jet(j, -0.3, 0.4).value, sign_mirrored_in_x(j) * zernike_jet(j, 0.3, 0.4).value,
                1e-12)
        << j;
}

TEST(ZernikeForm, AConicIsFittedWithinANanometre) {
  const ShapePtr conic = make_conic(7.8, -0.25);
  const ZernikeForm form = zernike_form(*conic, 4);
  EXPECT_NEAR(form.curvature_per_mm, 1 / 7.8, 1e-12);
  EXPECT_EQ(form.norm_radius_mm, 4);
  EXPECT_LT(form.worst_um, 1e-3);
  // Where the shape ends sooner, so does the form.
  EXPECT_LT(zernike_form(*make_sphere(3), 5).norm_radius_mm, 3);
}

}  // namespace
}  // namespace emmetrope
