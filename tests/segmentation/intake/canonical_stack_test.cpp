#include "segmentation/intake/canonical_stack.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <ostream>

#include "tests/support/stored_otherwise.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;

/// Any function without symmetries.
float brightness(const Vector3d& x) {
  return static_cast<float>(100 + x.x() + 3 * x.y() + 7 * x.z() + 0.1 * x.x() * x.y());
}

/// A head: columns to the left, rows to the back, slices up, all turned a little; its header tells no readout.
Stack head(const Vector3d& voxel_mm) {
  const Eigen::Matrix3d turned = Eigen::AngleAxisd(0.1, Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  Stack stack;
  stack.name = "stack1";
  stack.columns = 61;
  stack.rows = 70;
  stack.along_row = turned.col(0);
  stack.along_column = turned.col(1);
  stack.normal = turned.col(2);
  stack.column_spacing_mm = voxel_mm.x();
  stack.row_spacing_mm = voxel_mm.y();
  stack.slice_thickness_mm = voxel_mm.z();
  stack.fat_shift_sigma_mm = voxel_mm.head<2>();
  for (int s = 0; s < 80; ++s) {
    stack.slice_position.emplace_back(turned * Vector3d(-30, -35, s - 40).cwiseProduct(voxel_mm));
    std::vector<float>& values = stack.slice_intensity.emplace_back();
    for (int r = 0; r < stack.rows; ++r)
      for (int c = 0; c < stack.columns; ++c) values.push_back(brightness(stack.position(c, r, s)));
  }
  return stack;
}

struct StoredHead {
  Vector3d voxel_mm;
  Storage storage;
};
void PrintTo(const StoredHead& stored, std::ostream* out) {
  for (const int axis : stored.storage.axis) *out << (axis < 0 ? "-" : "+") << "xyz"[std::max(axis, ~axis)];
  *out << " of " << stored.voxel_mm.transpose() << " mm, cropped by " << stored.storage.cropped.transpose();
}

void expect_same(const Stack& a, const Stack& b) {
  ASSERT_EQ(a.columns, b.columns);
  ASSERT_EQ(a.rows, b.rows);
  ASSERT_EQ(a.slices(), b.slices());
  EXPECT_LT((a.along_row - b.along_row).norm(), 1e-12);
  EXPECT_LT((a.along_column - b.along_column).norm(), 1e-12);
  EXPECT_LT((a.normal - b.normal).norm(), 1e-12);
  EXPECT_NEAR(a.column_spacing_mm, b.column_spacing_mm, 1e-9);
  EXPECT_NEAR(a.row_spacing_mm, b.row_spacing_mm, 1e-9);
  EXPECT_NEAR(a.slice_thickness_mm, b.slice_thickness_mm, 1e-9);
  EXPECT_LT((a.fat_shift_sigma_mm - b.fat_shift_sigma_mm).norm(), 1e-9);
  for (int s = 0; s < a.slices(); ++s) {
    EXPECT_LT((a.slice_position[s] - b.slice_position[s]).norm(), 1e-9);
    EXPECT_EQ(a.slice_intensity[s], b.slice_intensity[s]);
  }
}

const Vector3d eye(3, -4, 5);
constexpr double reach_mm = 12;

class Ways : public testing::TestWithParam<StoredHead> {};

TEST_P(Ways, GiveTheSameVoxelsInTheSameOrder) {
  const Stack plain = head(GetParam().voxel_mm);
  expect_same(canonical_part(stored_otherwise(plain, GetParam().storage), eye, reach_mm),
              canonical_part(plain, eye, reach_mm));
}

const Vector3d sagittal_mm(1.1, 0.9, 0.9), cubes_mm(1, 1, 1), thick_mm(0.5, 0.5, 3);
INSTANTIATE_TEST_SUITE_P(
    OfStoring, Ways,
    testing::Values(StoredHead{sagittal_mm, {{~0, 1, 2}}}, StoredHead{sagittal_mm, {{0, ~1, ~2}}},
                    StoredHead{sagittal_mm, {{1, 2, 0}}}, StoredHead{sagittal_mm, {{~2, 0, 1}}},
                    StoredHead{sagittal_mm, {{1, ~0, ~2}}},
                    StoredHead{sagittal_mm, {{0, 1, 2}, {10, 12, 14}}}, StoredHead{cubes_mm, {{~1, ~2, ~0}}},
                    StoredHead{cubes_mm, {{2, 1, 0}, {5, 0, 9}}}, StoredHead{thick_mm, {{1, 0, 2}}},
                    StoredHead{thick_mm, {{~2, 1, ~0}}}));

TEST(CanonicalPart, KeepsWhereEveryVoxelLies) {
  const Stack part = canonical_part(stored_otherwise(head(sagittal_mm), {{~2, 0, 1}}), eye, reach_mm);
  EXPECT_GT(part.along_row.y(), 0.9);     // sagittal, as voxels are longest to the left: rows run back,
  EXPECT_GT(part.along_column.z(), 0.9);  // columns up
  for (int s = 0; s < part.slices(); ++s)
    for (int r = 0; r < part.rows; ++r)
      for (int c = 0; c < part.columns; ++c)
        ASSERT_NEAR(part.at(c, r, s), brightness(part.position(c, r, s)), 1e-3);
  EXPECT_NEAR(part.extent_mm, 80 * 0.9, 1e-9);  // of the whole
  EXPECT_LE((part.position((part.columns - 1) / 2.0, (part.rows - 1) / 2.0, part.slices() / 2) - eye).norm(),
            1);
}

TEST(CanonicalPart, LeavesSlicesThatAreNotEvenlyApartAsTheyAre) {
  Stack stack = stored_otherwise(head(cubes_mm), {{1, 2, 0}});
  stack.slice_position.erase(stack.slice_position.begin() + 20);
  stack.slice_intensity.erase(stack.slice_intensity.begin() + 20);
  const Stack part = canonical_part(stack, eye, reach_mm);
  EXPECT_GT(std::abs(part.normal.dot(stack.normal)), 1 - 1e-12);
  EXPECT_EQ(part.slices(), stack.slices());
}

TEST(CanonicalPart, LeavesSlicesThatWereAcquiredOneByOne) {
  Stack stack = head(cubes_mm);
  EXPECT_GT(std::abs(canonical_part(stack, eye, reach_mm).normal.x()), 0.9);
  stack.slices_are_told = true;
  EXPECT_GT(canonical_part(stack, eye, reach_mm).normal.z(), 0.9);
}

TEST(CanonicalPart, ReadsSagittalSlicesOutUpAndDownWhereNothingIsTold) {
  EXPECT_EQ(canonical_part(head(cubes_mm), eye, reach_mm).fat_shift_sigma_mm, Eigen::Vector2d(0, 1));
  EXPECT_EQ(canonical_part(head(thick_mm), eye, reach_mm).fat_shift_sigma_mm, Eigen::Vector2d(0.5, 0.5));
}

TEST(CanonicalPart, KeepsAReadoutThatIsToldInTheSlices) {
  Stack stack = head(cubes_mm);
  stack.fat_shift_sigma_mm = {1.5, 0};  // along the row, to the left
  const Stack part = canonical_part(stack, eye, reach_mm);
  EXPECT_GT(std::abs(part.normal.z()), 0.9);
  EXPECT_GT(part.along_row.x(), 0.9);
  EXPECT_EQ(part.fat_shift_sigma_mm, Eigen::Vector2d(1.5, 0));
}

}  // namespace
}  // namespace emmetrope::segmentation
