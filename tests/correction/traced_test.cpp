#include <ceres/cost_function.h>
#include <ceres/gradient_checker.h>
#include <gtest/gtest.h>

#include "correction/notation.hpp"
#include "correction/prescription.hpp"
#include "correction/refraction_chart.hpp"
#include "pipeline/base/error.hpp"
#include "raytrace/eye/paraxial.hpp"
#include "raytrace/spectacle/spectacle.hpp"
#include "tests/correction/traced_eyes.hpp"

/// The whole way: rays, images, sharpness, search.
namespace emmetrope::correction {
namespace {

const raytrace::Tracer& tracer() {
  static const raytrace::Tracer one("", 2);
  return one;
}

ImagingLevel small_level() {
  ImagingLevel level;
  level.pixels = 96;
  level.field_mm = 0.9;
  level.samples = 32;
  return level;
}

Eigen::Vector3d as_vector(const PowerVector& power) { return {power.M_D, power.J0_D, power.J45_D}; }

/// ln(sharpness) for Ceres' checker.
class LogSharpness : public ceres::CostFunction {
 public:
  LogSharpness(SharpnessFunction sharpness, int parameters) : sharpness_(std::move(sharpness)) {
    set_num_residuals(1);
    mutable_parameter_block_sizes()->push_back(parameters);
  }
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const int n = parameter_block_sizes()[0];
    const SharpnessValue value = sharpness_(Eigen::Map<const Eigen::VectorXd>(parameters[0], n));
    residuals[0] = std::log(value.value);
    if (jacobians && jacobians[0]) {
      Eigen::Map<Eigen::VectorXd> jacobian(jacobians[0], n);
      jacobian = value.gradient / value.value;
    }
    return true;
  }

