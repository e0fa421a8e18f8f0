// The same voxels give the same eye, however a file stores them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "pipeline/eye/population/population.hpp"
#include "segmentation/intake/nifti.hpp"
#include "segmentation/judgement/judged_eye.hpp"
#include "tests/support/phantom_eyes.hpp"
#include "tests/support/stored_otherwise.hpp"

namespace emmetrope::segmentation {
namespace {

/// An eye, found, read by its edges and fitted.
EyeFit eye_of(const Stack& stack, Laterality laterality) {
  const std::vector<const Stack*> stacks{&stack};
  const FoundEyes found = find_eyes(stacks, {""});
  const auto wanted = std::find_if(found.eyes.begin(), found.eyes.end(),
                                   [&](const FoundEye& one) { return one.laterality == laterality; });
  if (wanted == found.eyes.end()) throw std::runtime_error("no such eye found");
  JudgedEye eye;
  eye.found = *wanted;
  eye.edges = read_edges_of(eye.found, stacks);
  fit_and_judge(eye, views_of(eye.found, stacks), start_of(eye.found, eye.edges));
  return eye.fit.value();
}

EyeFit right_eye(const Stack& stack) { return eye_of(stack, Laterality::od); }

/// 0.02 mm, 0.05 D, and 2 % of every interval.
void expect_same(const EyeFit& a, const EyeFit& b) {
  for (const Parameter length : {axial_length, globe_x, globe_y, anterior_chamber_depth, lens_thickness}) {
    EXPECT_NEAR(a.value(length), b.value(length), 0.02) << a.layout.name(length);
    EXPECT_NEAR(a.sigma(length), b.sigma(length), 0.02 * b.sigma(length)) << a.layout.name(length);
  }
  EXPECT_NEAR(keratometric_D_mm * a.value(cornea_c), keratometric_D_mm * b.value(cornea_c), 0.05);
}

/// Width, height and the cylinder's axis are told across the header's horizontal.
void expect_same_but_across(const EyeFit& a, const EyeFit& b) {
  for (const Parameter length : {axial_length, globe_z, anterior_chamber_depth, lens_thickness}) {
    EXPECT_NEAR(a.value(length), b.value(length), 0.02) << a.layout.name(length);
    EXPECT_NEAR(a.sigma(length), b.sigma(length), 0.02 * b.sigma(length)) << a.layout.name(length);
  }
  EXPECT_NEAR(keratometric_D_mm * a.value(cornea_c), keratometric_D_mm * b.value(cornea_c), 0.05);
  EXPECT_NEAR(keratometric_D_mm * std::hypot(a.value(cornea_j0), a.value(cornea_j45)),
              keratometric_D_mm * std::hypot(b.value(cornea_j0), b.value(cornea_j45)), 0.05);
}

Stack turned_a_little(Stack stack) {
  return turned_header(std::move(stack), 5 * degree, Eigen::Vector3d(1, 2, 3).normalized());
}

// A whole head in T1, its voxels cubes of 1.6 mm.
TEST(StoredOtherwise, ARealHeadHasTheSameEye) {
  const char* scans = std::getenv("EMMETROPE_REAL_SCANS");
  if (scans == nullptr) GTEST_SKIP() << "EMMETROPE_REAL_SCANS names no folder of real scans";
  std::vector<std::string> warnings;
  Stack plain = read_nifti(std::filesystem::path(scans) / "niivue_t1_head" / "T1_head_ext2.nii.gz", warnings);
  plain.fat_shift_sigma_mm = {plain.column_spacing_mm, plain.row_spacing_mm};
  const EyeFit as_it_is = right_eye(plain);
  for (const Storage& storage : {Storage{{~0, 1, ~2}}, Storage{{2, ~1, 0}}, Storage{{1, 2, 0}, {4, 6, 0}}})
    expect_same(right_eye(stored_otherwise(plain, storage)), as_it_is);
  expect_same(eye_of(in_mirror(plain), Laterality::os), as_it_is);
  expect_same_but_across(right_eye(turned_a_little(plain)), as_it_is);
}

/// A phantom's, in T2.
const Stack& small_head() {
  static const Stack stack = small_scan(7);
  return stack;
}

const EyeFit& its_right_eye() {
  static const EyeFit eye = right_eye(small_head());
  return eye;
}

TEST(StoredOtherwise, VoxelsATenthLargerAreAnEyeATenthLarger) {
  constexpr double scale = 1.1, tolerance = 0.003;
  Stack stack = small_head();
  for (double* length_mm : {&stack.row_spacing_mm, &stack.column_spacing_mm, &stack.slice_thickness_mm})
    *length_mm *= scale;
  stack.fat_shift_sigma_mm *= scale;
  for (Eigen::Vector3d& position : stack.slice_position) position *= scale;
  const EyeFit larger = right_eye(stack);
  for (const Parameter length : {axial_length, globe_x, globe_y})
    EXPECT_NEAR(larger.value(length) / its_right_eye().value(length), scale, scale * tolerance)
        << larger.layout.name(length);
  // Of which the population's lengths, which do not grow, say a part: within the intervals.
  for (const Parameter length : {anterior_chamber_depth, lens_thickness})
    EXPECT_NEAR(larger.value(length), scale * its_right_eye().value(length), 2 * larger.sigma(length))
        << larger.layout.name(length);
}

TEST(StoredOtherwise, AHeaderTurnedALittleHasTheSameEye) {
  expect_same_but_across(right_eye(turned_a_little(small_head())), its_right_eye());
}

TEST(StoredOtherwise, TheMirroredHeadHasTheSameEyeOnTheOtherSide) {
  const EyeFit mirrored = eye_of(in_mirror(small_head()), Laterality::os);
  expect_same(mirrored, its_right_eye());
  // An axis a becomes 180 - a.
  EXPECT_NEAR(keratometric_D_mm * mirrored.value(cornea_j0),
              keratometric_D_mm * its_right_eye().value(cornea_j0), 0.05);
  EXPECT_NEAR(keratometric_D_mm * mirrored.value(cornea_j45),
              -keratometric_D_mm * its_right_eye().value(cornea_j45), 0.05);
}

}  // namespace
}  // namespace emmetrope::segmentation
