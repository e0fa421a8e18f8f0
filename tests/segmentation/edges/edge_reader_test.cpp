#include "segmentation/edges/edge_reader.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>

#include "pipeline/base/frames.hpp"
#include "pipeline/eye/population/population.hpp"
#include "segmentation/edges/edge_biometry.hpp"
#include "segmentation/finding/find_eyes.hpp"
#include "segmentation/intake/study.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;

/// An eye drawn without any of the project's models: an ellipsoid of fluid in a wall, a lens, a lid before it.
struct DrawnEye {
  Vector3d centre{-31, -62, 8};
  Vector3d half_axes{12.4, 11.7, 11.2};
  Vector3d axis = gaze_axis(6, -14);
  double fluid = 200, wall = 900, lens = 950, fat = 1000;  // T1
  Vector3d fat_shift{0, 0, 0};                             ///< in the frame of the axes, mm
  double tip_mm = 0;  ///< by which its upper and lower end stand out of the ellipsoid

  double at(const Vector3d& lps) const {
    Eigen::Matrix3d axes;
    axes.col(2) = axis;
    axes.col(0) = Vector3d::UnitZ().cross(axis).normalized();
    axes.col(1) = axis.cross(axes.col(0));
    const Vector3d p = axes.transpose() * (lps - centre);
    const Vector3d ends = half_axes + Vector3d(0, tip_mm * std::pow(std::abs(p.y()) / p.norm(), 8), 0);
    const Vector3d lens_at(0, 0, 8);
    if ((p - lens_at).cwiseQuotient(Vector3d(4.6, 4.6, 1.9)).norm() < 1) return lens;
    const Vector3d chamber_at(0, 0, 8);  // the cornea bulges
    const bool inside = p.cwiseQuotient(ends).norm() < 1 || (p - chamber_at).norm() < 5.4;
    if (inside) return fluid;
    const auto in_wall = [&](const Vector3d& q) {
      return q.cwiseQuotient(ends + Vector3d::Constant(1.2)).norm() < 1;
    };
    return (in_wall(p) ? wall : 0) + (in_wall(p - fat_shift) ? 0 : fat);
  }
};

/// The eye in voxels, each the mean of 27 points; axes[i] is the LPS direction of column, row and slice.
Stack drawn(const DrawnEye& eye, const Eigen::Matrix3d& axes, double voxel_mm = 0.9, double gain = 1) {
  constexpr int count = 56;
  Stack stack;
  stack.columns = stack.rows = count;
  stack.along_row = axes.col(0);
  stack.along_column = axes.col(1);
  stack.normal = axes.col(2);
  stack.column_spacing_mm = stack.row_spacing_mm = stack.slice_thickness_mm = voxel_mm;
  const Vector3d first =
      eye.centre - voxel_mm * (count - 1) / 2.0 * (axes.col(0) + axes.col(1) + axes.col(2));
  for (int s = 0; s < count; ++s) {
    stack.slice_position.push_back(first + s * voxel_mm * axes.col(2));
    auto& slice = stack.slice_intensity.emplace_back();
    for (int r = 0; r < count; ++r)
      for (int c = 0; c < count; ++c) {
        double sum = 0;
        for (int i = 0; i < 27; ++i)
          sum += eye.at(stack.position(c, r, s) +
                        voxel_mm / 3 * Eigen::Vector3i(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1).cast<double>());
        slice.push_back(static_cast<float>(gain * sum / 27));
      }
  }
  return stack;
}

Eigen::Matrix3d axes_of(const Vector3d& row, const Vector3d& column) {
  Eigen::Matrix3d axes;
  axes << row, column, row.cross(column);
  return axes;
}
const Eigen::Matrix3d axial = axes_of(Vector3d::UnitX(), Vector3d::UnitY());

/// The finder's seed is off by a millimetre and ten degrees.
EdgeSeed rough_seed(const DrawnEye& eye) { return {eye.centre + Vector3d(0.6, -0.6, 0.5), gaze_axis(0, -5)}; }

