#include "segmentation/labels/hand_labels.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>

#include "data_samples/phantom/phantom.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/eye/parametric/parametric_eye.hpp"
#include "segmentation/intake/nifti.hpp"
#include "segmentation/intake/study.hpp"
#include "segmentation/stage.hpp"

namespace emmetrope::segmentation {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;
using Values = std::vector<std::vector<std::uint8_t>>;

/// The right eye's label of what the phantom has at a point.
Label drawn(phantom::Tissue tissue) {
  switch (tissue) {
    case phantom::Tissue::cornea:
      return Label::cornea;
    case phantom::Tissue::aqueous:
      return Label::anterior_chamber;
    case phantom::Tissue::iris:
      return Label::iris;
    case phantom::Tissue::lens:
      return Label::lens;
    case phantom::Tissue::vitreous:
      return Label::vitreous;
    case phantom::Tissue::wall:
    case phantom::Tissue::ciliary_body:
      return Label::wall;
    default:
      return Label::none;
  }
}

class HandLabelsStage : public testing::Test {
 protected:
  void SetUp() override {
    const std::string test = testing::UnitTest::GetInstance()->current_test_info()->name();
    folder_ = fs::temp_directory_path() / ("emmetrope_labels_" + test + "_" + std::to_string(::getpid()));
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    common_.verbosity.quiet = true;
    common_.laterality = LateralityChoice::od;
    sample_ = data_folder() / "data_samples" / "sample";
  }
  void TearDown() override { fs::remove_all(folder_); }

  Stack stack(const std::string& name) const {
    const StudyInventory inventory = read_inventory(sample_);
    for (const SeriesInfo& info : inventory.series)
      if (info.name == name) return read_series(inventory, info.uid);
    throw Error(ExitStatus::fault, "the sample has no " + name);
  }

  /// The true tissue of the right eye at each voxel's centre; all that lies behind the globe's middle is
  /// moved back by this much, the gap filled with what is at the middle; and all of it upwards.
  fs::path draw(const std::string& name, double lengthened_mm, double raised_mm = 0) const {
    const phantom::HeadGeometry head = phantom::sample_head();
    const phantom::Anatomy anatomy(head);
    const phantom::PlacedEye eye = phantom::place(head, Laterality::od);
    const Vector3d forward = eye.lps_from_eye.linear().col(2), middle = eye.globe_centre_lps();
    const Stack on = stack(name);
    Values values;
    for (int s = 0; s < on.slices(); ++s) {
      values.emplace_back();
      for (int r = 0; r < on.rows; ++r) {
        for (int c = 0; c < on.columns; ++c) {
          Vector3d x = on.position(c, r, s) - Vector3d(0, 0, raised_mm);
          if ((x - middle).norm() > 18) {
            values.back().push_back(0);
            continue;
          }
          const double behind = (middle - x).dot(forward);
          if (behind > 0) x += std::min(behind, lengthened_mm) * forward;
          values.back().push_back(static_cast<std::uint8_t>(drawn(anatomy.tissue_at(x))));
        }
      }
    }
    const fs::path file = folder_ / (name + "_by_hand.nii.gz");
    write_label_nifti(file, on, values);
    return file;
  }

  SegmentOptions options(const std::vector<fs::path>& labels) const {
    SegmentOptions options;
    options.study = sample_;
    options.case_folder = folder_ / "case";
    options.labels = labels;
    return options;
  }
  Json fit_of(const std::vector<fs::path>& labels) const {
    EXPECT_EQ(segment(options(labels), common_).status, ExitStatus::done);
    return read_json(folder_ / "case" / "segmentation" / "od" / "fit.json");
  }

