#include <ceres/cost_function.h>
#include <ceres/gradient_checker.h>
#include <gtest/gtest.h>

#include "correction/prescription/prescription.hpp"
#include "correction/sharpness/refraction_chart.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/notation.hpp"
#include "pipeline/eye/optics/exact_trace.hpp"
#include "pipeline/eye/optics/paraxial.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "raytrace/spectacle/spectacle.hpp"
#include "tests/support/closed_loop.hpp"
#include "tests/support/traced_eyes.hpp"

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

void check_gradient(const LensFamily& family, const Eigen::VectorXd& lens, SharpnessCriterion criterion,
                    const EyeModel& eye = make_eye("navarro")) {
  ImagingLevel level;
  level.criterion = criterion;
  level.pixels = 64;
  level.field_mm = 0.6;
  level.samples = 128;
  const RetinalSharpness sharpness(tracer(), refraction_chart(), eye, family, level);
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
      << family.name << ' ' << to_string(criterion) << results.error_log;
}

TEST(Traced, GradientsPassCeresGradientChecker) {
  for (const SharpnessCriterion criterion : all_criteria)
    check_gradient(thin_lens(12), Eigen::Vector3d(-0.7, 0.3, -0.4), criterion);
  check_gradient(plano_cylinder(-1, 10, 1.5), Eigen::Vector2d(0.4, -0.5),
                 SharpnessCriterion::gradient_energy);
  check_gradient(plano_cylinder(1, 10, 1.5), Eigen::Vector2d(-0.4, 0.5), SharpnessCriterion::gradient_energy);
  check_gradient(polar(plano_cylinder(-1, 10, 1.5), {0.4, -0.9}), Eigen::Vector2d(0.7, 0.5),
                 SharpnessCriterion::gradient_energy, random_eye(7));
  check_gradient(thin_lens(0), Eigen::Vector3d(-0.7, 0.3, -0.4), SharpnessCriterion::gradient_energy);
  const PowerVector power{-0.7, 0.3, -0.4};
  check_gradient(toric_meniscus(make_eye("navarro"), {}, 12, power),
                 Eigen::Vector3d(power.M_D, power.J0_D, power.J45_D), SharpnessCriterion::gradient_energy);
}

/// Sharpness on the level that decides.
double sharpness_behind(const EyeModel& eye, const LensFamily& family, const PowerVector& lens) {
  const ImagingLevel level = imaging_levels(SharpnessCriterion::gradient_energy, 3, 589.3, {0, 0}, 1).back();
  const RetinalSharpness sharpness(tracer(), refraction_chart(), eye, family, level);
  return sharpness.by_all_criteria(as_vector(lens))[0];
}

EyeModel with_length_changed(EyeModel eye, double by_mm) {
  eye.surfaces.back().position_mm += by_mm;
  return eye;
}

TEST(Traced, MagnificationDoesNotCount) {
  // Back vertex powers are the same, so that the blur is; front and thickness magnify by 0.5 to 6 %. Where a
  // pixel then covers a simple fraction of the chart's texels nothing may happen (1 % with 3 mm of 6 D).
  const EyeModel navarro = make_eye("navarro");
  const PowerVector power{-0.26, 0, 0};
  const double thin = sharpness_behind(navarro, thin_lens(12), power);
  for (const auto& [base_D, thickness_mm] : {std::pair(2.0, 3.0), {6.0, 3.0}, {10.0, 3.0}, {10.0, 8.0}}) {
    SpectacleSettings spectacle;
    spectacle.base_D = base_D;
    spectacle.centre_thickness_mm = thickness_mm;
    spectacle.semi_diameter_mm = 15;
    const double meniscus = sharpness_behind(navarro, toric_meniscus(navarro, spectacle, 12, power), power);
    EXPECT_NEAR(meniscus / thin, 1, 0.003) << base_D << " D, " << thickness_mm << " mm";
  }
  // Nor does the size of the image, by which a strong thin lens on the cornea differs from one 12 mm before
  // it.
  for (const double longer_mm : {-1.6, 3.0}) {
    const EyeModel eye = with_length_changed(make_eye("gullstrand-emsley"), longer_mm);
    const PowerVector at_cornea = refraction_by_spot(eye, [] {
      PrescriptionSettings settings;
      settings.vertex_distance_mm = 0;
      return settings;
    }());
    const double contact = sharpness_behind(eye, thin_lens(0), at_cornea),
                 spectacle = sharpness_behind(eye, thin_lens(12), move_towards_eye(at_cornea, -12));
    EXPECT_NEAR(spectacle / contact, 1, sharpness_repeatability) << at_cornea.M_D;
  }
}

