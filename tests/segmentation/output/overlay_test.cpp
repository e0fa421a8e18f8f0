// What an overlay shows of an eye that edges tell of: the globe where it was read, crosses on its axis, and that it is so.
#include "segmentation/output/overlay.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgcodecs.hpp>

#include "tests/support/pixels.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;

/// Axial slices of 1 mm about the origin, with a bright bar of 3 x 3 mm through all of them at x 3, y -2.
Stack marked_stack() {
  Stack stack;
  stack.name = "stack1";
  stack.rows = stack.columns = 48;
  stack.row_spacing_mm = stack.column_spacing_mm = 1;
  stack.along_row = Vector3d::UnitX();
  stack.along_column = Vector3d::UnitY();
  stack.normal = Vector3d::UnitZ();
  for (int s = -20; s <= 20; ++s) {
    stack.slice_position.push_back(Vector3d(-24, -24, s));
    auto& slice =
        stack.slice_intensity.emplace_back(static_cast<std::size_t>(stack.rows) * stack.columns, 100.0F);
    for (const int y : {-3, -2, -1})
      for (const int x : {2, 3, 4})
        slice[static_cast<std::size_t>(y + 24) * 48 + static_cast<std::size_t>(x + 24)] = 1000;
  }
  return stack;
}

EdgeReading sphere_of(double radius_mm) {
  EdgeReading reading;
  reading.globe.axes.col(0) = Vector3d::UnitX();
  reading.globe.axes.col(1) = Vector3d::UnitZ();
  reading.globe.axes.col(2) = -Vector3d::UnitY();
  reading.globe.half_axes = Vector3d::Constant(radius_mm);
  reading.axial = AxialEdges{12.2, 8.5, 5, -radius_mm};
  return reading;
}

constexpr double pixel_mm = 36.0 / 288;

/// Of the third slice shown, 1.6 mm below the middle (or the nearest, 2 mm): where its globe's outline lies, mm about the
/// middle of the picture, which is 1.5 mm before the globe's centre.
struct Outline {
  double radius_mm = 0, largest_error_mm = 0;
  int pixels = 0;
};
Outline outline_of(const std::filesystem::path& file, const cv::Vec3b& colour) {
  Outline outline;
  const cv::Mat tile = cv::imread(file.string())(cv::Rect(576, 0, 288, 288));
  std::vector<cv::Point2d> points;
  for (int y = 0; y < tile.rows; ++y)
    for (int x = 0; x < tile.cols; ++x)
      if (tile.at<cv::Vec3b>(y, x) == colour)
        points.emplace_back((x + 1 - 144) * pixel_mm, (y + 1 - 144) * pixel_mm - 1.5);
  outline.pixels = static_cast<int>(points.size());
  for (const cv::Point2d& p : points) outline.radius_mm += std::hypot(p.x, p.y) / outline.pixels;
  for (const cv::Point2d& p : points)
    outline.largest_error_mm =
        std::max(outline.largest_error_mm, std::abs(std::hypot(p.x, p.y) - outline.radius_mm));
  return outline;
}

const cv::Vec3b blue(255, 120, 40), orange(0, 140, 255), green_of_a_fit(80, 220, 60);

class EdgeOverlay : public testing::Test {
 protected:
  std::filesystem::path of(const ToldEdges& told) const {
    std::filesystem::path file = folder_.path() / "overlay.png";
    write_edge_overlay(file, marked_stack(), told);
    return file;
  }

 private:
  const test::TemporaryFolder folder_;
};

TEST_F(EdgeOverlay, DrawsTheGlobeWhereItWasRead) {
  const Outline outline = outline_of(of({sphere_of(11), {0, 0, 0}, false}), blue);
  // Slices lie at whole millimetres: the one shown 1.6 mm below the middle is at -2.
  EXPECT_NEAR(outline.radius_mm, std::sqrt(11.0 * 11 - 2 * 2), pixel_mm);
  EXPECT_LT(outline.largest_error_mm, 1.5 * pixel_mm);
  EXPECT_GT(outline.pixels, 400);
}

/// Nobody takes it for the inner wall of a fit.
TEST_F(EdgeOverlay, HasALookOfItsOwn) {
  EXPECT_EQ(test::pixels_of(of({sphere_of(11), {0, 0, 0}, true}), green_of_a_fit), 0);
}

/// The picture is about the globe where the head has it, and of slices there.
TEST_F(EdgeOverlay, MovesWithTheHead) {
  const Vector3d shift(3, -2, 4);
  const std::filesystem::path file = of({sphere_of(11), shift, false});
  const Outline outline = outline_of(file, blue);
  EXPECT_NEAR(outline.radius_mm, std::sqrt(11.0 * 11 - 2 * 2), pixel_mm);
  EXPECT_LT(outline.largest_error_mm, 1.5 * pixel_mm);
  // The bar lies at the shifted globe's centre, 1.5 mm behind the middle of a picture whose slice shows it.
  const cv::Mat tile = cv::imread(file.string())(cv::Rect(576, 0, 288, 288));
  const int behind_px = static_cast<int>(std::lround(1.5 / pixel_mm));
  EXPECT_GT(tile.at<cv::Vec3b>(144 + behind_px, 144)[0], 200);
  EXPECT_LT(tile.at<cv::Vec3b>(144 - behind_px, 144)[0], 50);
}

TEST_F(EdgeOverlay, CrossesTheAxisWhereItsNumbersAreTold) {
  EXPECT_GT(test::pixels_of(of({sphere_of(11), {0, 0, 0}, true}), orange), 20);
  EXPECT_EQ(test::pixels_of(of({sphere_of(11), {0, 0, 0}, false}), orange), 0);
  EdgeReading without = sphere_of(11);
  without.axial.reset();
  EXPECT_EQ(test::pixels_of(of({without, {0, 0, 0}, true}), orange), 0);
}

}  // namespace
}  // namespace emmetrope::segmentation
