// One stack of a head beside its mirror image, in another contrast, resolution and orientation.
#include "segmentation/finding/mirrored_stacks.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <random>

#include "pipeline/base/error.hpp"
#include "segmentation/intake/study.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;

/// Tissues on both sides of the midline alike but for small ones, as a head's are.
class Head {
 public:
  Head() {
    std::mt19937 random(5);
    std::uniform_real_distribution<double> aside(0, 70), along(-20, 90), up(-45, 45), size(4, 16), any(0, 1);
    for (int i = 0; i < 60; ++i) {
      const Blob blob{{aside(random), along(random), up(random)}, size(random), any(random)};
      blobs_.push_back(blob);
      Blob other = blob;
      other.centre.x() *= -1;
      if (any(random) < 0.7) other.centre += Vector3d(6 * any(random), -6 * any(random), 5 * any(random));
      blobs_.push_back(other);
    }
  }
  double at(const Vector3d& lps) const {
    double value = 0;
    for (const Blob& blob : blobs_)
      value +=
          blob.brightness * std::exp(-(lps - blob.centre).squaredNorm() / (2 * blob.size_mm * blob.size_mm));
    return value;
  }

 private:
  struct Blob {
    Vector3d centre;
    double size_mm, brightness;
  };
  std::vector<Blob> blobs_;
};

/// \param contrast  of a tissue's brightness
Stack scanned(const Head& head, const Eigen::Matrix3d& axes, double voxel_mm, double (*contrast)(double)) {
  constexpr double side_mm = 150;
  Stack stack;
  stack.columns = stack.rows = static_cast<int>(side_mm / voxel_mm);
  stack.along_row = axes.col(0);
  stack.along_column = axes.col(1);
  stack.normal = axes.col(2);
  stack.column_spacing_mm = stack.row_spacing_mm = stack.slice_thickness_mm = voxel_mm;
  const Vector3d first = Vector3d(0, 30, 0) - side_mm / 2 * (axes.col(0) + axes.col(1) + axes.col(2));
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0, 0.02);
  for (int s = 0; s < stack.columns; ++s) {
    stack.slice_position.push_back(first + s * voxel_mm * axes.col(2));
    auto& slice = stack.slice_intensity.emplace_back();
    for (int r = 0; r < stack.rows; ++r)
      for (int c = 0; c < stack.columns; ++c)
        slice.push_back(static_cast<float>(contrast(head.at(stack.position(c, r, s))) + noise(random)));
  }
  return stack;
}

/// As a program stores it that runs along rows from the other end.
Stack stored_backward(Stack stack) {
  for (auto& slice : stack.slice_intensity)
    for (int r = 0; r < stack.rows; ++r)
      std::reverse(slice.begin() + static_cast<long>(r) * stack.columns,
                   slice.begin() + static_cast<long>(r + 1) * stack.columns);
  return stack;
}

FoundEyes found_in_both() {
  FoundEyes found;
  for (const auto& [laterality, x_mm] : {std::pair{Laterality::od, -31.0}, {Laterality::os, 32.0}}) {
    FoundEye eye;
    eye.laterality = laterality;
    for (const std::size_t stack : {0, 1}) {
      EyeView view;
      view.stack = stack;
      view.globe.centre = {x_mm, 2, 1};
      eye.views.push_back(view);
    }
    found.eyes.push_back(eye);
  }
  return found;
}

TEST(MirroredStacks, AreRefusedAndOthersAreNot) {
  const Head head;
  Eigen::Matrix3d axial = Eigen::Matrix3d::Identity(), coronal;
  coronal << Vector3d::UnitX(), -Vector3d::UnitZ(), Vector3d::UnitY();
  const Stack one = scanned(head, axial, 3, [](double value) { return value; }),
              other = scanned(head, coronal, 2.5, [](double value) { return 2 - value * value; });
  const FoundEyes found = found_in_both();
  EXPECT_NO_THROW(require_no_mirrored_stack(found, {&one, &other}));
  const Stack mirrored = stored_backward(other), mirrored_too = stored_backward(one);
  for (const auto& stacks : {std::vector<const Stack*>{&one, &mirrored}, {&mirrored_too, &other}}) try {
      require_no_mirrored_stack(found, stacks);
      ADD_FAILURE();
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::input_invalid);
      EXPECT_NE(std::string(error.what()).find("only if one of them is mirrored"), std::string::npos);
    }
  // Nothing tells on both, nor on one alone.
  EXPECT_NO_THROW(require_no_mirrored_stack(found, {&mirrored_too, &mirrored}));
}

/// One person's T1 and T2.
TEST(MirroredStacks, OfARealHeadAreRefused) {
  const char* scans = std::getenv("EMMETROPE_REAL_SCANS");
  if (scans == nullptr) GTEST_SKIP() << "EMMETROPE_REAL_SCANS names no folder of real scans";
  const auto read = [&](const char* scan) {
    const StudyInventory inventory = read_inventory(std::filesystem::path(scans) / scan / "dicom", {});
    return read_series(inventory, inventory.series.front().uid, {});
  };
  const Stack t1 = read("fnndsc_adi_t1_dicom"), t2 = read("fnndsc_adi_t2_dicom");
  EXPECT_NO_THROW(require_no_mirrored_stack(find_eyes({&t1, &t2}, {"", ""}), {&t1, &t2}));
  ASSERT_GT(t2.along_row.x(), 0.9);
  const Stack mirrored = stored_backward(t2);
  EXPECT_THROW(require_no_mirrored_stack(find_eyes({&t1, &mirrored}, {"", ""}), {&t1, &mirrored}), Error);
}

TEST(MirroredStacks, OfTwoThatShareTooLittleNothingIsSaid) {
  const Head head;
  const Stack one = scanned(head, Eigen::Matrix3d::Identity(), 5, [](double value) { return value; });
  Stack thin = one;
  thin.slice_position.resize(3);
  thin.slice_intensity.resize(3);
  const GlobePair globes{{-31, 2, 1}, {32, 2, 1}};
  EXPECT_FALSE(common_information(one, globes, thin, globes));
  EXPECT_TRUE(common_information(one, globes, one, globes));
}

}  // namespace
}  // namespace emmetrope::segmentation
