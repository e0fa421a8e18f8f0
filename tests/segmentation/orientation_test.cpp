// One head in the positions of a scanner, as DICOM: sides come from patient coordinates and from nothing
// else.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <random>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "segmentation/finding/find_eyes.hpp"
#include "segmentation/intake/nifti.hpp"
#include "tests/segmentation/intake/intake_test.hpp"
#include "tests/support/stored_otherwise.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;
using test::GeneratedSeries;

/// Two eyes that differ, both looking 20 degrees to the patient's left.
struct Ball {
  Vector3d centre;
  double radius_mm;
};
const Ball right_eye{{-30, -33, 1}, 11.2}, left_eye{{32, -32, 0}, 12.3};
const Vector3d gaze(std::sin(20 * 0.0174533), -std::cos(20 * 0.0174533), 0);
const Vector3d middle_of_images(4, -33, 0.5);

/// T2: bright balls with a wall and a lens, in fat, air in front.
double intensity_at(const Vector3d& lps) {
  double value = lps.y() < -46 ? 0 : 550;
  for (const Ball& ball : {right_eye, left_eye}) {
    const Vector3d d = lps - ball.centre;
    if (d.norm() < ball.radius_mm + 1) value = 200;
    if (d.norm() < ball.radius_mm) value = 1000;
    const Vector3d to_lens = d - 7.3 * gaze;
    const double along = to_lens.dot(gaze);
    if (std::hypot(along / 1.9, (to_lens - along * gaze).norm() / 4.5) < 1) value = 200;
  }
  return value;
}

struct Position {
  const char* name;
  Vector3d along_row, along_column;
  const char* patient_position;  ///< (0018,5100), which must not matter
  enum { truth, mirrored_voxels, mirrored_orientation } kind = truth;
};

/// Axial images of 1.2 mm pixels and 2 mm slices around the middle.
void write_study(const Position& at, const std::filesystem::path& folder) {
  constexpr int size = 96, slices = 20;
  constexpr double pixel_mm = 1.2, slice_mm = 2;
  const auto place = [&](double column, double row, double slice, const Vector3d& along_row) -> Vector3d {
    const Vector3d normal = at.along_row.cross(at.along_column);
    return middle_of_images + pixel_mm * (column - (size - 1) / 2.0) * along_row +
           pixel_mm * (row - (size - 1) / 2.0) * at.along_column +
           slice_mm * (slice - (slices - 1) / 2.0) * normal;
  };
  // What the header says of the direction of rows.
  const Vector3d stated = at.kind == Position::mirrored_orientation ? Vector3d(-at.along_row) : at.along_row;
  GeneratedSeries series;
  while (series.size() < slices) series.duplicate(series.size() - GeneratedSeries::slices);
  series.set_all(DCM_Rows, std::to_string(size));
  series.set_all(DCM_Columns, std::to_string(size));
  series.set_all(DCM_PixelSpacing, "1.2\\1.2");
  series.set_all(DCM_PatientPosition, at.patient_position);
  series.set_all(DCM_ImageOrientationPatient,
                 fmt::format("{}\\{}\\{}\\{}\\{}\\{}", stated.x(), stated.y(), stated.z(),
                             at.along_column.x(), at.along_column.y(), at.along_column.z()));
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0, 40);
  for (int slice = 0; slice < slices; ++slice) {
    series.set_position(slice, place(0, 0, slice, stated));
    std::vector<Uint16> words;
    for (int row = 0; row < size; ++row)
      for (int column = 0; column < size; ++column) {
        const int seen = at.kind == Position::mirrored_voxels ? size - 1 - column : column;
        words.push_back(static_cast<Uint16>(
            std::abs(intensity_at(place(seen, row, slice, at.along_row)) + noise(random))));
      }
    series.set_pixels(slice, words);
  }
  series.write(folder);
}

class Positions : public testing::TestWithParam<Position> {};