 private:
  SharpnessFunction sharpness_;
};

void check_gradient(const LensFamily& family, const Eigen::VectorXd& lens, Measure measure) {
  ImagingLevel level;
  level.measure = measure;
  level.pixels = 64;
  level.field_mm = 0.6;
  level.samples = 128;
  const RetinalSharpness sharpness(tracer(), refraction_chart(), make_eye("navarro"), family, level);
  const LogSharpness cost(std::cref(sharpness), static_cast<int>(lens.size()));
  // The scene is interpolated linearly between texels, so a difference quotient carries the noise of rays
  // that pass from one texel to the next: one moderate step, and 2 %.
  ceres::NumericDiffOptions steps;
  steps.ridders_relative_initial_step_size = 0.03;
  steps.max_num_ridders_extrapolations = 1;
  const ceres::GradientChecker checker(&cost, static_cast<std::vector<const ceres::Manifold*>*>(nullptr),
                                       steps);
  const double* parameters[] = {lens.data()};
  ceres::GradientChecker::ProbeResults results;
  EXPECT_TRUE(checker.Probe(parameters, 0.02, &results))
      << family.name << ' ' << to_string(measure) << results.error_log;
}

TEST(Traced, GradientsPassCeresGradientChecker) {
  for (const Measure measure : all_measures)
    check_gradient(thin_lens(12), Eigen::Vector3d(-0.7, 0.3, -0.4), measure);
  check_gradient(plano_cylinder(-1, 10, 1.5), Eigen::Vector2d(0.4, -0.5), Measure::gradient_energy);
  check_gradient(plano_cylinder(1, 10, 1.5), Eigen::Vector2d(-0.4, 0.5), Measure::gradient_energy);
}

TEST(Traced, MagnificationAndBrightnessDoNotCount) {
  // The same blur behind an afocal magnifier: a lens at 12 mm and the eye's error that it corrects. Sharpness
  // at focus is the same from -6 to +6 D although the image's size differs by 15 %.
  const auto best = [&](double power_D) {
    EyeModel eye = make_eye("gullstrand-emsley");
    const double at_cornea_D = move_towards_eye({power_D, 0, 0}, 12).M_D;
    for (int i = 0; i < 5; ++i)  // the axial length that this lens corrects
      eye.surfaces.back().position_mm -= (at_cornea_D - paraxial_refraction(eye, 589.3).M_D) / 2.6;
    ImagingLevel level = small_level();
    level.pupil_mm = 1.5;  // hardly any aberration, so that magnification alone is left
    const RetinalSharpness sharpness(tracer(), refraction_chart(), eye, thin_lens(12), level);
    return sharpness(Eigen::Vector3d(power_D, 0, 0)).value;
  };
  const double plano = best(0);
  EXPECT_NEAR(best(-6), plano, 0.04 * plano);
  EXPECT_NEAR(best(6), plano, 0.04 * plano);
}

TEST(Traced, SharpestLensIsThatOfTheExhaustiveSearch) {
  const EyeModel eye = random_eye(5);
  PrescriptionSettings settings;
  settings.verbosity.quiet = true;
  const LensFamily family = thin_lens(12);
  std::vector<ImagingLevel> levels = imaging_levels(Measure::gradient_energy, 3, 589.3, {0, 0}, 1);
  levels.back() = small_level();
  const SearchResult search =
      find_sharpest(tracer(), refraction_chart(), eye, levels, {{family, Eigen::Vector3d::Zero()}});
  ASSERT_TRUE(search.accepted) << search.reason;
  const RetinalSharpness sharpness(tracer(), refraction_chart(), eye, family, levels.back());
  for (int k = 0; k < 3; ++k) {
    // Along each coordinate the best of a scan in steps of 0.05 D is the optimum itself.
    int best = 0;
    double most = 0;
    for (int i = -5; i <= 5; ++i) {
      const double value = sharpness(search.best.lens + 0.05 * i * Eigen::Vector3d::Unit(k)).value;
      if (value > most) {
        most = value;
        best = i;
      }
    }
    EXPECT_EQ(best, 0) << "along " << k;
  }
}

TEST(Traced, SharpnessAgreesWithTheWavefrontWhereThereIsLittleAberration) {
  // Pupil 1.5 mm: spherical aberration hardly counts and all criteria must coincide.
  for (const std::uint64_t seed : {1, 2}) {
    const EyeModel eye = random_eye(seed);
    WavefrontSettings wavefront;
    wavefront.wavelength_nm = 589.3;
    const RefractionCriteria check = refraction_by_wavefront(with_pupil(eye, 1.5), wavefront, 12);
    std::vector<ImagingLevel> levels = imaging_levels(Measure::gradient_energy, 1.5, 589.3, {0, 0}, 1);
    levels.back().pixels = 160;
    levels.back().samples = 32;
    const SearchResult search =
        find_sharpest(tracer(), refraction_chart(), eye, levels, {{thin_lens(12), Eigen::Vector3d::Zero()}});
    ASSERT_TRUE(search.accepted) << search.reason;
    EXPECT_LT((search.best.lens - as_vector(check.paraxial)).norm(), 0.12) << search.best.lens.transpose();
    EXPECT_LT((search.best.lens - as_vector(check.minimum_rms_wavefront)).norm(), 0.06)
        << search.best.lens.transpose();
  }
}

TEST(Traced, FigureSevenPlanoCylinderIsFoundFromAnyStart) {
  // Horizontal astigmatism whose correction is the paper's 50 mm lens: front cornea with alpha = 1.138 for a
  // plus cylinder of 10 D at 10 mm, the other meridian emmetropic.
  EyeModel eye = make_eye("gullstrand-emsley");
  const Surface& cornea = eye.surface("cornea_anterior");
  const double radius_mm = 1 / cornea.shape->vertex_curvature()(0, 0);
  const double step_index = eye.media.at(cornea.medium_after).index - 1;
  const double missing_D = 10.0 / (1 - 0.010 * 10.0);  // +10 D at 10 mm is 11.1 D at the cornea
  const double flat_mm = 1 / (1 / radius_mm - missing_D / (1000 * step_index));
  eye.surface("cornea_anterior").shape = make_biconic(flat_mm, radius_mm, 0, 0, 0);

  std::vector<ImagingLevel> levels = imaging_levels(Measure::gradient_energy, 3, 589.3, {0, 0}, 1);
  levels.back().pixels = 160;
  levels.back().samples = 32;
  const LensFamily family = plano_cylinder(1, 10, 1.5);
  double reference_mm = 0;
  for (const double start_mm : {-20.0, -60.0, -200.0}) {
    const SearchResult search = find_sharpest(tracer(), refraction_chart(), eye, levels,
                                              {{family, plano_cylinder_parameters(start_mm, 80, 1.5)}});
    ASSERT_TRUE(search.accepted) << start_mm << ": " << search.reason;
    const PlanoCylinder lens = plano_cylinder_of(1, search.best.lens, 1.5);
    if (reference_mm == 0) reference_mm = lens.radius_mm;
    EXPECT_NEAR(lens.radius_mm, reference_mm, 0.5) << start_mm;
    EXPECT_NEAR(std::remainder(lens.axis_deg - 90, 180), 0, 1) << start_mm;
    // The paraxial value is -50 mm; spherical aberration of the 3 mm pupil shifts the sharpest lens a little.
    EXPECT_NEAR(lens.radius_mm, -50, 5);
  }
}

TEST(Traced, PlanoCylinderParametersAreTheContractsRadiusAndAxis) {
  for (const double radius_mm : {50.0, -80.0})
    for (const double axis_deg : {0.0, 30.0, 135.0}) {
      const int sign = radius_mm > 0 ? -1 : 1;
      const PlanoCylinder lens =
          plano_cylinder_of(sign, plano_cylinder_parameters(radius_mm, axis_deg, 1.5), 1.5);
      EXPECT_NEAR(lens.radius_mm, radius_mm, 1e-9);
      EXPECT_NEAR(std::remainder(lens.axis_deg - axis_deg, 180), 0, 1e-9);
      EXPECT_NEAR(lens.power_D, -500 / radius_mm, 1e-9);
    }
}

TEST(Traced, NoPrescriptionWithoutASharpestLens) {
  // A scene without detail has no sharpest lens.
  PrescriptionSettings settings;
  settings.verbosity.quiet = true;
  settings.chart = "dial:contrast=0";
  try {
    prescribe(tracer(), make_eye("navarro"), settings);
    ADD_FAILURE() << "a prescription was made of nothing";
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), ExitStatus::no_result) << error.what();
  }
}

}  // namespace
}  // namespace emmetrope::correction