TEST(EdgeReader, ReadsAnEyeThatNoModelDrew) {
  for (const Weighting weighting : {Weighting::t1, Weighting::t2}) {
    DrawnEye eye;
    if (weighting == Weighting::t2) eye.fluid = 1000, eye.wall = 150, eye.lens = 120, eye.fat = 500;
    const auto reading = read_edges(drawn(eye, axial), rough_seed(eye), weighting);
    ASSERT_TRUE(reading);
    EXPECT_LT((reading->globe.centre - eye.centre).norm(), 0.1);
    EXPECT_NEAR(reading->globe.half_axes.x(), eye.half_axes.x(), 0.1);
    EXPECT_NEAR(reading->globe.half_axes.y(), eye.half_axes.y(), 0.1);
    EXPECT_LT((reading->lens_centre - eye.centre - 8 * eye.axis).norm(), 0.3);
    ASSERT_TRUE(reading->axial);
    // Half levels of blurred hollow surfaces lie inside them.
    EXPECT_NEAR(reading->axial->inner_cornea_mm - reading->axial->inner_wall_mm, 8 + 5.4 + eye.half_axes.z(),
                0.5);
    EXPECT_NEAR(reading->axial->lens_front_mm - reading->axial->lens_back_mm, 3.8, 0.3);
    EXPECT_EQ(doubt_about_globe(*reading), "");
  }
}

/// The same voxels stored along other axes, turned round, or brighter.
TEST(EdgeReader, StorageDoesNotMatter) {
  const DrawnEye eye;
  const auto one = read_edges(drawn(eye, axial), rough_seed(eye), Weighting::t1);
  ASSERT_TRUE(one);
  const Vector3d x = Vector3d::UnitX(), y = Vector3d::UnitY(), z = Vector3d::UnitZ();
  for (const auto& [axes, gain] :
       {std::pair{axes_of(y, -z), 1.0}, {axes_of(-x, y), 1.0}, {axes_of(x, -z), 7.5}}) {
    const auto other = read_edges(drawn(eye, axes, 0.9, gain), rough_seed(eye), Weighting::t1);
    ASSERT_TRUE(other);
    EXPECT_LT((other->globe.centre - one->globe.centre).norm(), 1e-3);
    EXPECT_LT((other->globe.half_axes - one->globe.half_axes).norm(), 1e-3);
    EXPECT_LT((other->lens_centre - one->lens_centre).norm(), 1e-3);
  }
}

TEST(EdgeReader, DoubtsABallWithoutWallOrLens) {
  DrawnEye ball;
  ball.lens = ball.fluid;
  Stack stack = drawn(ball, axial);
  // Half of the ball is open.
  for (auto& slice : stack.slice_intensity)
    for (int i = 0; i < stack.rows * stack.columns; ++i)
      if (i % stack.columns > stack.columns / 2) slice[static_cast<std::size_t>(i)] = 200;
  EXPECT_FALSE(read_eye(stack, rough_seed(ball), Weighting::t1));
}

TEST(EdgeReader, DoubtsAnEyeThatLooksWhereNoFaceIs) {
  const DrawnEye eye;
  auto reading = read_edges(drawn(eye, axial), rough_seed(eye), Weighting::t1);
  ASSERT_TRUE(reading);
  for (const double up_deg : {40.0, 55.0}) {
    reading->globe.axes.col(2) = gaze_axis(0, up_deg);
    EXPECT_EQ(doubt_about_globe(*reading).empty(), up_deg < 50) << doubt_about_globe(*reading);
  }
}

/// An eye 33 mm long and 26 mm across is one, however rare; what is wide, high and deep is none.
TEST(EdgeReader, DoubtsTheEdgeOfDisplacedFat) {
  DrawnEye eye;
  eye.wall = 400;
  const auto still = read_edges(drawn(eye, axial), rough_seed(eye), Weighting::t1);
  ASSERT_TRUE(still);
  EXPECT_LT(still->rays_over_void, 0.05);
  EXPECT_EQ(doubt_about_fat(*still), "");
  eye.fat_shift = {0, 0, -2.5};
  const auto displaced = read_edges(drawn(eye, axial), rough_seed(eye), Weighting::t1);
  ASSERT_TRUE(displaced);
  EXPECT_GT(displaced->rays_over_void, 0.2);
  EXPECT_NE(doubt_about_fat(*displaced).find("no signal"), std::string::npos);
  EXPECT_FALSE(read_eye(drawn(eye, axial), rough_seed(eye), Weighting::t1));
}