/// Turned, the head gives one answer; mirrored, the eyes change sides and look the other way (a meridian at a
/// is then at 180 - a).
TEST_P(Positions, SidesFollowPatientCoordinates) {
  const test::TemporaryFolder folder;
  write_study(GetParam(), folder.path());
  const StudyInventory inventory = read_inventory(folder.path(), test::quiet());
  ASSERT_EQ(inventory.series.size(), 1U);
  ASSERT_TRUE(inventory.series[0].usable) << inventory.series[0].reason;
  const Stack stack = read_series(inventory, inventory.series[0].uid, test::quiet());
  const FoundEyes found = find_eyes({&stack}, {""});
  ASSERT_EQ(found.eyes.size(), 2U);

  const bool mirrored = GetParam().kind != Position::truth;
  const auto in_mirror = [](Vector3d p) { return Vector3d(2 * middle_of_images.x() - p.x(), p.y(), p.z()); };
  for (int i = 0; i < 2; ++i) {
    const FoundEye& eye = found.eyes[i];
    EXPECT_EQ(eye.laterality, i == 0 ? Laterality::od : Laterality::os);
    const Ball& ball = (i == 0) != mirrored ? right_eye : left_eye;
    const Vector3d centre = mirrored ? in_mirror(ball.centre) : ball.centre;
    EXPECT_LT((eye.views[0].globe.centre - centre).norm(), 0.6);
    EXPECT_NEAR(eye.radius_mm, ball.radius_mm, 0.5);
    const Vector3d axis = mirrored ? Vector3d(-gaze.x(), gaze.y(), gaze.z()) : gaze;
    EXPECT_GT(eye.axis.dot(axis), std::cos(8 * 0.0174533)) << eye.axis.transpose();
  }
}

INSTANTIATE_TEST_SUITE_P(
    OneHead, Positions,
    testing::Values(Position{"HeadFirstSupine", {1, 0, 0}, {0, 1, 0}, "HFS"},
                    Position{"HeadFirstProne", {-1, 0, 0}, {0, -1, 0}, "HFP"},
                    Position{"FeetFirstSupine", {-1, 0, 0}, {0, 1, 0}, "FFS"},
                    Position{"DecubitusRight", {0, 1, 0}, {-1, 0, 0}, "HFDR"},
                    Position{"MirroredVoxels", {1, 0, 0}, {0, 1, 0}, "HFS", Position::mirrored_voxels},
                    Position{
                        "MirroredOrientation", {1, 0, 0}, {0, 1, 0}, "HFS", Position::mirrored_orientation}),
    [](const auto& of) { return std::string(of.param.name); });

// Eyes are told from their lenses, so that a header by which they look away from the face is known to be wrong; left and
// right may be, too.
TEST(Orientation, ARealHeadWhoseHeaderIsTurnedIsRefused) {
  const char* scans = std::getenv("EMMETROPE_REAL_SCANS");
  if (scans == nullptr) GTEST_SKIP() << "EMMETROPE_REAL_SCANS names no folder of real scans";
  std::vector<std::string> warnings;
  const Stack stack =
      read_nifti(std::filesystem::path(scans) / "niivue_t1_head" / "T1_head_ext2.nii.gz", warnings);
  EXPECT_EQ(find_eyes({&stack}, {""}).eyes.size(), 2U);
  for (const auto& [by_deg, about] :
       {std::pair(90.0, Vector3d::UnitX()), std::pair(-90.0, Vector3d::UnitX()),
        std::pair(180.0, Vector3d::UnitX()), std::pair(180.0, Vector3d::UnitZ())}) {
    try {
      const Stack turned = turned_header(stack, by_deg * degree, about);
      find_eyes({&turned}, {""});
      ADD_FAILURE() << by_deg << " degrees about " << about.transpose();
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::input_invalid);
      EXPECT_THAT(error.what(), testing::HasSubstr("(0020,0037) ImageOrientationPatient"));
    }
  }
}

}  // namespace
}  // namespace emmetrope::segmentation