TEST(Traced, APlusLensCanBeGround) {
  // A step of the search may ask for a lens whose edge the blank does not hold: it is stepped back from.
  const EyeModel eye = with_length_changed(make_eye("gullstrand-emsley"), -1.7);
  PrescriptionSettings settings;
  const PowerVector about = refraction_by_spot(eye, settings);
  ASSERT_NEAR(about.M_D, 4, 0.4);
  const std::vector<RealLens> lenses =
      sharpest_real_lenses(tracer(), refraction_chart(), eye, small_level(), {}, about, 12);
  for (const RealLens& lens : lenses) EXPECT_EQ(lens.reason, "") << lens.kind;
  EXPECT_NEAR(lenses.front().power.M_D, about.M_D, 0.1);
  EXPECT_GT(*lenses.front().centre_thickness_mm, 2);
}

TEST(Traced, TheSharpestLensIsNamedOnlyWhereItIsSharper) {
  const auto lens = [](const char* kind, double sharpness, const char* reason = "") {
    RealLens one;
    one.kind = kind;
    one.sharpness = sharpness;
    one.reason = reason;
    return one;
  };
  EXPECT_EQ(name_sharpest({lens("thin lens", 0.9), lens("contact lens", 0.91)}), "contact lens");
  EXPECT_EQ(name_sharpest({lens("thin lens", 0.9), lens("contact lens", 0.903)}), "equal");
  EXPECT_EQ(name_sharpest({lens("thin lens", 0.9), lens("toric meniscus", 0.95, "did not converge")}),
            "thin lens");
  EXPECT_EQ(name_sharpest({}), "");
}

