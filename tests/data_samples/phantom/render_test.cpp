// Rendered stacks: coverage of borders, movements, coil, noise, determinism.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <random>

#include "data_samples/phantom/phantom.hpp"
#include "data_samples/phantom/slice_sampler.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"

namespace emmetrope::phantom {
namespace {

using Eigen::Vector3d;

/// One stack of the right eye without noise.
Protocol one_stack(const Anatomy& anatomy, const std::string& words) {
  Protocol protocol;
  protocol.stacks = {make_stack(words, anatomy)};
  protocol.disturbances.snr = 0;
  return protocol;
}

TEST(SliceSampler, CoversBordersToAHundredth) {
  // Mean signal of single voxels against 20 000 random points in each, at all kinds of borders.
  const Anatomy anatomy(random_head(2));
  for (const char* words :
       {"od-coronal:matrix=56x56,pixel_mm=0.5,slice_mm=2,slices=1,coil=uniform",
        "od-axial:matrix=48x48,pixel_mm=0.6,slice_mm=0.6,slices=1,coil=uniform",
        "od-sagittal:matrix=32x32,pixel_mm=1,slice_mm=1,slices=1,coil=uniform,profile=gaussian"}) {
    const StackPlan plan = make_stack(words, anatomy);
    const Sensitivity sensitivity(plan, anatomy);
    const SlicePose pose{plan.slice_position(0), Eigen::Isometry3d::Identity(), 1};
    const FineSlice slice =
        SliceSampler(anatomy, plan, sensitivity, pose, plan.columns, plan.rows, 10, 4).sample();
    std::mt19937_64 random(7);
    std::uniform_real_distribution<double> in_pixel(-0.5, 0.5);
    std::normal_distribution<double> gaussian(0, 1 / 2.354820045);
    double square = 0;
    int voxels = 0;
    for (int row = 0; row < plan.rows; ++row)
      for (int column = (row * 5) % 11; column < plan.columns; column += 11) {
        double sampled = 0;
        for (int j = 0; j < fine; ++j)
          for (int i = 0; i < fine; ++i) {
            const std::size_t at = (static_cast<std::size_t>(row) * fine + j) * fine * plan.columns +
                                   static_cast<std::size_t>(column) * fine + i;
            sampled += (slice.water[at] + slice.fat[at]) / (fine * fine);
          }
        double truth = 0;
        constexpr int points = 20000;
        for (int k = 0; k < points; ++k) {
          double across = plan.profile == SliceProfile::box ? in_pixel(random) : 2;
          while (std::abs(across) > 1.25) across = gaussian(random);
          const Vector3d p = plan.slice_position(0) +
                             plan.pixel_mm * ((column + in_pixel(random)) * plan.along_row +
                                              (row + in_pixel(random)) * plan.along_column) +
                             plan.slice_thickness_mm * across * plan.normal();
          truth += reference_intensity * signal_of(anatomy.tissue_at(p), plan.contrast) / points;
        }
        square += (sampled - truth) * (sampled - truth);
        ++voxels;
      }
    // The random reference itself is good to 0.35 % of the contrast at a border.
    EXPECT_LT(std::sqrt(square / voxels), 0.01 * reference_intensity) << words;
  }
}

TEST(Layers, ProfilesHaveTheirThickness) {
  for (const SliceProfile profile : {SliceProfile::box, SliceProfile::trapezoid, SliceProfile::gaussian}) {
    const Layers layers = layers_of(profile, 2, 50);
    const double peak = *std::max_element(layers.weight.begin(), layers.weight.end());
    double sum = 0;
    double above_half = 0;
    double first_moment = 0;
    for (std::size_t i = 0; i < layers.weight.size(); ++i) {
      sum += layers.weight[i];
      above_half += layers.weight[i] > peak / 2 ? layers.step_mm : 0;
      first_moment += layers.weight[i] * (layers.begin_mm[i] + layers.step_mm / 2);
    }
    EXPECT_NEAR(sum, 1, 1e-12);
    EXPECT_NEAR(above_half, 2, 0.05);
    EXPECT_NEAR(first_moment, 0, 1e-12);
  }
}

/// Centroid (LPS) and area (mm^2) of the vitreous in one slice, up to half way to the wall's signal.
struct Blob {
  Vector3d centroid = Vector3d::Zero();
  double area_mm2 = 0;
};
/// \param about  what is farther from it than the wall's outside is left out
Blob vitreous(const RenderedStack& stack, const Vector3d& about) {
  const double level =
      0.5 * (signal_of(Tissue::vitreous, Contrast::T2) + signal_of(Tissue::wall, Contrast::T2));
  Blob blob;
  double weight = 0;
  for (int row = 0; row < stack.plan.rows; ++row)
    for (int column = 0; column < stack.plan.columns; ++column) {
      const Vector3d p = stack.position(column, row, 0);
      if ((p - about).norm() > 12.1) continue;
      const double value = stack.slices[0][static_cast<std::size_t>(row) * stack.plan.columns + column];
      // A ramp instead of a step, so that the measures move continuously with the object.
      const double w = std::clamp((value / reference_intensity - level) / 0.2 + 0.5, 0.0, 1.0);
      weight += w;
      blob.centroid += w * p;
    }
  blob.centroid /= weight;
  blob.area_mm2 = weight * stack.plan.pixel_mm * stack.plan.pixel_mm;
  return blob;
}

constexpr const char* equator = "od-coronal:matrix=80x80,pixel_mm=0.5,slice_mm=1,slices=1,coil=uniform";

TEST(Render, GlobeLiesWhereTruthSaysAndHasItsArea) {
  HeadGeometry head = sample_head();
  head.od.bulge_height_mm = 0;
  const Anatomy anatomy(head);
  const PlacedEye& eye = anatomy.eye(Laterality::od);
  const Blob blob = vitreous(render(anatomy, one_stack(anatomy, equator), 0), eye.globe_centre_lps());
  EXPECT_LT((blob.centroid - eye.globe_centre_lps()).norm(), 0.02);
  EXPECT_NEAR(blob.area_mm2 / (pi * eye.geometry.globe_semi_x_mm * eye.geometry.globe_semi_y_mm), 1, 0.01);
}

TEST(Render, ScaleErrorScalesAboutTheIsocentre) {
  const Anatomy anatomy(sample_head());
  Protocol protocol = one_stack(anatomy, equator);
  const Vector3d centre = anatomy.eye(Laterality::od).globe_centre_lps();
  const Blob before = vitreous(render(anatomy, protocol, 0), centre);
  protocol.disturbances.scale_error = 0.02;
  protocol.stacks[0].centre *= 1.02;
  const Blob after = vitreous(render(anatomy, protocol, 0), 1.02 * centre);
  EXPECT_NEAR(std::sqrt(after.area_mm2 / before.area_mm2), 1.02, 0.001);
  EXPECT_LT((after.centroid - 1.02 * before.centroid).norm(), 0.02);
}

TEST(Render, StacksMoveAsTheirTransformSays) {
  const Anatomy anatomy(sample_head());
  Protocol protocol = one_stack(anatomy, equator);
  protocol.stacks.push_back(protocol.stacks[0]);
  protocol.disturbances.motion_mm = 0.5;
  protocol.disturbances.motion_deg = 1;
  const RenderedStack first = render(anatomy, protocol, 0);
  const RenderedStack second = render(anatomy, protocol, 1);
  EXPECT_TRUE(first.scanner_from_reference.isApprox(Eigen::Isometry3d::Identity()));
  const Vector3d centre = anatomy.eye(Laterality::od).globe_centre_lps();
  const Vector3d before = vitreous(first, centre).centroid;
  const Vector3d expected = second.scanner_from_reference * before;
  const Vector3d normal = protocol.stacks[0].normal();
  Vector3d miss = vitreous(second, expected).centroid - expected;
  miss -= normal.dot(miss) * normal;  // a slice shows movement in its plane
  EXPECT_GT((expected - before).norm(), 0.1);
  EXPECT_LT(miss.norm(), 0.03);
}

TEST(Render, SurfaceCoilFallsOffFromOneAtTheGlobesCentre) {
  const Anatomy anatomy(sample_head());
  const StackPlan plan = make_stack("od-coronal", anatomy);
  const Sensitivity sensitivity(plan, anatomy);
  const PlacedEye& eye = anatomy.eye(Laterality::od);
  EXPECT_NEAR(sensitivity(eye.globe_centre_lps()), 1, 1e-12);
  const double cornea = sensitivity(eye.lps_from_eye * Vector3d(0, 0, 0));
  const double retina = sensitivity(eye.lps_from_eye * Vector3d(0, 0, -24));
  // (1 + d^2/35^2)^(-3/2) at 12 and 36 mm from the loop, over that at the globe's centre.
  EXPECT_NEAR(cornea / retina, std::pow((1 + 36. * 36 / 1225) / (1 + 12. * 12 / 1225), 1.5), 1e-9);
}

TEST(Render, NoiseHasTheSignalToNoiseRatioAskedFor) {
  const Anatomy anatomy(sample_head());
  Protocol protocol = one_stack(anatomy, equator);
  protocol.disturbances.snr = 20;
  const RenderedStack stack = render(anatomy, protocol, 0);
  EXPECT_DOUBLE_EQ(stack.sigma, 50);
  double sum = 0, square = 0;
  int n = 0;
  for (int row = 28; row < 52; ++row)
    for (int column = 28; column < 52; ++column, ++n) {
      const double value = stack.slices[0][static_cast<std::size_t>(row) * 80 + column];
      sum += value;
      square += value * value;
    }
  const double sd = std::sqrt(square / n - sum * sum / n / n);
  EXPECT_NEAR(sum / n, 1000, 10);  // 50 / sqrt(576) is 2.1
  EXPECT_NEAR(sum / n / sd, 20, 20 * 4 / std::sqrt(2. * n));
}

TEST(Render, ThreadsDoNotChangeABit) {
  const Anatomy anatomy(sample_head());
  Protocol protocol = one_stack(anatomy, "od-sagittal:matrix=64x64,pixel_mm=0.6,slices=3");
  protocol.disturbances.snr = 15;
  protocol.disturbances.slice_motion_mm = 0.1;
  std::atomic<int> slices{0};
  const RenderedStack alone = render(anatomy, protocol, 0, 1, [&] { ++slices; });
  EXPECT_EQ(slices, 3);
  EXPECT_EQ(alone.slices, render(anatomy, protocol, 0, 3).slices);
  protocol.disturbances.seed = 2;
  EXPECT_NE(alone.slices, render(anatomy, protocol, 0, 1).slices);
}

TEST(Render, ContrastsDiffer) {
  const Anatomy anatomy(sample_head());
  // Over 11 x 11 mm, as rings from the wall meet in the very centre.
  const auto centre = [&](const std::string& contrast) {
    const auto stack = render(
        anatomy,
        one_stack(anatomy, "od-coronal:matrix=64x64,pixel_mm=0.5,slices=1,coil=uniform,contrast=" + contrast),
        0);
    double mean = 0;
    for (int row = 21; row < 43; ++row)
      for (int column = 21; column < 43; ++column) mean += stack.slices[0][row * 64 + column] / (22 * 22);
    return mean;
  };
  EXPECT_NEAR(centre("t2"), 1000, 5);
  EXPECT_NEAR(centre("t1"), 1000 * signal_of(Tissue::vitreous, Contrast::T1), 5);
}

TEST(Stack, WordsSetWhatTheySay) {
  const Anatomy anatomy(sample_head());
  const StackPlan plan = make_stack(
      "os-axial:pixel_mm=0.4,slice_mm=3,gap_mm=0.3,matrix=96x80,slices=7,tilt_deg=10/"
      "-5,contrast=t1,acquired=1x0.7",
      anatomy);
  EXPECT_EQ(plan.columns, 96);
  EXPECT_EQ(plan.rows, 80);
  EXPECT_EQ(plan.slices, 7);
  EXPECT_DOUBLE_EQ(plan.slice_spacing_mm, 3.3);
  EXPECT_DOUBLE_EQ(plan.acquired_phase, 0.7);
  EXPECT_EQ(plan.contrast, Contrast::T1);
  EXPECT_EQ(plan.coil_eye, Laterality::os);
  EXPECT_NEAR(plan.along_row.norm(), 1, 1e-12);
  EXPECT_NEAR(plan.along_row.dot(plan.along_column), 0, 1e-12);
  // The middle of the stack is its centre.
  EXPECT_LT((0.5 * (plan.slice_position(0) + plan.slice_position(6)) +
             0.4 * (47.5 * plan.along_row + 39.5 * plan.along_column) - plan.centre)
                .norm(),
            1e-9);
  const Eigen::Matrix3d frame = anatomy.eye(Laterality::os).lps_from_eye.linear();
  EXPECT_NEAR(std::acos(plan.normal().dot(frame.col(1))) * 180 / pi, std::hypot(10, 5), 0.1);
}

TEST(Stack, WrongWordsAreUsageErrors) {
  const Anatomy anatomy(sample_head());
  for (const char* words :
       {"od", "nose-axial", "od-diagonal", "od-axial:pixel=1", "od-axial:matrix=9", "od-axial:pixel_mm=-1",
        "od-axial:contrast=pd", "od-axial:gap_mm=-2", "od-axial:slices=nan"}) {
    try {
      make_stack(words, anatomy);
      ADD_FAILURE() << words;
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::usage) << words;
    }
  }
  EXPECT_THROW(make_protocol("whole-body", anatomy), Error);
}

}  // namespace
}  // namespace emmetrope::phantom