TEST(EdgeReader, DoubtsAGlobeAsLargeAsNoEyes) {
  const DrawnEye eye;
  auto reading = read_edges(drawn(eye, axial), rough_seed(eye), Weighting::t1);
  ASSERT_TRUE(reading);
  reading->globe.half_axes = {13, 13, 16.3};
  EXPECT_EQ(doubt_about_globe(*reading), "");
  reading->globe.half_axes = {14.4, 14.1, 17};
  EXPECT_EQ(doubt_about_globe(*reading), "a globe of 30.2 mm on the average is no eye's");
}

/// What somebody else read by hand-seeded half levels: SOURCE.txt of each scan. mm; 0 where not read.
struct HandReading {
  const char* scan;
  Laterality eye;
  Vector3d centre;
  double centre_sigma, width, height, optical_length, sigma, length_sigma;
};

struct ScannedEyes {
  Stack stack;
  FoundEyes found;
};
/// Both eyes of a scan are searched once.
const ScannedEyes& eyes_of(const std::filesystem::path& scan) {
  static std::map<std::filesystem::path, ScannedEyes> searched;
  if (const auto known = searched.find(scan); known != searched.end()) return known->second;
  const StudyInventory inventory = read_inventory(scan, {});
  ScannedEyes eyes{read_series(inventory, inventory.series.front().uid, {}), {}};
  eyes.found = find_eyes({&eyes.stack}, {""});
  return searched[scan] = std::move(eyes);
}

/// The front of a globe that shows neither cornea nor lens is not seen: how deep it is its back and sides tell, to 2 mm.
TEST(EdgeBiometry, DoesNotKnowTheDepthWithoutAFront) {
  Stack stack;
  stack.slice_thickness_mm = 1;
  EdgeReading reading;
  reading.globe.half_axes = {11.5, 11.4, 11};
  reading.globe.rms_mm = 0.3;
  reading.axial = AxialEdges{};
  const EdgeBiometry with = edge_biometry(reading, stack, Weighting::t1);
  reading.axial.reset();
  const EdgeBiometry without = edge_biometry(reading, stack, Weighting::t1);
  EXPECT_LT(with.globe_depth.sigma, 1);
  EXPECT_NEAR(without.globe_depth.sigma, std::hypot(with.globe_depth.sigma, 2), 1e-12);
  EXPECT_EQ(without.globe_width.sigma, with.globe_width.sigma);
  EXPECT_EQ(without.globe_depth.value, with.globe_depth.value);
}

/// No ellipsoid reaches the ends of a globe whose section is a lozenge.
TEST(EdgeBiometry, ReachesToTheEndsOfAGlobeThatIsNoEllipsoid) {
  DrawnEye eye;
  const Stack round = drawn(eye, axial);
  const auto of_round = read_edges(round, rough_seed(eye), Weighting::t1);
  ASSERT_TRUE(of_round);
  EXPECT_LT(of_round->higher_mm, 0.2);
  EXPECT_LT(of_round->wider_mm, 0.2);
  eye.tip_mm = 1.2;
  const Stack pointed = drawn(eye, axial);
  const auto of_pointed = read_edges(pointed, rough_seed(eye), Weighting::t1);
  ASSERT_TRUE(of_pointed);
  EXPECT_LT(of_pointed->wider_mm, 0.2);
  EXPECT_GT(of_pointed->higher_mm, 1);
  const Estimate before = edge_biometry(*of_round, round, Weighting::t1).globe_height;
  const Estimate height = edge_biometry(*of_pointed, pointed, Weighting::t1).globe_height;
  EXPECT_GT(height.sigma, before.sigma + 0.05);
  EXPECT_LT(std::abs(height.value - 2 * (eye.half_axes.y() + eye.tip_mm)), 1.96 * height.sigma);
}

class RealEdges : public testing::TestWithParam<HandReading> {};

