#pragma once
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "segmentation/intake/study.hpp"
#include "tests/support/generated_series.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope::test {

inline segmentation::IntakeOptions quiet() {
  segmentation::IntakeOptions options;
  options.verbosity.quiet = true;
  return options;
}

/// A folder for a generated study.
class IntakeTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { register_encoders(); }
  segmentation::StudyInventory inventory() const { return segmentation::read_inventory(folder(), quiet()); }
  /// The only series of the study.
  segmentation::SeriesInfo only_series() const {
    const auto found = inventory();
    if (found.series.size() != 1) throw std::runtime_error("not one series");
    return found.series.front();
  }
  segmentation::Stack read_only_series() const {
    const auto found = inventory();
    return segmentation::read_series(found, found.series.at(0).uid, quiet());
  }
  const std::filesystem::path& folder() const { return folder_.path(); }

 private:
  TemporaryFolder folder_;
};

/// Every voxel and position is what GeneratedSeries made.
inline void expect_generated_volume(const segmentation::Stack& stack) {
  ASSERT_EQ(stack.rows, GeneratedSeries::rows);
  ASSERT_EQ(stack.columns, GeneratedSeries::columns);
  ASSERT_EQ(stack.slices(), GeneratedSeries::slices);
  EXPECT_DOUBLE_EQ(stack.row_spacing_mm, 0.5);
  EXPECT_DOUBLE_EQ(stack.column_spacing_mm, 0.4);
  EXPECT_LT((stack.along_row - GeneratedSeries::along_row()).norm(), 1e-9);
  EXPECT_LT((stack.along_column - GeneratedSeries::along_column()).norm(), 1e-9);
  for (int slice = 0; slice < stack.slices(); ++slice) {
    EXPECT_LT((stack.slice_position[slice] - GeneratedSeries::position(slice)).norm(), 1e-6);
    for (int row = 0; row < stack.rows; ++row)
      for (int column = 0; column < stack.columns; ++column)
        ASSERT_EQ(stack.at(column, row, slice), GeneratedSeries::value(column, row, slice))
            << column << " " << row << " " << slice;
  }
}

}  // namespace emmetrope::test