  fs::path folder_, sample_;
  CommonOptions common_;
};

double length_sigma_mm(const Json& fit) {
  for (const Json& gate : fit.at("quality"))
    if (gate.at("name") == "axial_length_sigma_mm") return gate.at("value").get<double>();
  return 0;
}

ExitStatus status_of(const std::function<void()>& work, std::string& message) {
  try {
    work();
  } catch (const Error& error) {
    message = error.what();
    return error.status();
  }
  return ExitStatus::done;
}

TEST_F(HandLabelsStage, TrueLabelsGiveTheTrueEyeWithinIntervals) {
  if (!fs::exists(sample_ / "truth.json")) GTEST_SKIP() << "the sample study is not at " << sample_;
  const std::vector<fs::path> files{draw("stack1", 0), draw("stack2", 0)};
  const std::string before = sha256_of_file(files[0]);
  const Json fit = fit_of(files);
  const Json truth = read_json(sample_ / "truth.json").at("eyes").at("od");
  const ParametricEye eye = parametric_eye_from_json(fit.at("eye"));
  const double length = truth.at("axial_length_mm").get<double>(), sigma = length_sigma_mm(fit);
  // A third of a pixel of 0.31 mm; slices are 2 mm apart.
  EXPECT_NEAR(eye.pole_depth_mm(), length, 0.1);
  EXPECT_NEAR(eye.pole_depth_mm(), length, 1.96 * sigma);
  // No better than one pixel's quantisation over the hundred lines or so that cross the pole or the apex.
  EXPECT_GT(sigma, 0.3125 / std::sqrt(12.0) / 10);
  const auto covered = [&](const std::string& name, double value) {
    const auto at =
        std::find(eye.parameter_names.begin(), eye.parameter_names.end(), name) - eye.parameter_names.begin();
    EXPECT_NEAR(eye.get(name), value, 1.96 * std::sqrt(eye.covariance(at, at))) << name;
  };
  covered("anterior_chamber_depth_mm", truth.at("anterior_chamber_depth_mm"));
  covered("lens_thickness_mm", truth.at("lens_thickness_mm"));
  covered("cornea_c_per_mm", truth.at("astigmatism").at("M_D").get<double>() / 337.5);
  EXPECT_EQ(eye.source.at("axial_length_mm"), "labels");
  EXPECT_EQ(fit.at("evidence"), "labels");

  EXPECT_EQ(sha256_of_file(files[0]), before);
  const fs::path stage = folder_ / "case" / "segmentation" / "stage.json";
  EXPECT_EQ(read_json(stage).at("inputs").at("labels/1"), before);
  for (const Json& one : read_json(folder_ / "case" / "case.json").at("stacks"))
    EXPECT_EQ(one.contains("labels"), one.at("name") == "stack1" || one.at("name") == "stack2");
}

TEST_F(HandLabelsStage, AnEyeDrawnLongerIsLonger) {
  if (!fs::exists(sample_ / "truth.json")) GTEST_SKIP() << "the sample study is not at " << sample_;
  const Json fit = fit_of({draw("stack2", 1.0)});
  const double truth =
      read_json(sample_ / "truth.json").at("eyes").at("od").at("axial_length_mm").get<double>();
  EXPECT_NEAR(parametric_eye_from_json(fit.at("eye")).pole_depth_mm(), truth + 1, 0.2);
}

/// They stand, but not without a word.
TEST_F(HandLabelsStage, LabelsThatLieBesideTheImagesEyeAreDoubted) {
  if (!fs::exists(sample_ / "truth.json")) GTEST_SKIP() << "the sample study is not at " << sample_;
  const auto doubted = [&](double raised_mm) {
    const Json fit = fit_of({draw("stack2", 0, raised_mm)});
    for (const Json& gate : fit.at("quality"))
      if (gate.at("name") == "labels_by_edges" || gate.at("name") == "labels_off_mm")
        return !gate.at("passed").get<bool>();
    ADD_FAILURE() << "the labels were not compared";
    return false;
  };
  EXPECT_FALSE(doubted(0));
  for (const double raised_mm : {1.2, 12.0}) EXPECT_TRUE(doubted(raised_mm)) << raised_mm;
}

TEST_F(HandLabelsStage, FilesThatCannotBeUsedAreRefused) {
  Stack grid;
  grid.name = "stack1";
  grid.columns = 6;
  grid.rows = 5;
  grid.along_row = Vector3d::UnitX();
  grid.along_column = Vector3d::UnitY();
  grid.normal = Vector3d::UnitZ();
  grid.column_spacing_mm = grid.row_spacing_mm = 1;
  grid.slice_thickness_mm = 2;
  for (int s = 0; s < 4; ++s) {
    grid.slice_position.push_back({3, 4, 2.0 * s});
    grid.slice_intensity.emplace_back(30, 1.0F);
  }
  Values values(4, std::vector<std::uint8_t>(30, 0));
  const fs::path file = folder_ / "labels.nii.gz";
  std::string message;
  const auto read = [&] { read_hand_labels({file}, {&grid}); };

  write_label_nifti(file, grid, values);
  EXPECT_EQ(status_of(read, message), ExitStatus::input_invalid);
  EXPECT_NE(message.find("every voxel is 0"), std::string::npos) << message;

  values[2][7] = 15;
  write_label_nifti(file, grid, values);
  const std::vector<HandLabels> labels = read_hand_labels({file}, {&grid});
  EXPECT_EQ(labels.front().values, values);
  EXPECT_TRUE(labels.front().shows(Laterality::os));
  EXPECT_FALSE(labels.front().shows(Laterality::od));
  EXPECT_EQ(status_of([&] { read_hand_labels({file, file}, {&grid}); }, message), ExitStatus::usage);

  values[2][7] = 9;
  write_label_nifti(file, grid, values);
  EXPECT_EQ(status_of(read, message), ExitStatus::input_invalid);
  EXPECT_NE(message.find("value 9"), std::string::npos) << message;

  values[2][7] = 5;
  Stack moved = grid;
  for (Vector3d& position : moved.slice_position) position.x() += 0.5;
  write_label_nifti(file, moved, values);
  EXPECT_EQ(status_of(read, message), ExitStatus::input_invalid);
  EXPECT_NE(message.find(file.string()), std::string::npos) << message;
  EXPECT_NE(message.find("6 x 5 x 4"), std::string::npos) << message;

  // Before anything is read or written: no such file, or one that the stage would replace.
  const fs::path own = folder_ / "case" / "segmentation" / "stack1_labels.nii.gz";
  EXPECT_EQ(status_of([&] { segment(options({own}), common_); }, message), ExitStatus::input_invalid);
  fs::create_directories(own.parent_path());
  write_label_nifti(own, grid, values);
  const std::string before = sha256_of_file(own);
  EXPECT_EQ(status_of([&] { segment(options({own}), common_); }, message), ExitStatus::usage);
  EXPECT_NE(message.find("writes anew"), std::string::npos) << message;
  EXPECT_EQ(sha256_of_file(own), before);
}

}  // namespace
}  // namespace emmetrope::segmentation