TEST(Traced, SharpestLensIsThatOfTheExhaustiveSearch) {
  const EyeModel eye = random_eye(5);
  PrescriptionSettings settings;
  settings.verbosity.quiet = true;
  const LensFamily family = thin_lens(12);
  std::vector<ImagingLevel> levels = imaging_levels(SharpnessCriterion::gradient_energy, 3, 589.3, {0, 0}, 1);
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

/// Nothing in the sweep is sharper than the plano-cylinder that was found, but for its coarser picture.
void expect_highest_of_sweep(const PlanoCylinderResult& plano) {
  EXPECT_TRUE(plano.search.accepted) << plano.search.reason;
  const auto best =
      std::max_element(plano.sweep.begin(), plano.sweep.end(),
                       [](const auto& a, const auto& b) { return a.sharpness[0] < b.sharpness[0]; });
  EXPECT_NEAR(best->radius_mm / plano.lens.radius_mm, 1, 0.06);
}

TEST(Traced, NoiseThroughAWidePupilIsNoDetail) {
  // Four times the rays change the slope by less than what counts as flat; else the search climbs noise. Le
  // Grand's spherical surfaces have the most spherical aberration; 32 rays a pixel are 0.1 and 0.14 off.
  for (const double pupil_mm : {6.0, 9.0}) {
    ImagingLevel level =
        imaging_levels(SharpnessCriterion::gradient_energy, pupil_mm, 589.3, {0, 0}, 1).back();
    const auto slope_per_D = [&] {
      const RetinalSharpness sharpness(tracer(), refraction_chart(), make_eye("le-grand"), thin_lens(12),
                                       level);
      const SharpnessValue value = sharpness(Eigen::Vector3d(-1, 0, 0));
      return Eigen::VectorXd(value.gradient / value.value);
    };
    const Eigen::VectorXd slope = slope_per_D();
    level.samples *= 4;
    EXPECT_LT((slope - slope_per_D()).lpNorm<Eigen::Infinity>(), OptimiserSettings{}.accepted_gradient_per_D)
        << pupil_mm << " mm";
  }
}

TEST(Traced, PrescriptionOfAnEyeTakesAtMostSixtyImages) {
  // The hardest known: the strongest astigmatism, the paper's own; and a hyperope of +8.2 / -3.5 x 170, whom
  // any plano-cylinder leaves 5 D in one meridian, too much for sharpness to tell its axis.
  EyeModel hyperope = with_cornea(make_eye("navarro"), 7.72, 4, 170);
  hyperope.surfaces.back().position_mm -= 2.4;
  PrescriptionSettings settings;
  settings.verbosity.quiet = true;
  const Prescription paper = prescribe(tracer(), figure_seven_eye(1.138), settings);
  const Prescription left = prescribe(tracer(), hyperope, settings);
  for (const Prescription* prescription : {&paper, &left}) {
    EXPECT_LE(prescription->images(), 60);
    expect_highest_of_sweep(prescription->plano_cylinder);
  }
  EXPECT_EQ(paper.plano_cylinder.axis_from, AxisFrom::sharpness);
  EXPECT_EQ(left.plano_cylinder.axis_from, AxisFrom::refraction);
  // In plus cylinder the axis is the meridian of the weaker power, here the steep one of the cornea.
  EXPECT_NEAR(left.plano_cylinder.lens.axis_deg, 80, 0.5);
  const SpheroCylinder full = to_sphero_cylinder(left.refraction);
  const double stronger_D = full.sphere_D / (1 - 2e-3 * full.sphere_D);  // from 12 to 10 mm
  EXPECT_NEAR(left.plano_cylinder.lens.power_D, stronger_D, 0.1);
}

TEST(Traced, ACylinderWithoutPowerIsFoundOnlyFromOneSide) {
  // Behind 0 its axis turns: the tangents there must not reach across.
  const EyeModel eye = make_eye("navarro");
  const LensFamily family = along(plano_cylinder(-1, 10, 1.5), Eigen::Vector2d(1, 0));
  for (const double half_D : {0.0, 0.02, 0.2}) {
    const auto tangents = family.tangents(eye, Eigen::VectorXd::Constant(1, half_D));
    ASSERT_EQ(tangents.size(), 1U);
    EXPECT_NEAR(tangents[0].step, half_D < 0.05 ? half_D + 0.05 : 0.1, 1e-12);
  }
}

TEST(Traced, AnEyeWithoutAstigmatismHasNoAxisToLookFor) {
  PrescriptionSettings settings;
  settings.verbosity.quiet = true;
  const Prescription prescription = prescribe(tracer(), make_eye("atchison:-4"), settings);
  const PlanoCylinderResult& plano = prescription.plano_cylinder;
  EXPECT_EQ(plano.axis_from, AxisFrom::convention);
  EXPECT_EQ(plano.lens.axis_deg, 0);
  EXPECT_LE(prescription.images(), 60);
  expect_highest_of_sweep(plano);
  EXPECT_LT(std::abs(plano.sweep.front().radius_mm), std::abs(plano.lens.radius_mm));
  EXPECT_GT(std::abs(plano.sweep.back().radius_mm), std::abs(plano.lens.radius_mm));
  EXPECT_LT(plano.radius_curvature_per_mm2, 0);
}

TEST(Traced, APlusCylinderWithoutAnAxisToLookForIsAt180DegreesToo) {
  PrescriptionSettings settings;
  settings.verbosity.quiet = true;
  EyeModel hyperopic = make_eye("navarro");
  hyperopic.surface("retina").position_mm -= 1;
  const PlanoCylinderResult plano = prescribe(tracer(), hyperopic, settings).plano_cylinder;
  EXPECT_EQ(plano.axis_from, AxisFrom::convention);
  EXPECT_GT(plano.lens.power_D, 1);
  EXPECT_NEAR(std::remainder(plano.lens.axis_deg, 180), 0, 1e-9);
}

TEST(Traced, ClosedLoopsClose) {
  // The first of the 200 eyes of closed-loop-study, and one behind a known lens.
  const ClosedLoop random = closed_loop(tracer(), random_eye(1), 12);
  const PowerVector lens = known_lens(1);
  const ClosedLoop known =
      closed_loop(tracer(), behind_known_lens(make_eye("gullstrand-emsley"), lens), beyond_known_lens_mm);
  EXPECT_LT((known.paraxial - refraction_behind(lens)).norm(), 0.02);
  EXPECT_LT(random.spot_error_D(), 0.03);
  EXPECT_LT(random.axis_error_deg(), 1);
  for (const ClosedLoop& loop : {random, known}) {
    EXPECT_TRUE(loop.converged);
    EXPECT_LT(loop.paraxial_error_D(), 0.02);
    EXPECT_LT(loop.sharpness_error_D(), 0.05);
  }
}

TEST(Traced, SharpnessAgreesWithTheWavefrontWhereThereIsLittleAberration) {
  // Pupil 1.5 mm: spherical aberration hardly counts and all criteria must coincide.
  for (const std::uint64_t seed : {1, 2}) {
    const EyeModel eye = random_eye(seed);
    raytrace::WavefrontSettings wavefront;
    wavefront.wavelength_nm = 589.3;
    const raytrace::RefractionCriteria check =
        raytrace::refraction_by_wavefront(with_pupil(eye, 1.5), wavefront, 12);
    std::vector<ImagingLevel> levels =
        imaging_levels(SharpnessCriterion::gradient_energy, 1.5, 589.3, {0, 0}, 1);
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
  // A flat meridian (1.138) for the 10 D plus lens, which is 11.1 D at the cornea; a steep one (1/1.089) for
  // the minus lens, 9.1 D at the cornea: in both cases the paraxial lens has a radius of 50 mm.
  for (const int sign : {1, -1}) {
    const EyeModel eye = figure_seven_eye(sign > 0 ? 1.138 : 1 / 1.089);
    const PowerVector paraxial =
        move_towards_eye(paraxial_refraction(with_pupil(eye, 3), eye.reference_wavelength_nm), -10);
    EXPECT_NEAR(paraxial.M_D + paraxial.J0_D, sign * 10, 0.05);
    EXPECT_NEAR(paraxial.M_D - paraxial.J0_D, 0, 0.02);

    std::vector<ImagingLevel> levels =
        imaging_levels(SharpnessCriterion::gradient_energy, 3, 589.3, {0, 0}, 1);
    levels.back().pixels = 128;
    const LensFamily family = plano_cylinder(sign, 10, 1.5);
    const RetinalSharpness sharpness(tracer(), refraction_chart(), eye, family, levels.back());
    // Every radius: first by 10 %, then by 0.5 mm about the best, then the vertex of a parabola.
    const auto at = [&](double radius_mm) {
      return sharpness(plano_cylinder_parameters(-sign * radius_mm, 90, 1.5)).value;
    };
    double best_mm = 20, most = 0;
    const auto consider = [&](double radius_mm) {
      const double value = at(radius_mm);
      if (value > most) {
        most = value;
        best_mm = radius_mm;
      }
    };
    for (double radius_mm = 20; radius_mm < 200; radius_mm *= 1.1) consider(radius_mm);
    const double about_mm = best_mm;
    for (double step_mm = -4; step_mm <= 4; step_mm += 0.5) consider(about_mm + step_mm);
    const double below = at(best_mm - 0.5), above = at(best_mm + 0.5);
    const double exhaustive_mm = best_mm + 0.25 * (above - below) / (2 * most - above - below);
    // The paraxial 50 mm would leave Gullstrand's spherical aberration, which the sharpest lens shares out.
    EXPECT_NEAR(exhaustive_mm, 50, 5);
    RecordProperty(sign > 0 ? "plus_mm" : "minus_mm", std::to_string(exhaustive_mm));

    for (const double start_mm : {20.0, 60.0, 200.0}) {
      // In the polar form of prescriptions, but 10 degrees off.
      const LensFamily in_polar_form = polar(family, plano_cylinder_parameters(-sign * 50, 80, 1.5));
      const double start_D = plano_cylinder_parameters(-sign * start_mm, 80, 1.5).norm();
      const SearchResult search = find_sharpest(tracer(), refraction_chart(), eye, levels,
                                                {{in_polar_form, Eigen::Vector2d(start_D, 0)}});
      ASSERT_TRUE(search.accepted) << start_mm << ": " << search.reason;
      const PowerVector power = search.family.power(search.best.lens);
      const PlanoCylinder lens = plano_cylinder_of(sign, Eigen::Vector2d(power.J0_D, power.J45_D), 1.5);
      EXPECT_NEAR(-sign * lens.radius_mm, exhaustive_mm, 0.5) << start_mm;
      EXPECT_NEAR(std::remainder(lens.axis_deg - 90, 180), 0, 1) << start_mm;
    }
  }
}

/// The cornea with the conic constants that bring the whole pupil to the focus of its centre, in both
/// meridians.
EyeModel without_spherical_aberration(EyeModel eye) {
  Surface& front = eye.surface("cornea_anterior");
  const Eigen::Matrix2d curvature = front.shape->vertex_curvature();
  raytrace::WavefrontSettings settings;
  settings.wavelength_nm = 589.3;
  Eigen::Vector2d q(0, 0);
  const auto beyond_centre_D = [&](const Eigen::Vector2d& at) {
    front.shape = make_biconic(1 / curvature(0, 0), 1 / curvature(1, 1), at[0], at[1], 0);
    const raytrace::Wavefront wavefront = raytrace::measure_wavefront(eye, settings);
    const Eigen::Vector3d off = as_vector(wavefront.minimum_rms_spot) - as_vector(wavefront.paraxial);
    return Eigen::Vector2d(off[0] + off[1], off[0] - off[1]);
  };
  for (int i = 0; i < 6; ++i) {
    const Eigen::Vector2d off = beyond_centre_D(q);
    Eigen::Matrix2d slope;
    for (int k = 0; k < 2; ++k)
      slope.col(k) = (beyond_centre_D(q + 0.01 * Eigen::Vector2d::Unit(k)) - off) / 0.01;
    q -= slope.inverse() * off;
  }
  EXPECT_LT(beyond_centre_D(q).norm(), 1e-6);
  return eye;
}

TEST(Traced, FigureSevenWithoutSphericalAberrationIsTheParaxialLens) {
  for (const int sign : {1, -1}) {
    const EyeModel eye =
        without_spherical_aberration(with_pupil(figure_seven_eye(sign > 0 ? 1.138 : 1 / 1.089), 3));
    const double paraxial_D = move_towards_eye(paraxial_refraction(eye, 589.3), -10).M_D * 2;
    std::vector<ImagingLevel> levels =
        imaging_levels(SharpnessCriterion::gradient_energy, 3, 589.3, {0, 0}, 1);
    const SearchResult search =
        find_sharpest(tracer(), refraction_chart(), eye, levels,
                      {{plano_cylinder(sign, 10, 1.5), plano_cylinder_parameters(-sign * 60, 80, 1.5)}});
    ASSERT_TRUE(search.accepted) << search.reason;
    const double radius_mm = plano_cylinder_of(sign, search.best.lens, 1.5).radius_mm;
    RecordProperty(sign > 0 ? "plus_mm" : "minus_mm", std::to_string(radius_mm));
    EXPECT_NEAR(radius_mm, -500 / paraxial_D, 0.5);
    EXPECT_NEAR(radius_mm, -sign * 50, 0.5);
  }
}

TEST(Traced, RealLensesAreThoseOfTheThinOneWhereTheyMustBe) {
  // Little aberration, so that the lenses differ by their place only.
  const EyeModel eye = make_eye("atchison:-6");
  ImagingLevel level = small_level();
  level.pupil_mm = 2;
  const PowerVector thin{-6, 0, 0};
  SpectacleSettings spectacle;
  spectacle.material = lens_material("1.67");
  const std::vector<RealLens> lenses =
      sharpest_real_lenses(tracer(), refraction_chart(), eye, level, spectacle, thin, 12);
  ASSERT_EQ(lenses.size(), 2U);
  for (const RealLens& lens : lenses) EXPECT_TRUE(lens.reason.empty()) << lens.reason;
  // The least-squares fit of ray slopes knows nothing of lenses; the sharpest one lies near it.
  PrescriptionSettings settings;
  settings.pupil_mm = level.pupil_mm;
  EXPECT_NEAR(lenses[0].power.M_D, refraction_by_spot(eye, settings).M_D, 0.06);
  EXPECT_NEAR(lenses[1].power.M_D, move_towards_eye(lenses[0].power, 12).M_D, 0.03);
  EXPECT_NEAR(*lenses[0].base_D, 3, 1e-12);  // Vogel's rule
  spectacle.base_D = 12;
  spectacle.semi_diameter_mm = 45;  // a front of 56 mm radius and a back of 37 mm
  EXPECT_FALSE(
      sharpest_real_lenses(tracer(), refraction_chart(), eye, level, spectacle, thin, 12)[0].reason.empty());
}

TEST(Traced, ALensOnATiltedCorneaIsClearOfIt) {
  // A sphere of radius R that is turned about its vertex by t reaches R (1 / cos t - 1) in front of it, R tan t beside.
  EyeModel eye = make_eye("atchison:-6");
  Surface& cornea = eye.surface("cornea_anterior");
  constexpr double radius_mm = 7.8, tilt_deg = 1.5;
  cornea.shape = make_sphere(radius_mm);
  EXPECT_NEAR(clear_of_cornea_mm(eye), 0.001, 1e-9);
  cornea.tilt_deg = {tilt_deg, 0};
  const double reach_mm = radius_mm * (1 / std::cos(tilt_deg * degree) - 1);
  EXPECT_NEAR(clear_of_cornea_mm(eye), reach_mm + 0.001, 2e-4);
  EXPECT_GT(clear_of_cornea_mm(eye), reach_mm);
  ImagingLevel level = small_level();
  level.pupil_mm = 2;
  const std::vector<RealLens> lenses =
      sharpest_real_lenses(tracer(), refraction_chart(), eye, level, {}, {-6, 0, 0}, 12);
  for (const RealLens& lens : lenses) EXPECT_TRUE(lens.reason.empty()) << lens.reason;
  EXPECT_NEAR(lenses[1].power.M_D, move_towards_eye(lenses[0].power, 12).M_D, 0.05);
}

TEST(Traced, NoMeniscusStandsOnTheCornea) {
  ImagingLevel level = small_level();
  level.pupil_mm = 2;
  const std::vector<RealLens> lenses =
      sharpest_real_lenses(tracer(), refraction_chart(), make_eye("atchison:-6"), level, {}, {-5.6, 0, 0}, 0);
  EXPECT_EQ(lenses[0].kind, "toric meniscus");
  EXPECT_EQ(lenses[0].reason, "a toric meniscus is a spectacle lens, and none stands on the cornea");
  EXPECT_TRUE(lenses[1].reason.empty()) << lenses[1].reason;
}

TEST(Traced, SpectacleMagnificationIsTheClosedForm) {
  // From retinal points 20 um off the pole through the centre of the stop: with a lens in front, the line of
  // sight makes an angle with the axis that is smaller by the spectacle magnification
  // 1 / (1 - d F'v) / (1 - t/n F1), d from the back vertex to the entrance pupil.
  const EyeModel eye = make_eye("navarro");
  const auto& stop = *eye.stop();
  const auto angle = [&](const EyeModel& seeing) {
    const Eigen::Vector3d from(0.02, 0, -eye.axial_length_mm());
    // The ray from the retina whose line passes the stop's centre behind the lens: found by a secant.
    const ExactTracer exact(seeing, 589.3);
    const auto at_stop = [&](double slope) {
      const auto path = exact.trace({from, Eigen::Vector3d(slope, 0, 1).normalized()});
      for (const RayHit& hit : path.hits)
        if (hit.surface == "lens_anterior")
          return hit.position_mm.x() -
                 (hit.position_mm.z() + stop.position_mm) * hit.direction.x() / hit.direction.z();
      return std::nan("");
    };
    double a = -0.02 / 17, b = -0.02 / 20;
    for (int i = 0; i < 20; ++i) {
      const double fa = at_stop(a), fb = at_stop(b);
      if (std::abs(fb - fa) < 1e-15) break;
      const double next = b - fb * (b - a) / (fb - fa);
      a = b;
      b = next;
    }
    const auto out = exact.trace_end({from, Eigen::Vector3d(b, 0, 1).normalized()});
    return out.direction.x() / out.direction.z();
  };
  const double to_pupil_mm = 12 + entrance_pupil(eye, 589.3).position_mm;
  for (const double power_D : {-10.0, -4.0, 4.0, 10.0}) {
    const auto expected = [&](double front_D, double thickness_mm, double index) {
      return 1 / (1 - to_pupil_mm * 1e-3 * power_D) / (1 - thickness_mm * 1e-3 / index * front_D);
    };
    EXPECT_NEAR(angle(eye) / angle(raytrace::with_thin_lens(eye, {power_D, 0, 0}, 12)) / expected(0, 4, 1.5),
                1, 0.005);
    raytrace::Meniscus lens;
    lens.power = {power_D, 0, 0};
    lens.base_D = 8;
    lens.centre_thickness_mm = 6;
    lens.semi_diameter_mm = 15;
    EXPECT_NEAR(angle(eye) / angle(raytrace::with_meniscus(eye, lens)) / expected(8, 6, 1.5), 1, 0.005)
        << power_D;
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
