// Studies that support no result: one phantom for each reason, through the stage, which must say that reason
// and nothing clinical.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>
#include <tuple>

#include "data_samples/phantom/head_motion.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/measured.hpp"
#include "segmentation/fit/both_eyes.hpp"
#include "segmentation/intake/nifti.hpp"
#include "segmentation/judgement/fellow_eye.hpp"
#include "segmentation/labels/eye_labels.hpp"
#include "segmentation/stage.hpp"
#include "tests/support/phantom_eyes.hpp"
#include "tests/support/pixels.hpp"

namespace emmetrope::segmentation {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;

class QualityGates : public testing::Test {
 protected:
  void SetUp() override {
    const std::string test = testing::UnitTest::GetInstance()->current_test_info()->name();
    folder_ = fs::temp_directory_path() / ("emmetrope_quality_" + test + "_" + std::to_string(::getpid()));
    fs::remove_all(folder_);
    fs::create_directories(folder_ / "study");
    common_.verbosity.quiet = true;
    common_.laterality = LateralityChoice::od;
    head_.od.gaze_vertical_deg = -8;
    anatomy_ = std::make_unique<phantom::Anatomy>(head_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  /// The right eye in an axial T2 stack of 0.8 mm pixels; slices, a little thicker, tell which way they lie.
  Stack image(const phantom::Disturbances& disturbances, double centre_offset_mm = 0) const {
    phantom::Protocol protocol;
    protocol.disturbances = disturbances;
    // Thin slices are encoded; those that move singly are excited singly.
    const char* profile = disturbances.slice_motion_mm > 0 ? "box" : "encoded";
    protocol.stacks.push_back(phantom::make_stack(
        fmt::format("head-axial:pixel_mm=0.8,slice_mm=0.82,matrix=56x56,slices=44,profile={}", profile),
        *anatomy_));
    protocol.stacks[0].centre = right_eye().globe_centre_lps() + Vector3d(0, -3 + centre_offset_mm, 0);
    return to_stack(phantom::render(*anatomy_, protocol, 0, 1), "stack1");
  }
  const phantom::PlacedEye& right_eye() const { return anatomy_->eye(Laterality::od); }
  /// A point of the scanner's LPS in the eye frame.
  Vector3d in_eye(const Vector3d& lps) const { return right_eye().lps_from_eye.inverse() * lps; }

  /// Replaces voxels; the change gets the scanner's noise.
  void replace(Stack& stack, const std::function<std::optional<double>(const Vector3d&)>& by) const {
    std::mt19937 random(5);
    std::normal_distribution<float> noise(0, 50);
    for (int s = 0; s < stack.slices(); ++s)
      for (int r = 0; r < stack.rows; ++r)
        for (int c = 0; c < stack.columns; ++c)
          if (const auto value = by(in_eye(stack.position(c, r, s))))
            stack.slice_intensity[s][static_cast<std::size_t>(r) * stack.columns + c] =
                std::abs(static_cast<float>(*value) + noise(random));
  }

  Answer run(const Stack& stack) {
    write_nifti(folder_ / "study" / "stack1.nii.gz", stack);
    SegmentOptions options;
    options.study = folder_ / "study";
    options.case_folder = folder_ / "case";
    return segment(options, common_);
  }
  /// The reason in the stage's record, a picture, and no fitted cornea for the next stage.
  void expect_withheld(const Answer& answer, const std::string& reason, ExitStatus status) const {
    EXPECT_EQ(answer.status, status);
    const Json stage = read_json(folder_ / "case" / "segmentation" / "stage.json");
    EXPECT_NE(stage.at("verdict").dump().find(reason), std::string::npos) << stage.at("verdict");
    bool picture = false;
    for (const auto& entry : fs::recursive_directory_iterator(folder_ / "case" / "segmentation"))
      picture = picture || entry.path().extension() == ".png";
    EXPECT_TRUE(picture);
    const fs::path fit = folder_ / "case" / "segmentation" / "od" / "fit.json";
    if (fs::exists(fit)) {
      EXPECT_EQ(read_json(fit).at("status"), status == ExitStatus::partial ? "partial" : "refused");
      EXPECT_FALSE(read_json(fit).at("withheld").empty());
    }
  }
  void expect_refused(const Answer& answer, const std::string& reason) const {
    expect_withheld(answer, reason, ExitStatus::no_result);
  }
  const cv::Vec3b by_edges{255, 120, 40}, by_fit{80, 220, 60};
  /// The fit is withheld, or its front, and a ruler on the edges tells the globe's extents all the same.
  /// \param globe  colour of the one that stands, in the overlay
  void expect_read(const Answer& answer, const std::string& reason, const cv::Vec3b& globe) const {
    expect_withheld(answer, reason, ExitStatus::partial);
    const fs::path eye = folder_ / "case" / "segmentation" / "od";
    const Json edges = read_json(eye / "fit.json").at("edges");
    const fs::path picture = eye / "overlay_stack1.png";
    EXPECT_GT(test::pixels_of(picture, globe), 500) << "the globe";
    EXPECT_EQ(test::pixels_of(picture, globe == by_fit ? by_edges : by_fit), 0)
        << "the one that does not stand";
    EXPECT_GT(test::pixels_of(picture, {150, 150, 150}), 100) << "what is withheld";
    EXPECT_EQ(test::pixels_of(picture, {230, 80, 200}), 0) << "an iris as of a fit that stands";
    for (const auto& [name, truth_mm] : {std::pair{"globe_width_mm", 2 * head_.od.globe_semi_x_mm},
                                         {"globe_height_mm", 2 * head_.od.globe_semi_y_mm}}) {
      const auto measured = edges.at(name).get<Measured>();
      EXPECT_LT(measured.ci95[0], truth_mm) << name;
      EXPECT_GT(measured.ci95[1], truth_mm) << name;
      EXPECT_EQ(measured.method, "edges");
    }
  }

  double gate(const std::string& name) const {
    const Json fit = read_json(folder_ / "case" / "segmentation" / "od" / "fit.json");
    for (const Json& one : fit.at("quality"))
      if (one.at("name") == name) return one.at("value");
    ADD_FAILURE() << "no gate " << name;
    return 0;
  }

  static phantom::Disturbances quiet_scan() {
    phantom::Disturbances disturbances;
    disturbances.snr = 20;
    return disturbances;
  }

  phantom::HeadGeometry head_ = phantom::sample_head();
  std::unique_ptr<phantom::Anatomy> anatomy_;
  fs::path folder_;
  CommonOptions common_;
};

/// Without a defect the same phantom is measured: what the others are refused for is their defect.
TEST_F(QualityGates, AGoodScanPasses) {
  EXPECT_EQ(run(image(quiet_scan())).status, ExitStatus::done);
  EXPECT_LT(gate("slice_displacement_mm"), 0.05);
}

TEST_F(QualityGates, ADefacedHeadHasNoCornea) {
  Stack stack = image(quiet_scan());
  // Face removal cuts a plane through the front of the eye and leaves nothing before it.
  replace(stack, [](const Vector3d& p) { return p.z() > -6.5 ? std::optional<double>(0) : std::nullopt; });
  expect_read(run(stack), "cornea", by_edges);
}

/// Where the face is zero, as most programs leave it, what is behind it is fitted as in a whole head.
TEST_F(QualityGates, ABlankedFaceLeavesTheBackOfTheEye) {
  Stack stack = image(quiet_scan());
  for (int s = 0; s < stack.slices(); ++s)
    for (int r = 0; r < stack.rows; ++r)
      for (int c = 0; c < stack.columns; ++c)
        if (in_eye(stack.position(c, r, s)).z() > -8)
          stack.slice_intensity[s][static_cast<std::size_t>(r) * stack.columns + c] = 0;
  EXPECT_EQ(run(stack).status, ExitStatus::partial);
  const fs::path segmentation = folder_ / "case" / "segmentation";
  const Json fit = read_json(segmentation / "od" / "fit.json");
  EXPECT_FALSE(fit.at("withheld").contains("fit")) << fit.at("withheld");
  EXPECT_NE(fit.at("withheld").at("front").get<std::string>().find("blanked"), std::string::npos);
  const Json half_axes = fit.at("eye").at("globe_semi_axes_mm");
  EXPECT_NEAR(half_axes.at(0), head_.od.globe_semi_x_mm, 0.15);
  EXPECT_NEAR(half_axes.at(1), head_.od.globe_semi_y_mm, 0.15);
  // Nothing that was blanked has a label: neither cornea, chamber, iris nor lens, nor a wall before the plane.
  const Stack labels = read_nifti(segmentation / "stack1_labels.nii.gz");
  int vitreous = 0;
  for (int s = 0; s < labels.slices(); ++s)
    for (int r = 0; r < labels.rows; ++r)
      for (int c = 0; c < labels.columns; ++c) {
        const float label = labels.at(c, r, s);
        vitreous += label == static_cast<float>(Label::vitreous) ? 1 : 0;
        if (label == 0) continue;
        EXPECT_GE(label, static_cast<float>(Label::vitreous));
        EXPECT_LT(in_eye(labels.position(c, r, s)).z(), -8);
      }
  EXPECT_GT(vitreous, 5000);
}

/// Of an eye that lost a third of its wall the shape is not told.
TEST_F(QualityGates, AnEyeBlankedNearlyToItsMiddleIsSaidToBe) {
  Stack stack = image(quiet_scan());
  for (int s = 0; s < stack.slices(); ++s)
    for (int r = 0; r < stack.rows; ++r)
      for (int c = 0; c < stack.columns; ++c)
        if (in_eye(stack.position(c, r, s)).z() > -9.5)
          stack.slice_intensity[s][static_cast<std::size_t>(r) * stack.columns + c] = 0;
  expect_refused(run(stack), "% of the eye's wall was blanked in the images");
}

/// The front is missing; width and height are in the images.
TEST_F(QualityGates, AnEyeCutOffIsSaidToBe) {
  expect_read(run(image(quiet_scan(), 16)), "cut off", by_edges);
}

/// One slice of 0.8 mm is missing near the globe's middle: that millimetre is not taken out of the eye. Five
/// are too many.
TEST_F(QualityGates, AMissingSliceDoesNotShrinkTheEyeAndFiveRefuseIt) {
  const auto scan_without = [&](int missing) {
    Stack stack = image(quiet_scan());
    const int middle = stack.slices() / 2 + 3;
    stack.slice_position.erase(stack.slice_position.begin() + middle,
                               stack.slice_position.begin() + middle + missing);
    stack.slice_intensity.erase(stack.slice_intensity.begin() + middle,
                                stack.slice_intensity.begin() + middle + missing);
    return stack;
  };
  const auto height_mm = [&] {
    const Json eye = read_json(folder_ / "case" / "segmentation" / "od" / "fit.json").at("eye");
    return 2 * eye.at("globe_semi_axes_mm").at(1).get<double>();
  };
  EXPECT_EQ(run(scan_without(1)).status, ExitStatus::done);
  EXPECT_NEAR(height_mm(), 2 * head_.od.globe_semi_y_mm, 0.2);
  expect_refused(run(scan_without(5)), "slices through it are missing");
}

/// The second stack is too noisy to say anything beside the first.
TEST_F(QualityGates, TheEyeIsDrawnOnAStackThatWasNotFittedToo) {
  phantom::Disturbances noisy;
  noisy.snr = 3;
  write_nifti(folder_ / "study" / "stack2.nii.gz", image(noisy));
  EXPECT_EQ(run(image(quiet_scan())).status, ExitStatus::done);
  const fs::path eye = folder_ / "case" / "segmentation" / "od";
  const Json described = read_json(folder_ / "case" / "case.json");
  int fitted = 0;
  ASSERT_EQ(described.at("stacks").size(), 2);
  for (const Json& stack : described.at("stacks")) {
    const auto name = stack.at("name").get<std::string>();
    fitted += stack.at("used").get<bool>() ? 1 : 0;
    EXPECT_EQ(fs::exists(eye / ("residual_" + name + ".png")), stack.at("used").get<bool>()) << name;
    EXPECT_TRUE(fs::exists(eye / ("overlay_" + name + ".png"))) << name;
  }
  EXPECT_EQ(fitted, 1);
}

TEST_F(QualityGates, MotionBetweenSlicesIsNoEye) {
  phantom::Disturbances disturbances = quiet_scan();
  disturbances.slice_motion_mm = 1.5;
  expect_refused(run(image(disturbances)), "moved");
}

/// Two axes of the shifts lie in the slices' plane.
TEST_F(QualityGates, MotionBetweenSlicesIsMeasured) {
  phantom::Disturbances disturbances = quiet_scan();
  disturbances.slice_motion_mm = 0.5;
  const Stack stack = image(disturbances);
  expect_read(run(stack), "moved", by_edges);
  // What the slices through the eye were moved by, about their mean, which the eye's place takes up.
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double squares = 0;
  int slices = 0;
  for (int s = 0; s < stack.slices(); ++s) {
    const double from_eye_mm = stack.normal.dot(stack.position(0, 0, s) - right_eye().globe_centre_lps());
    if (std::abs(from_eye_mm) > 11) continue;
    std::mt19937_64 random = phantom::slice_random(disturbances.seed, 0, s);
    const Vector3d moved = phantom::slice_movement(disturbances, random).translation();
    const Eigen::Vector2d in_plane(moved.dot(stack.along_row), moved.dot(stack.along_column));
    sum += in_plane;
    squares += in_plane.squaredNorm();
    ++slices;
  }
  const double rms_mm = std::sqrt(squares / slices - (sum / slices).squaredNorm());
  EXPECT_NEAR(gate("slice_displacement_mm"), rms_mm, 0.15);
}

TEST_F(QualityGates, AnEyeWithoutALensIsNotMeasured) {
  Stack stack = image(quiet_scan());
  // An eye whose lens was replaced by a thin plastic one.
  replace(stack, [](const Vector3d& p) {
    return p.z() < -2.9 && p.z() > -8 && p.head<2>().norm() < 5.5 ? std::optional<double>(1000)
                                                                  : std::nullopt;
  });
  expect_refused(run(stack), "lens is not visible");
}

TEST_F(QualityGates, ACorneaThatLooksLikeItsSurroundingsIsSaidToBeUnseen) {
  Stack stack = image(quiet_scan());
  // Water before the eye (a wet dressing): no edge where the cornea is.
  replace(stack, [](const Vector3d& p) { return p.z() > -2.6 ? std::optional<double>(980) : std::nullopt; });
  expect_read(run(stack), "cornea", by_fit);
}

/// X-ray attenuation in a file that does not say so: soft tissue is all alike.
TEST_F(QualityGates, AComputedTomogramShowsNoEye) {
  Stack stack = image(quiet_scan());
  replace(stack, [](const Vector3d& p) {
    const bool air = p.z() > 2.2;
    const bool bone = p.head<2>().norm() > 17 && p.z() < -10;
    return std::optional<double>(air ? 0 : bone ? 1700 : 1040);
  });
  expect_refused(run(stack), "no such eye was found");
}

/// A fit that ended at these parameters, certain of all of them.
EyeFit fit_at(const ParameterLayout& layout, const Eigen::VectorXd& parameters, Weighting weighting) {
  EyeFit fit{layout,     weighting, {},   ForwardModel(layout, {}, Vector3d::Zero()),
             parameters, {},        {},   population_priors(layout, parameters, weighting),
             {},         {},        0,    {},
             {},         0,         true, {}};
  for (int i = 0; i < layout.size(); ++i) fit.active.push_back(i);
  fit.covariance = 1e-6 * Eigen::MatrixXd::Identity(layout.size(), layout.size());
  fit.regions.resize(part_count);
  fit.misfit = Eigen::VectorXd::Ones(1);
  return fit;
}

/// \param blanked  of the wall, by the finder
std::vector<QualityGate> gates_of(const EyeFit& fit, double blanked = 0) {
  FoundEye found;
  found.views.resize(1);
  found.views[0].globe.blanked = blanked;
  return judge_quality(found, fit, std::nullopt);
}

QualityGate gate_of(const EyeFit& fit, const std::string& name, double blanked = 0) {
  for (const QualityGate& gate : gates_of(fit, blanked))
    if (gate.name == name) return gate;
  ADD_FAILURE() << "no gate " << name;
  return {};
}

/// The length that is judged is the one that is told: to the wall on the axis, displaced there by a bulge.
TEST(QualityOfShapes, ABulgeAtThePoleCounts) {
  ParameterLayout layout;
  const std::vector<Vector3d> bumps = bump_directions();
  layout.bumps = static_cast<int>(bumps.size());
  Eigen::VectorXd parameters = Eigen::VectorXd::Zero(layout.size());
  parameters.head(eye_parameter_count) = population_mean(layout).head(eye_parameter_count);
  const auto pole = std::min_element(bumps.begin(), bumps.end(),
                                     [](const Vector3d& a, const Vector3d& b) { return a.z() < b.z(); });
  parameters[layout.displacement() + static_cast<int>(pole - bumps.begin())] = 12;
  const EyeFit fit = fit_at(layout, parameters, Weighting::t2);
  const QualityGate gate = gate_of(fit, "axial_length_plausible_upper_mm");
  EXPECT_LT(fit.value(axial_length), 25);
  const double angle = std::acos(-pole->z()) / bump_width_rad;
  EXPECT_NEAR(gate.value,
              fit.value(axial_length) + fit.value(globe_z) / 11 * 12 * std::exp(-angle * angle / 2), 1e-6);
  EXPECT_FALSE(gate.passed);
}

/// The mean of two meridians may be an eye's where neither of them is.
TEST(QualityOfShapes, AMeridianThatNoEyeHasWithholdsTheCornea) {
  const ParameterLayout layout;
  Eigen::VectorXd parameters = population_mean(layout);
  for (const auto& [half_cylinder_D, stands] : {std::pair{0.5, true}, {12.0, true}, {18.0, false}}) {
    parameters[cornea_j0] = half_cylinder_D * per_mm_of_keratometric_D;
    const EyeFit fit = fit_at(layout, parameters, Weighting::t2);
    EXPECT_TRUE(gate_of(fit, "keratometry_D_upper").passed) << "the mean";
    for (const char* name : {"keratometry_flat_D", "keratometry_steep_D"}) {
      const QualityGate gate = gate_of(fit, name);
      EXPECT_EQ(gate.passed, stands) << name << " " << gate.value;
      EXPECT_EQ(gate.withholds, Withholds::cornea);
    }
  }
}

/// What is dark behind the globe may have been taken for its wall: said, but the eye is measured.
TEST(QualityOfShapes, AWallTwiceAnEyesIsSaid) {
  const ParameterLayout layout;
  Eigen::VectorXd parameters = population_mean(layout);
  for (int i = vitreous; i <= surround; ++i) parameters[i] = 0.5;
  EXPECT_TRUE(gate_of(fit_at(layout, parameters, Weighting::t1), "thickest_wall_t1_mm").passed);
  parameters[wall_axial] = 3;
  const QualityGate gate = gate_of(fit_at(layout, parameters, Weighting::t1), "thickest_wall_t1_mm");
  EXPECT_FALSE(gate.passed);
  EXPECT_EQ(gate.withholds, Withholds::nothing);
  EXPECT_DOUBLE_EQ(gate.value, 3);
}

/// Where residuals at the wall are larger than noise's, a wall of 0.2 mm may be fat, unless edges of the whole eye confirm
/// its inner side.
TEST(QualityOfShapes, AThinWallIsDoubtedWhereNoEdgesSpeakForIt) {
  const ParameterLayout layout;
  Eigen::VectorXd parameters = population_mean(layout);
  for (int i = vitreous; i <= surround; ++i) parameters[i] = i == vitreous || i == aqueous ? 0.1 : 1;
  parameters[wall_lateral] = 0.2;
  EyeFit fit = fit_at(layout, parameters, Weighting::t1);
  fit.regions[static_cast<std::size_t>(Part::wall)].chi2 = 2;
  EXPECT_EQ(gate_of(fit, "wall_thickness_t1_mm").withholds, Withholds::fit);
  ReadEye edges{};
  edges.reading.globe.centre = fit.globe_centre_lps();
  edges.biometry.centre = edges.biometry.globe_width = edges.biometry.globe_height = {0, 0.7};
  edges.biometry.globe_width.value = 2 * fit.value(globe_x);
  edges.biometry.globe_height.value = 2 * fit.value(globe_y);
  const auto withheld_by = [&] {
    FoundEye found;
    found.views.resize(1);
    for (const QualityGate& gate : judge_quality(found, fit, edges))
      if (gate.name == "wall_thickness_t1_mm") return gate.withholds;
    ADD_FAILURE() << "no such gate";
    return Withholds::nothing;
  };
  EXPECT_EQ(withheld_by(), Withholds::fit) << "edges without a length";
  edges.biometry.axial_length = Estimate{fit.value(axial_length), 0.8};
  EXPECT_EQ(withheld_by(), Withholds::nothing);
  edges.biometry.globe_width.value += 1.6 * 0.7;
  EXPECT_EQ(withheld_by(), Withholds::fit) << "edges that differ by 1.6 standard deviations";
}

/// Where the images say next to nothing of the cornea (its power is known hardly better than before them), the iris may
/// have been taken for it.
TEST(QualityOfShapes, AShallowChamberBehindAnUnseenCorneaIsWithheld) {
  const ParameterLayout layout;
  Eigen::VectorXd parameters = population_mean(layout);
  for (const auto& [chamber_mm, stands] : {std::pair{3.4, true}, {2.5, true}, {2.1, false}}) {
    parameters[anterior_chamber_depth] = chamber_mm;
    EyeFit fit = fit_at(layout, parameters, Weighting::t1);
    EXPECT_FALSE(is_withheld(gates_of(fit), Withholds::front)) << "it is seen";
    const auto cornea_at = std::find(fit.active.begin(), fit.active.end(), cornea_c) - fit.active.begin();
    fit.covariance(cornea_at, cornea_at) = std::pow(0.85 * fit.priors.sigma[cornea_c], 2);
    const QualityGate gate = gate_of(fit, "chamber_of_unseen_cornea_mm");
    EXPECT_EQ(gate.passed, stands) << chamber_mm;
    EXPECT_EQ(gate.withholds, Withholds::front);
    // Edges that tell the same chamber speak for it, but where the cornea's shape is not seen at all.
    ReadEye edges{};
    edges.reading.globe.centre = fit.globe_centre_lps();
    edges.reading.lens_centre.setZero();
    edges.biometry.anterior_chamber_depth = Estimate{chamber_mm + 0.3, 0.4};
    FoundEye found;
    found.views.resize(1);
    EXPECT_FALSE(is_withheld(judge_quality(found, fit, edges), Withholds::front)) << chamber_mm;
    fit.covariance(cornea_at, cornea_at) = std::pow(0.97 * fit.priors.sigma[cornea_c], 2);
    EXPECT_EQ(is_withheld(judge_quality(found, fit, edges), Withholds::front), !stands) << chamber_mm;
  }
}

/// Aqueous and vitreous are both water: a lid that was taken for aqueous is brighter, in T1.
TEST(QualityOfShapes, AnAqueousUnlikeTheVitreousIsNone) {
  const ParameterLayout layout;
  Eigen::VectorXd parameters = population_mean(layout);
  for (int i = vitreous; i <= surround; ++i) parameters[i] = i == vitreous ? 0.25 : 1;
  for (const auto& [brightness, stands] :
       {std::pair{0.27, true}, {0.16, true}, {0.42, false}, {0.05, false}}) {
    parameters[aqueous] = brightness;
    const QualityGate gate = gate_of(fit_at(layout, parameters, Weighting::t1), "fluid_difference_t1");
    EXPECT_EQ(gate.passed, stands) << brightness;
    EXPECT_EQ(gate.withholds, Withholds::front);
  }
  const auto in_t2 = gates_of(fit_at(layout, parameters, Weighting::t2));
  EXPECT_TRUE(std::none_of(in_t2.begin(), in_t2.end(),
                           [](const QualityGate& gate) { return gate.name == "fluid_difference_t1"; }));
}

/// The iris is a tissue with vessels: in T1 it is brighter than water.
TEST(QualityOfShapes, AnIrisDarkerThanWaterIsNone) {
  const ParameterLayout layout;
  Eigen::VectorXd parameters = population_mean(layout);
  for (int i = vitreous; i <= surround; ++i) parameters[i] = i == vitreous || i == aqueous ? 0.25 : 1;
  for (const auto& [brightness, stands] : {std::pair{0.6, true}, {0.3, true}, {0.2, false}, {-0.01, false}}) {
    parameters[iris] = brightness;
    const QualityGate gate = gate_of(fit_at(layout, parameters, Weighting::t1), "iris_over_aqueous_t1");
    EXPECT_EQ(gate.passed, stands) << brightness;
    EXPECT_EQ(gate.withholds, Withholds::front);
  }
  const auto in_t2 = gates_of(fit_at(layout, parameters, Weighting::t2));
  EXPECT_TRUE(std::none_of(in_t2.begin(), in_t2.end(),
                           [](const QualityGate& gate) { return gate.name == "iris_over_aqueous_t1"; }));
}

/// In T2 oil has two fifths of the signal of water, and T1 of an eye full of oil looks like T2 but for the fat.
TEST(QualityOfShapes, AnEyeThatIsNotFilledWithWaterIsTold) {
  const ParameterLayout layout;
  Eigen::VectorXd parameters = population_mean(layout);
  for (int i = vitreous; i <= surround; ++i) parameters[i] = i == vitreous || i == aqueous ? 1 : 0.4;
  const auto gate = [&](const char* name) {
    return gate_of(fit_at(layout, parameters, Weighting::t2), name);
  };
  EXPECT_TRUE(gate("fluid_difference_t2").passed);
  EXPECT_TRUE(gate("surroundings_over_vitreous_t2").passed);
  parameters[aqueous] = 2.4;
  EXPECT_FALSE(gate("fluid_difference_t2").passed);
  EXPECT_EQ(gate("fluid_difference_t2").withholds, Withholds::front);
  parameters[surround] = 1.4;
  EXPECT_FALSE(gate("surroundings_over_vitreous_t2").passed);
  EXPECT_EQ(gate("surroundings_over_vitreous_t2").withholds, Withholds::fit);
}

/// Implants are 0.7 to 1.1 mm thick, and fits in T2 tell 2 to 2.7 mm.
TEST(QualityOfShapes, ALensImplantIsNoNaturalLens) {
  const ParameterLayout layout;
  Eigen::VectorXd parameters = population_mean(layout);
  for (const auto& [thickness_mm, stands] : {std::pair{2.94, true}, {2.63, false}, {0.9, false}}) {
    parameters[lens_thickness] = thickness_mm;
    const QualityGate gate = gate_of(fit_at(layout, parameters, Weighting::t2), "natural_lens_mm");
    EXPECT_EQ(gate.passed, stands) << thickness_mm;
    EXPECT_EQ(gate.withholds, Withholds::front);
  }
}

/// What was left out is said; what no fit explains, or fills the globe, withholds it.
TEST(QualityOfShapes, AMassInTheGlobeIsSaid) {
  const ParameterLayout layout;
  EyeFit fit = fit_at(layout, population_mean(layout), Weighting::t1);
  EXPECT_TRUE(gate_of(fit, "intraocular_mass_seen_mm3").passed);
  EXPECT_TRUE(gate_of(fit, "unexplained_in_vitreous_mm3").passed);
  fit.mass = {109, 0.7};
  const QualityGate seen = gate_of(fit, "intraocular_mass_seen_mm3");
  EXPECT_FALSE(seen.passed);
  EXPECT_EQ(seen.withholds, Withholds::nothing);
  EXPECT_NE(seen.reason.find(
                "109 mm3 of the globe, 2 mm from its wall or more, are brighter than the vitreous (a tumour"),
            std::string::npos)
      << seen.reason;
  EXPECT_TRUE(gate_of(fit, "intraocular_mass_mm3").passed);
  fit.mass = {1200, 0.7};
  EXPECT_FALSE(gate_of(fit, "intraocular_mass_mm3").passed);
  fit.unexplained = {119, 0.5};
  EXPECT_FALSE(gate_of(fit, "unexplained_in_vitreous_mm3").passed);
  EXPECT_EQ(gate_of(fit, "unexplained_in_vitreous_mm3").withholds, Withholds::fit);
  fit.weighting = Weighting::t2;
  EXPECT_NE(gate_of(fit, "unexplained_in_vitreous_mm3").reason.find("darker than the vitreous"),
            std::string::npos);
}

/// A head that was stretched to an atlas has eyes 5 mm wider than deep.
TEST(QualityOfShapes, AFlattenedGlobeIsNoEyes) {
  const ParameterLayout layout;
  Eigen::VectorXd parameters = population_mean(layout);
  for (int i = vitreous; i <= surround; ++i) parameters[i] = 0.5;
  EXPECT_TRUE(gate_of(fit_at(layout, parameters, Weighting::t1), "globe_flattening_mm").passed);
  parameters[globe_x] = parameters[globe_z] + 2.3;
  const QualityGate gate = gate_of(fit_at(layout, parameters, Weighting::t1), "globe_flattening_mm");
  EXPECT_FALSE(gate.passed);
  EXPECT_EQ(gate.withholds, Withholds::fit);
  EXPECT_NEAR(gate.value, 4.6, 1e-9);
}

/// A gap between slices that was left out of their spacing makes a globe of 23 mm 19 mm high.
TEST(QualityOfShapes, AGlobeFarLowerThanWideIsWarnedOf) {
  const ParameterLayout layout;
  Eigen::VectorXd parameters = population_mean(layout);
  for (int i = vitreous; i <= surround; ++i) parameters[i] = 0.5;
  EXPECT_TRUE(gate_of(fit_at(layout, parameters, Weighting::t2), "globe_aspect_mm").passed);
  parameters[globe_y] = parameters[globe_x] / 1.2;
  const QualityGate gate = gate_of(fit_at(layout, parameters, Weighting::t2), "globe_aspect_mm");
  EXPECT_FALSE(gate.passed);
  EXPECT_EQ(gate.withholds, Withholds::nothing);
  EXPECT_NE(gate.reason.find("a gap between slices"), std::string::npos);
}

TEST(QualityOfShapes, WhatTheFinderSawBlankedIsSaid) {
  const ParameterLayout layout;
  Eigen::VectorXd parameters = population_mean(layout);
  for (int i = vitreous; i <= surround; ++i) parameters[i] = 0.5;
  const EyeFit fit = fit_at(layout, parameters, Weighting::t1);
  EXPECT_TRUE(gate_of(fit, "wall_blanked", 0.2).passed);
  EXPECT_FALSE(gate_of(fit, "wall_blanked", 0.4).passed);
}

TEST(QualityOfShapes, AnEyeThatLooksWhereNoFaceIsWasMisread) {
  const ParameterLayout layout;
  Eigen::VectorXd parameters = population_mean(layout);
  for (int i = vitreous; i <= surround; ++i) parameters[i] = 0.5;
  parameters[gaze_horizontal] = 0;
  for (const double up_deg : {-40.0, 40.0, 55.0}) {
    parameters[gaze_vertical] = up_deg;
    const QualityGate gate = gate_of(fit_at(layout, parameters, Weighting::t1), "gaze_from_ahead_deg");
    EXPECT_EQ(gate.passed, up_deg < 50) << up_deg;
    EXPECT_EQ(gate.withholds, Withholds::fit);
    EXPECT_NEAR(gate.value, std::abs(up_deg), 1e-9);
  }
}

/// What noise explains says nothing against a fit, however much it is of the step at the wall.
TEST(QualityOfShapes, NoiseIsNoReasonToDoubtAFit) {
  const ParameterLayout layout;
  Eigen::VectorXd parameters = population_mean(layout);
  for (int i = vitreous; i <= surround; ++i) parameters[i] = 0.5;
  parameters[wall] = 0.7;
  parameters[wall_layering] = 0;
  EyeFit fit = fit_at(layout, parameters, Weighting::t1);
  fit.stacks.resize(1);
  fit.stacks[0].sampling.noise = 0.15;
  const Stack stack = [] {
    Stack one;
    one.column_spacing_mm = one.row_spacing_mm = one.slice_thickness_mm = 1;
    return one;
  }();
  fit.stacks[0].stack = &stack;
  fit.chi2_per_voxel = 1;
  EXPECT_TRUE(gate_of(fit, "residual_over_contrast").passed);
  fit.chi2_per_voxel = 2;
  EXPECT_NEAR(gate_of(fit, "residual_over_contrast").value, 0.15 / 0.2, 1e-9);
  EXPECT_FALSE(gate_of(fit, "residual_over_contrast").passed);
}

/// A voxel's label is of its middle: coarser than a cornea is thick, labels do not tell its curvature.
TEST(QualityOfShapes, CoarseLabelsTellNoCornea) {
  const ParameterLayout layout;
  EyeFit fit = fit_at(layout, population_mean(layout), Weighting::t1);
  fit.evidence = Evidence::labels;
  Stack stack;
  stack.column_spacing_mm = stack.row_spacing_mm = stack.slice_thickness_mm = 0.8;
  fit.stacks.resize(1);
  fit.stacks[0].stack = &stack;
  EXPECT_EQ(gate_of(fit, "label_pixel_mm").withholds, Withholds::cornea);
  EXPECT_FALSE(gate_of(fit, "label_pixel_mm").passed);
  stack.column_spacing_mm = stack.row_spacing_mm = 0.6;
  EXPECT_TRUE(gate_of(fit, "label_pixel_mm").passed);
}

/// A filter of the scanner makes pixels of 0.6 mm as coarse as those of 1.1 mm.
TEST(QualityOfShapes, EdgesThatWereSoftenedTellNoCorneaInT2) {
  ParameterLayout layout;
  layout.stacks = 1;
  EyeFit fit = fit_at(layout, population_mean(layout), Weighting::t2);
  Stack stack;
  stack.column_spacing_mm = stack.row_spacing_mm = stack.slice_thickness_mm = 0.6;
  fit.stacks.resize(1);
  fit.stacks[0].stack = &stack;
  EXPECT_TRUE(gate_of(fit, "resolved_t2_mm").passed);
  fit.parameters[layout.stack(0) + log_sharpness] = std::log(0.55);
  EXPECT_EQ(gate_of(fit, "resolved_t2_mm").withholds, Withholds::cornea);
  EXPECT_NEAR(gate_of(fit, "resolved_t2_mm").value, 0.6 / 0.55, 1e-9);
  EXPECT_FALSE(gate_of(fit, "resolved_t2_mm").passed);
}

/// Fat before the eye was taken for aqueous, a lid for the lens: it is brighter than the vitreous only.
TEST(QualityOfShapes, ALensDiffersFromBothFluids) {
  const ParameterLayout layout;
  for (const auto& [of, contrast, levels, is_lens] :
       {std::tuple{"T1", Weighting::t1, std::array{0.25, 0.22, 0.45}, true},
        {"T1, a lid", Weighting::t1, std::array{0.25, 0.67, 0.38}, false},
        {"T2", Weighting::t2, std::array{1.0, 0.98, 0.16}, true},
        {"T2, dark before and in it", Weighting::t2, std::array{1.0, 0.2, 0.16}, false}}) {
    Eigen::VectorXd parameters = population_mean(layout);
    parameters[vitreous] = levels[0];
    parameters[aqueous] = levels[1];
    parameters[lens] = levels[2];
    const QualityGate gate = gate_of(fit_at(layout, parameters, contrast), "lens_contrast");
    EXPECT_EQ(gate.withholds, Withholds::fit);
    EXPECT_EQ(gate.passed, is_lens) << of;
  }
}

/// Two measured eyes of one stack that shows no eye, so that fitting again helps neither.
class FellowEyes : public testing::Test {
 protected:
  FellowEyes() {
    dark_.columns = dark_.rows = 4;
    dark_.along_row = Vector3d::UnitX();
    dark_.along_column = Vector3d::UnitY();
    dark_.normal = Vector3d::UnitZ();
    dark_.column_spacing_mm = dark_.row_spacing_mm = dark_.slice_thickness_mm = 1;
    dark_.slice_position = {Vector3d::Zero(), Vector3d::UnitZ()};
    dark_.slice_intensity.assign(2, std::vector<float>(16, 0));
  }
  JudgedEye eye(double fat_shift_mm) const {
    const ParameterLayout layout;
    Eigen::VectorXd parameters = population_mean(layout);
    parameters[layout.stack(0) + fat_shift_first + 1] = fat_shift_mm;
    JudgedEye judged{{}, {}, fit_at(layout, parameters, Weighting::t1), {}, {}, {}};
    judged.found.weighting = Weighting::t1;
    judged.found.axis = -Vector3d::UnitY();
    judged.found.radius_mm = 11.5;
    judged.found.views.resize(1);
    judged.found.views[0].globe.centre = Vector3d::Zero();
    judged.found.views[0].globe.inside = 1;
    return judged;
  }
  static ReadEye edges_with_length(double mm) {
    ReadEye read{};
    read.reading.lens_centre.setZero();
    read.biometry.axial_length = Estimate{mm, 1};
    return read;
  }
  void compare(JudgedEye& od, JudgedEye& os) const {
    compare_fellow_eyes(od, os, {&dark_, &dark_}, {}, 2, Verbosity{true});
  }
  Stack dark_;
};

TEST_F(FellowEyes, OneImageHasOneChemicalShift) {
  JudgedEye od = eye(1.1), os = eye(0.9);
  compare(od, os);
  EXPECT_TRUE(od.is_measured() && os.is_measured());
  os = eye(-0.8);
  compare(od, os);
  for (const JudgedEye* eye : {&od, &os}) {
    EXPECT_FALSE(eye->is_fitted());
    EXPECT_NE(eye->reasons().find("displaced by 1.9 mm more"), std::string::npos) << eye->reasons();
  }
}

TEST_F(FellowEyes, EyesLookUpAndDownTogether) {
  JudgedEye od = eye(0), os = eye(0);
  od.fit->parameters[gaze_vertical] = -9;
  os.fit->parameters[gaze_vertical] = -20;
  compare(od, os);
  EXPECT_TRUE(od.is_measured() && os.is_measured());
  os.fit->parameters[gaze_vertical] = -24;
  compare(od, os);
  for (const JudgedEye* eye : {&od, &os}) {
    EXPECT_TRUE(is_withheld(eye->gates, Withholds::front));
    EXPECT_TRUE(eye->is_fitted());
    EXPECT_NE(eye->reasons().find("15 degrees higher"), std::string::npos) << eye->reasons();
  }
}

/// In a real head of 1 mm the iris of one eye was taken for its cornea: a chamber of 2 mm beside one of 4 mm.
TEST_F(FellowEyes, ChambersOfAPersonAreAboutEquallyDeep) {
  JudgedEye od = eye(0), os = eye(0);
  od.fit->parameters[anterior_chamber_depth] = 3.4;
  os.fit->parameters[anterior_chamber_depth] = 3.8;
  compare(od, os);
  EXPECT_TRUE(od.is_measured() && os.is_measured());
  od.fit->parameters[anterior_chamber_depth] = 2.7;
  compare(od, os);
  for (const JudgedEye* eye : {&od, &os}) {
    EXPECT_TRUE(is_withheld(eye->gates, Withholds::front));
    EXPECT_TRUE(eye->is_fitted());
    EXPECT_NE(eye->reasons().find("1.1 mm deeper"), std::string::npos) << eye->reasons();
  }
}

/// What was taken for the cornea may leave less than the cornea does: what eyes are like decides, and intervals reach to
/// the other reading as a mixture's do.
TEST_F(FellowEyes, OfChambersThatContradictTheLikelierIsTakenAndReachesToTheOther) {
  const auto with_chamber = [&](double depth_mm, double chi2) {
    JudgedEye judged = eye(0);
    judged.fit->parameters[anterior_chamber_depth] = depth_mm;
    judged.fit->parameters[axial_length] += depth_mm - 3;  // a cornea farther forward
    judged.fit->chi2_per_voxel = chi2;
    return judged;
  };
  const JudgedEye od = with_chamber(2.5, 2), os = with_chamber(3.8, 2), like_od = with_chamber(2.5, 1.9),
                  like_os = with_chamber(3.8, 2.2), likelier_os = with_chamber(3.7, 2.25);
  const auto taken = likeliest_agreeing(od, os, all_pairs({&od, &likelier_os, &like_os}, {&os, &like_od}));
  ASSERT_TRUE(taken);
  EXPECT_EQ(taken->pair.od, &like_os) << "of about the same chambers that which leaves less";
  EXPECT_EQ(taken->pair.os, &os);
  ASSERT_TRUE(taken->rival);
  EXPECT_EQ(taken->rival->od, &od);
  EXPECT_EQ(taken->rival->os, &like_od);
  const auto likelihood = [&](double depth_mm) {
    const Priors& priors = od.fit->priors;
    return std::exp(
        -std::pow((depth_mm - priors.mean[anterior_chamber_depth]) / priors.sigma[anterior_chamber_depth],
                  2) /
        2);
  };
  EXPECT_NEAR(taken->rivals_probability, likelihood(2.5) / (likelihood(2.5) + likelihood(3.8)), 1e-12);

  const auto without = likeliest_agreeing(od, os, {{&like_os, &os}});
  ASSERT_TRUE(without);
  EXPECT_FALSE(without->rival);
}

/// Fat that is displaced otherwise, too, does not hide that chambers contradict.
TEST_F(FellowEyes, OfChambersThatContradictTheLikelierIsTakenWhereFatContradictsToo) {
  JudgedEye od = eye(1.1), os = eye(-0.8), like_os = eye(-0.8), like_od = eye(1.1);
  for (JudgedEye* deep : {&od, &like_od}) deep->fit->parameters[anterior_chamber_depth] = 5;
  like_os.fit->chi2_per_voxel = 1.1 * like_od.fit->chi2_per_voxel;
  const auto taken = likeliest_agreeing(od, os, {{&od, &like_od}, {&like_os, &os}});
  ASSERT_TRUE(taken);
  EXPECT_EQ(taken->pair.od, &like_os);
  EXPECT_TRUE(taken->rival);
}

TEST_F(FellowEyes, IntervalsReachToARivalAfterTheEyesAreCoupled) {
  JudgedEye od = eye(0), os = eye(0);
  JudgedEye coupled_od = od, coupled_os = os;
  ASSERT_TRUE(couple_fellow_eyes(coupled_od, coupled_os));
  EyeFit rival = *eye(0).fit;
  rival.parameters[anterior_chamber_depth] += 1.3;
  rival.parameters[axial_length] += 1.3;  // a cornea farther forward
  EyeFit rivals_fellow = rival, coupled_rival = rival;
  ASSERT_TRUE(couple_eyes(coupled_rival, rivals_fellow));
  od.rival = os.rival = Rival{rival, 0.3};
  ASSERT_TRUE(couple_fellow_eyes(od, os));
  for (const int parameter : {anterior_chamber_depth, axial_length, globe_x}) {
    const double apart = coupled_rival.value(parameter) - coupled_od.fit->value(parameter);
    EXPECT_NEAR(od.fit->value(parameter), coupled_od.fit->value(parameter), 1e-12);
    EXPECT_NEAR(od.fit->sigma(parameter),
                std::hypot(coupled_od.fit->sigma(parameter), std::sqrt(0.3) * apart), 1e-9);
  }
  EXPECT_GT(od.fit->sigma(anterior_chamber_depth), 0.6);
}

/// Of one person 0.5 mm is nothing; of 2.3 mm one was misread, and each interval reaches to the other's value.
TEST_F(FellowEyes, UnlikeGlobesReachToEachOther) {
  JudgedEye od = eye(0), os = eye(0);
  od.fit->parameters[globe_y] = 11.5;
  os.fit->parameters[globe_y] = 11.75;
  const double before_mm = od.fit->sigma(globe_x);
  couple_fellow_eyes(od, os);
  EXPECT_TRUE(od.gates.empty() && os.gates.empty());
  EXPECT_LE(od.fit->sigma(globe_y), before_mm);
  os.fit->parameters[globe_y] = 12.65;
  couple_fellow_eyes(od, os);
  for (const JudgedEye* eye : {&od, &os}) {
    EXPECT_TRUE(eye->is_measured());
    ASSERT_EQ(eye->gates.size(), 1U);
    EXPECT_NE(eye->gates[0].reason.find("23.0 mm high, the left 25.3 mm"), std::string::npos)
        << eye->gates[0].reason;
    EXPECT_NEAR(2 * eye->fit->sigma(globe_y), 1.15, 0.01);
    EXPECT_LE(eye->fit->sigma(globe_x), before_mm);
  }
}

/// Also where edges stand in for the fit of one eye, or of both: a head with a plane stored four times had 27.9 mm by
/// edges beside 25.1 mm by a fit.
TEST_F(FellowEyes, UnlikeGlobesByEdgesReachToEachOther) {
  const auto by_edges = [&](double width_mm) {
    JudgedEye judged = eye(0);
    ReadEye read = edges_with_length(24);
    read.biometry.globe_width = {width_mm, 0.65};
    read.biometry.globe_height = {2 * judged.fit->value(globe_y), 0.65};
    judged.edges = {read};
    judged.fit.reset();
    return judged;
  };
  const auto compared = [&](double wider_mm, JudgedEye os) {
    JudgedEye od = by_edges(2 * eye(0).fit->value(globe_x) + wider_mm);
    couple_fellow_eyes(od, os);
    EXPECT_EQ(od.gates.size(), os.gates.size());
    if (!os.gates.empty()) {
      EXPECT_NEAR(od.stated_edges().globe_width.sigma, std::hypot(0.65, wider_mm / 2), 0.01);
      EXPECT_NEAR(od.stated_edges().globe_height.sigma, 0.65, 0.01);
    }
    return os;
  };
  EXPECT_TRUE(compared(1.8, eye(0)).gates.empty());
  const JudgedEye fitted = compared(2.7, eye(0));
  ASSERT_EQ(fitted.gates.size(), 1U);
  EXPECT_EQ(fitted.gates[0].name, "globe_difference");
  EXPECT_NEAR(fitted.gates[0].value, 2.7 / std::hypot(0.4, 0.65), 0.01);
  EXPECT_TRUE(fitted.is_measured());
  EXPECT_NEAR(2 * fitted.fit->sigma(globe_x), 1.35, 0.01);
  // Two that are known as little may differ by as much.
  EXPECT_TRUE(compared(2.3, by_edges(2 * eye(0).fit->value(globe_x))).gates.empty());
  EXPECT_EQ(compared(2.7, by_edges(2 * eye(0).fit->value(globe_x))).gates.size(), 1U);
}

/// Old fits with fat displaced by 1.1 and -0.8 mm; of the new ones some agree, some leave less.
TEST_F(FellowEyes, ThePairThatAgreesAndLeavesLeastIsTaken) {
  const auto leaving = [&](double fat_shift_mm, double chi2) {
    JudgedEye judged = eye(fat_shift_mm);
    judged.fit->chi2_per_voxel = chi2;
    return judged;
  };
  const JudgedEye od = leaving(1.1, 2), os = leaving(-0.8, 4), like_os = leaving(-0.7, 2.2),
                  like_od = leaving(1, 4.5), better = leaving(0.9, 3.5), contrary = leaving(-0.9, 1);
  const auto taken = [&](const std::vector<FellowPair>& pairs) { return likeliest_agreeing(od, os, pairs); };
  EXPECT_FALSE(taken({}));
  EXPECT_FALSE(taken({{&contrary, &like_od}})) << "they contradict each other";
  ASSERT_TRUE(taken({{&like_os, &os}}));
  const auto best = taken({{&like_os, &os}, {&od, &better}, {&od, &like_od}});
  ASSERT_TRUE(best);
  EXPECT_EQ(best->pair.od, &od);
  EXPECT_EQ(best->pair.os, &better);
  EXPECT_FALSE(best->rival);
  const JudgedEye poor = leaving(-0.7, 2.4);
  EXPECT_FALSE(taken({{&poor, &os}})) << "1.2 times the residuals";
  JudgedEye unseen = like_os;
  unseen.gates = {{"cornea_sigma_over_prior", 1, 0.95, false, Withholds::cornea, "not seen"}};
  EXPECT_FALSE(taken({{&unseen, &os}})) << "it withholds more";
  const auto swapped = likeliest_agreeing(os, od, {{&os, &like_os}, {&better, &od}, {&like_od, &od}});
  ASSERT_TRUE(swapped);
  EXPECT_EQ(swapped->pair.od, &better);
}

TEST_F(FellowEyes, AFrontThatWasNotFoundTellsNothingOfTheOther) {
  JudgedEye od = eye(0), os = eye(0);
  od.fit->parameters[gaze_vertical] = -9;
  os.fit->parameters[gaze_vertical] = -24;
  os.gates = {{"chamber_of_unseen_cornea_mm", 2, 2.4, false, Withholds::front, "no cornea"}};
  compare(od, os);
  EXPECT_TRUE(od.is_measured());
  EXPECT_EQ(os.reasons(), "no cornea");
}

/// What is asked of a fit's length is more than edges claim of theirs.
TEST_F(FellowEyes, AFitThatKnowsTheLengthBetterDoesNotSpeakAgainstEdges) {
  JudgedEye judged = eye(0);
  const ReadEye read = edges_with_length(27);
  judged.edges = {read};
  const auto gate = [](double sigma_mm) {
    return std::vector<QualityGate>{
        {"axial_length_sigma_mm", sigma_mm, 0.6, false, Withholds::fit, "not determined"}};
  };
  judged.gates = gate(0.67);
  EXPECT_EQ(judged.edges_on_axis_withheld(), "");
  judged.gates = gate(1.2);
  EXPECT_EQ(judged.edges_on_axis_withheld(), "not determined");
}

/// How deep a globe is hangs on its axis and its front.
TEST_F(FellowEyes, ADepthWhoseFrontIsWithheldIsThatOfBackAndSides) {
  JudgedEye judged = eye(0);
  ReadEye read = edges_with_length(27);
  read.reading.axial = AxialEdges{};
  judged.edges = {read};
  const auto depth_sigma_mm = [&](const char* failed) {
    judged.gates = {{failed, 0, 1, false, Withholds::fit, "withheld"}};
    return judged.stated_edges().globe_depth.sigma;
  };
  const double seen = depth_sigma_mm("wall_thickness_t1_mm");
  EXPECT_NEAR(depth_sigma_mm("lens_contrast"), std::hypot(seen, 2), 1e-12);
}

/// In slices of more than 3.5 mm a fit is not believed, and tells nothing against edges either.
TEST_F(FellowEyes, AFitInThickSlicesIsNoWitness) {
  JudgedEye judged = eye(0);
  const ReadEye read = edges_with_length(27);
  judged.edges = {read};
  judged.gates = {{"lens_contrast", -0.1, 0.1, false, Withholds::fit, "no lens"}};
  EXPECT_EQ(judged.edges_on_axis_withheld(), "no lens");
  judged.gates.push_back({"slice_spacing_t1_mm", 4.8, 3.5, false, Withholds::fit, "thick"});
  EXPECT_EQ(judged.edges_on_axis_withheld(), "");
  judged.gates.push_back({"front_is_blanked", 1, 0, false, Withholds::front, "blanked"});
  EXPECT_EQ(judged.edges_on_axis_withheld(), "blanked");
  judged.gates.back() = {"globe_flattening_mm", 9, 4, false, Withholds::fit, "flat"};
  EXPECT_EQ(judged.edges_on_axis_withheld(), "") << "round by its edges";
  judged.edges.front()->biometry.globe_width.value = 30;
  EXPECT_EQ(judged.edges_on_axis_withheld(), "flat");
}

/// No eye has such a chamber: the lid's front was taken for the cornea's.
TEST_F(FellowEyes, AChamberByEdgesThatNoEyeHasIsNotTold) {
  JudgedEye judged = eye(0);
  ReadEye read = edges_with_length(24);
  read.biometry.anterior_chamber_depth = Estimate{4.4, 0.35};
  judged.edges = {read};
  EXPECT_EQ(judged.edges_on_axis_withheld(), "");
  judged.edges.front()->biometry.anterior_chamber_depth->value = 5.1;
  EXPECT_NE(judged.edges_on_axis_withheld().find("5.1 mm deep: what was taken for the cornea may be the lid"),
            std::string::npos);
}

/// Of an eye that is full of oil, or of something else, edges along the axis are not what they are in others.
TEST_F(FellowEyes, WhatFillsTheGlobeSpeaksAgainstEdgesOnTheAxis) {
  JudgedEye judged = eye(0);
  judged.edges = {edges_with_length(24)};
  for (const char* gate :
       {"surroundings_over_vitreous_t2", "unexplained_in_vitreous_mm3", "natural_lens_mm"}) {
    judged.gates = {{gate, 2, 1, false, Withholds::fit, "filled"}};
    EXPECT_EQ(judged.edges_on_axis_withheld(), "filled") << gate;
  }
}

/// A misread fit may be flat where the edges' globe is an eye's: their length stands. Of a stretched head both are flat.
TEST_F(FellowEyes, AFlatFitDoesNotSpeakAgainstARoundGlobesEdges) {
  JudgedEye judged = eye(0);
  ReadEye read = edges_with_length(24);
  read.biometry.globe_width = read.biometry.globe_height = {25, 0.7};
  read.biometry.globe_depth = {21, 0.7};
  judged.edges = {read};
  judged.gates = {{"globe_flattening_mm", 4.5, 4, false, Withholds::fit, "flat"}};
  EXPECT_EQ(judged.edges_on_axis_withheld(), "");
  judged.edges.front()->biometry.globe_width.value = 28;
  EXPECT_EQ(judged.edges_on_axis_withheld(), "flat");
}

TEST_F(FellowEyes, EyesOfTwoStacksMayDiffer) {
  JudgedEye od = eye(1.1), os = eye(-0.8);
  os.found.views[0].stack = 1;
  compare(od, os);
  EXPECT_TRUE(od.is_measured() && os.is_measured());
}

TEST_F(FellowEyes, ARefusedEyeThatCannotBeReadAgainKeepsItsReason) {
  JudgedEye od = eye(1.1), os = eye(1.1);
  os.gates = {{"lens_contrast", 0, 0.1, false, Withholds::fit, "no lens"}};
  compare(od, os);
  EXPECT_TRUE(od.is_measured());
  EXPECT_EQ(os.reasons(), "no lens");
  EXPECT_EQ(os.fitted_again_because, "");
}

}  // namespace
}  // namespace emmetrope::segmentation
