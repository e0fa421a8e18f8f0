// Real scans, where EMMETROPE_REAL_SCANS names their folder.
#include <cstdlib>

#include "tests/segmentation/intake/intake_test.hpp"

namespace emmetrope::test {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;

class RealScans : public ::testing::Test {
 protected:
  void SetUp() override {
    if (std::getenv("EMMETROPE_REAL_SCANS") == nullptr)
      GTEST_SKIP() << "EMMETROPE_REAL_SCANS does not name the folder of the real scans";
  }
  static segmentation::StudyInventory read(const std::string& name) {
    return segmentation::read_inventory(std::filesystem::path(std::getenv("EMMETROPE_REAL_SCANS")) / name,
                                        quiet());
  }
  static segmentation::Stack stack_of(const segmentation::StudyInventory& found) {
    return segmentation::read_series(found, found.series.at(0).uid, quiet());
  }
};

TEST_F(RealScans, AdultT2) {
  const auto found = read("fnndsc_adi_t2_dicom");
  const auto& info = found.series.at(0);
  ASSERT_TRUE(info.usable) << info.reason;
  EXPECT_EQ(info.files, 55U);
  EXPECT_EQ(info.rows, 512);
  EXPECT_EQ(info.columns, 384);
  EXPECT_NEAR(*info.slice_spacing_mm, 2.5, 1e-3);
  EXPECT_NEAR(*info.row_spacing_mm, 0.4296875, 1e-9);
  EXPECT_FALSE(info.uniform);
  EXPECT_THAT(info.warnings, Contains(HasSubstr("1 slice is missing")));
  EXPECT_EQ(found.subject_of(info).age_years, 26);
  const auto stack = stack_of(found);
  double longest = 0;
  int above = 0;
  for (int slice = 1; slice < stack.slices(); ++slice) {
    const double step = stack.normal.dot(stack.slice_position[slice] - stack.slice_position[slice - 1]);
    if (step > longest) {
      longest = step;
      above = slice;
    }
  }
  EXPECT_NEAR(longest, 5.0, 1e-3);
  EXPECT_NEAR(stack.slice_position[above - 1].z(), 35.245, 1e-3);  // as dcmdump prints it
  EXPECT_NEAR(stack.slice_position[above].z(), 40.220, 1e-3);
  const std::string text = to_json(found).dump() + describe(found);
  for (const auto* secret : {"SpiralCSI", "19860101", "Boston", "GAGOSKI"})
    EXPECT_THAT(text, Not(HasSubstr(secret)));
}

TEST_F(RealScans, AdultT1WithAMissingSliceThroughTheRightEye) {
  const auto found = read("fnndsc_adi_t1_dicom");
  const auto& info = found.series.at(0);
  ASSERT_TRUE(info.usable) << info.reason;
  EXPECT_EQ(info.files, 107U);
  EXPECT_NEAR(*info.slice_spacing_mm, 1.0, 1e-3);
  const auto stack = stack_of(found);
  for (int slice = 1; slice < stack.slices(); ++slice) {
    const double step = stack.normal.dot(stack.slice_position[slice] - stack.slice_position[slice - 1]);
    EXPECT_NEAR(step, step > 1.5 ? 2.0 : 1.0, 1e-3);
    if (step > 1.5) {
      EXPECT_NEAR(std::abs(stack.slice_position[slice].x() + stack.slice_position[slice - 1].x()) / 2, 43.081,
                  1e-3);
    }
  }
}

TEST_F(RealScans, ChildT1) {
  const auto stack = stack_of(read("fnndsc_child_t1_nii"));
  EXPECT_EQ(stack.rows * stack.columns * stack.slices(), 192 * 162 * 164);
  // The header's sform times (100, 50, 60), by hand, x and y turned to LPS.
  EXPECT_LT((stack.position(100, 50, 60) - Eigen::Vector3d(-5.12182, 23.41475, -24.81804)).norm(), 1e-4);
}

TEST_F(RealScans, VolumeWithHolesAndAScale) {
  const auto found = read("seg3d_t1_nii");
  EXPECT_NEAR(*found.series.at(0).maximum, 512, 0.01);
  EXPECT_NEAR(*found.series[0].slice_spacing_mm, 0.898, 1e-3);
}

}  // namespace
}  // namespace emmetrope::test