TEST_P(RealEdges, AgreeWithAnIndependentReading) {
  const char* scans = std::getenv("EMMETROPE_REAL_SCANS");
  if (scans == nullptr) GTEST_SKIP() << "EMMETROPE_REAL_SCANS names no folder of real scans";
  const HandReading& known = GetParam();
  const auto& [stack, found] = eyes_of(std::filesystem::path(scans) / known.scan);
  const auto eye = std::find_if(found.eyes.begin(), found.eyes.end(),
                                [&](const FoundEye& e) { return e.laterality == known.eye; });
  ASSERT_NE(eye, found.eyes.end());
  const auto read = read_eye(stack, {eye->views.front().globe.centre, eye->axis}, eye->weighting);
  ASSERT_TRUE(read);
  const EdgeBiometry& biometry = read->biometry;
  EXPECT_LT((read->reading.globe.centre - known.centre).norm(), 2 * std::hypot(known.centre_sigma, 0.3));
  const auto expect_alike = [](const Estimate& estimate, double value, double sigma, const char* what) {
    EXPECT_LT(std::abs(estimate.value - value), 2 * std::hypot(estimate.sigma, sigma)) << what;
  };
  if (known.width > 0) expect_alike(biometry.globe_width, known.width, known.sigma, "width");
  if (known.height > 0) expect_alike(biometry.globe_height, known.height, known.sigma, "height");
  ASSERT_TRUE(biometry.axial_length);
  expect_alike(*biometry.axial_length, known.optical_length - usual_retinal_depth_mm, known.length_sigma,
               "length");
}

INSTANTIATE_TEST_SUITE_P(
    HandSeeded, RealEdges,
    testing::Values(
        HandReading{
            "asl_prisma_t1", Laterality::od, {-35.45, -87.09, -4.45}, 0.5, 26.7, 23.6, 25.45, 0.9, 0.7},
        HandReading{
            "asl_prisma_t1", Laterality::os, {28.14, -84.63, -5.58}, 0.5, 26.05, 24.4, 25.8, 0.9, 0.7},
        HandReading{"decub_hfp_t1", Laterality::od, {-39.58, -37.88, -31.45}, 0.5, 0, 27.1, 27.35, 0.5, 0.5},
        HandReading{"decub_hfp_t1", Laterality::os, {24.03, -34.12, -28.86}, 0.5, 0, 27.0, 27.35, 0.5, 0.5},
        HandReading{
            "niivue_chris_t1", Laterality::od, {-30.85, -57.65, -32.2}, 0.25, 26.55, 25.7, 27.4, 0.5, 0.6},
        HandReading{
            "niivue_chris_t1", Laterality::os, {33.35, -56.05, -32.9}, 0.25, 26.0, 26.55, 27.4, 0.5, 0.6},
        HandReading{
            "niivue_t1_head", Laterality::os, {33.96, -95.03, -52.54}, 0.5, 25.5, 24.0, 25.7, 0.5, 0.8},
        HandReading{
            "phil_elition_t1", Laterality::od, {-27.54, -66.05, 9.26}, 0.4, 24.8, 23.5, 24.5, 0.5, 0.4},
        HandReading{
            "phil_elition_t1", Laterality::os, {31.61, -65.29, 11.25}, 0.4, 25.1, 22.7, 24.65, 0.5, 0.4},
        HandReading{"ubermuda_tof3d", Laterality::od, {-43.19, -70.23, -23.01}, 0.5, 25.6, 0, 25.2, 0.6, 0.8},
        HandReading{"ubermuda_tof3d", Laterality::os, {26.58, -72.0, -25.22}, 0.5, 25.2, 0, 25.5, 0.6, 0.8},
        HandReading{"uih_a_t1", Laterality::od, {-38.17, -75.77, -24.22}, 0.4, 26.5, 26.4, 25.85, 0.5, 0.45},
        HandReading{"uih_a_t1", Laterality::os, {27.57, -75.05, -19.1}, 0.4, 26.4, 26.7, 26.05, 0.5, 0.45}),
    [](const auto& info) { return std::string(info.param.scan) + "_" + to_string(info.param.eye); });

}  // namespace
}  // namespace emmetrope::segmentation
