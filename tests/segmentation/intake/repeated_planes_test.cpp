// A NIfTI volume whose planes were copied: what lies behind a plane too many is in another place.
#include "segmentation/intake/repeated_planes.hpp"

#include <array>
#include <random>
#include <vector>

#include "pipeline/base/error.hpp"
#include "segmentation/intake/nifti.hpp"
#include "tests/segmentation/intake/intake_test.hpp"

namespace emmetrope::test {
namespace {

using segmentation::Stack;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;

/// Noise whose planes along one axis are put together anew.
Stack volume(int axis, const std::vector<int>& sources) {
  constexpr int size = 12;
  std::mt19937 random(7);
  std::uniform_int_distribution<int> grey(0, 4000);
  std::vector<float> acquired(size * size * size);
  for (float& value : acquired) value = static_cast<float>(grey(random));
  Stack stack;
  stack.name = "stack1";
  const int planes = static_cast<int>(sources.size());
  const std::array<int, 3> count{axis == 0 ? planes : size, axis == 1 ? planes : size,
                                 axis == 2 ? planes : size};
  stack.columns = count[0];
  stack.rows = count[1];
  stack.along_row = Eigen::Vector3d::UnitX();
  stack.along_column = Eigen::Vector3d::UnitY();
  stack.normal = Eigen::Vector3d::UnitZ();
  stack.column_spacing_mm = stack.row_spacing_mm = stack.slice_thickness_mm = 1;
  for (int s = 0; s < count[2]; ++s) {
    stack.slice_position.emplace_back(0, 0, s);
    std::vector<float>& values = stack.slice_intensity.emplace_back();
    for (int r = 0; r < count[1]; ++r)
      for (int c = 0; c < count[0]; ++c) {
        std::array<int, 3> from{c, r, s};
        from[axis] = sources[static_cast<std::size_t>(from[axis])];
        values.push_back(from[axis] < 0 ? 0 : acquired[(from[2] * size + from[1]) * size + from[0]]);
      }
  }
  return stack;
}

constexpr int beyond_the_head = -1;

TEST(RepeatedPlanes, AreFoundAlongEachAxis) {
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_TRUE(find_repeated_planes(volume(axis, {0, 1, 2, 3, 4, 5, 6, 7})).empty()) << axis;
    const auto found = find_repeated_planes(volume(axis, {0, 1, 2, 3, 3, 3, 4, 5, 6, 7}));
    ASSERT_EQ(found.size(), 1U) << axis;
    EXPECT_EQ(found[0].axis, axis);
    EXPECT_THAT(found[0].same_as_next, ElementsAre(3, 4));
    EXPECT_FALSE(found[0].throughout);
  }
}

TEST(RepeatedPlanes, AreNoBackgroundAndNoBorder) {
  const int none = beyond_the_head;
  EXPECT_TRUE(find_repeated_planes(volume(0, {none, none, 1, 2, none, none, 3, 4, none, none})).empty());
  EXPECT_TRUE(find_repeated_planes(volume(0, {none, 1, 1, 1, 2, 3, 4, 4, none})).empty());
}

/// Voxels that were repeated, twice, three times or every other one, leave lengths as they are.
TEST(RepeatedPlanes, OfAnEnlargedVolumeAreThroughout) {
  for (const double factor : {1.4, 1.5, 2.0, 2.3, 3.0}) {
    std::vector<int> sources;
    for (int i = 0; i < 12 * factor; ++i) sources.push_back(static_cast<int>((i + 0.01) / factor));
    const auto found = find_repeated_planes(volume(1, sources));
    ASSERT_EQ(found.size(), 1U) << factor;
    EXPECT_TRUE(found[0].throughout) << factor;
  }
  const auto copies = find_repeated_planes(volume(1, {0, 1, 2, 3, 4, 5, 5, 5, 5, 5, 6, 7, 8, 9, 10}));
  ASSERT_EQ(copies.size(), 1U);
  EXPECT_FALSE(copies[0].throughout) << "five of one plane";
}

TEST(RepeatedPlanes, AreCountedFromASideOfThePatient) {
  const auto words = [](const Stack& stack) { return described(find_repeated_planes(stack).at(0), stack); };
  EXPECT_EQ(words(volume(0, {0, 1, 2, 2, 3, 4})),
            "sagittal planes 3 and 4 of 6, counted from the patient's right");
  EXPECT_EQ(words(volume(2, {0, 1, 1, 1, 2, 3, 4, 4, 5})),
            "axial planes 2 to 4 of 9, counted from the patient's feet, and others");
  Stack mirrored = volume(1, {0, 1, 2, 2, 2, 3, 4});
  mirrored.along_column *= -1;
  mirrored.normal *= -1;
  EXPECT_EQ(words(mirrored), "coronal planes 3 to 5 of 7, counted from the patient's front");
}

TEST_F(IntakeTest, AVolumeWithAPlaneTooManyIsRefused) {
  write_nifti(folder() / "Doe.nii.gz", volume(0, {0, 1, 2, 3, 3, 4, 5, 6}));
  const auto series = only_series();
  EXPECT_FALSE(series.usable);
  EXPECT_EQ(series.refusal, ExitStatus::input_invalid);
  EXPECT_THAT(series.reason,
              HasSubstr("Doe.nii.gz: sagittal planes 4 and 5 of 8, counted from the patient's right, "
                        "hold the same voxels"));
  EXPECT_THAT(series.kept.reason, testing::Not(HasSubstr("Doe")));
}

TEST_F(IntakeTest, AVolumeThatWasEnlargedByRepeatingVoxelsIsSaid) {
  std::vector<int> twice;
  for (int i = 0; i < 24; ++i) twice.push_back(i / 2);
  write_nifti(folder() / "a.nii.gz", volume(2, twice));
  const auto series = only_series();
  EXPECT_TRUE(series.usable);
  EXPECT_THAT(series.warnings,
              Contains(HasSubstr("its voxels were repeated to enlarge it (axial planes 3 and 4 of 24")));
}

}  // namespace
}  // namespace emmetrope::test
