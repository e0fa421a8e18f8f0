// The same voxels give the same eye, however a file stores them.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "pipeline/eye/population/population.hpp"
#include "segmentation/intake/nifti.hpp"
#include "segmentation/judgement/fellow_eye.hpp"
#include "tests/support/stored_otherwise.hpp"

namespace emmetrope::segmentation {
namespace {

/// The right eye, found, read by its edges and fitted.
EyeFit right_eye(const Stack& stack) {
  const std::vector<const Stack*> stacks{&stack};
  const FoundEyes found = find_eyes(stacks, {""});
  if (found.eyes.empty()) throw std::runtime_error("no eye found");
  JudgedEye eye;
  eye.found = found.eyes.front();
  eye.edges = read_edges_of(eye.found, stacks);
  fit_and_judge(eye, stacks, start_of(eye.found, eye.edges));
  return eye.fit.value();
}

/// 0.02 mm, 0.05 D, and 2 % of every interval.
void expect_same(const EyeFit& a, const EyeFit& b) {
  for (const Parameter length : {axial_length, globe_x, globe_y, anterior_chamber_depth, lens_thickness}) {
    EXPECT_NEAR(a.value(length), b.value(length), 0.02) << a.layout.name(length);
    EXPECT_NEAR(a.sigma(length), b.sigma(length), 0.02 * b.sigma(length)) << a.layout.name(length);
  }
  EXPECT_NEAR(keratometric_D_mm * a.value(cornea_c), keratometric_D_mm * b.value(cornea_c), 0.05);
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
}

}  // namespace
}  // namespace emmetrope::segmentation
