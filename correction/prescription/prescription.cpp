#include "correction/prescription/prescription.hpp"

#include <fmt/core.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "correction/prescription/withholding.hpp"
#include "correction/sharpness/refraction_chart.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/base/notation.hpp"
#include "raytrace/scene/chart.hpp"
#include "raytrace/scene/scene.hpp"
#include "raytrace/wavefront/retinal_pencil.hpp"

namespace emmetrope::correction {
namespace {

raytrace::WavefrontSettings wavefront_settings(const PrescriptionSettings& settings) {
  raytrace::WavefrontSettings result;
  result.wavelength_nm = settings.wavelength_nm;
  result.fovea_mm = settings.fovea_mm;
  return result;
}

bool lies_at_infinity(const raytrace::Scene& scene) {
  return scene.meshes.empty() && std::all_of(scene.planes.begin(), scene.planes.end(),
                                             [](const auto& plane) { return plane.at_infinity; });
}

/// A chart by its name is drawn at infinity: from 6 m its own vergence, 0.17 D, would be in the lens. It stands where
/// the retina looks: off its middle a dial has strokes along one line only.
std::shared_ptr<const raytrace::Scene> distant(const std::string& chart, const Eigen::Vector3d& towards) {
  const auto near_by = [&] {
    return usage_error("--chart " + chart + " is near by: a prescription is for distance",
                       "leave out distance_mm, or set \"at_infinity\" in a scene.json");
  };
  const std::vector<std::string> names = raytrace::chart_names();
  if (std::find(names.begin(), names.end(), chart.substr(0, chart.find(':'))) == names.end()) {
    auto scene = raytrace::make_scene(chart);
    if (!lies_at_infinity(*scene)) throw near_by();
    return scene;
  }
  raytrace::ChartSpec spec = raytrace::parse_chart(chart);
  if (chart.find("distance_mm") != std::string::npos && std::isfinite(spec.distance_mm)) throw near_by();
  spec.distance_mm = std::numeric_limits<double>::infinity();
  raytrace::Scene scene = raytrace::draw_chart(spec);
  scene.planes.front() = turned_towards(towards, scene.planes.front());
  return std::make_shared<const raytrace::Scene>(std::move(scene));
}

std::shared_ptr<const raytrace::Scene> read_chart(const std::string& chart, const Eigen::Vector3d& towards) {
  try {
    return distant(chart, towards);
  } catch (Error& error) {
    error.add_context("reading the scene of --chart");
    throw;
  }
}

/// Whether a scene at infinity has anything in a direction.
bool shows_something(const raytrace::Scene& scene, const Eigen::Vector3d& direction) {
  return std::any_of(scene.planes.begin(), scene.planes.end(), [&](const raytrace::TexturedPlane& plane) {
    Eigen::Matrix3d edges_and_middle;
    edges_and_middle << plane.right_mm, plane.up_mm, plane.centre_mm;
    const Eigen::Vector3d shares = edges_and_middle.inverse() * direction;
    return shares.z() > 0 && shares.head<2>().cwiseAbs().maxCoeff() <= shares.z();
  });
}

std::vector<ImagingLevel> levels_of(const PrescriptionSettings& settings) {
  return imaging_levels(settings.criterion, settings.pupil_mm, settings.wavelength_nm, settings.fovea_mm,
                        settings.seed);
}

/// Radii on which the paper's curve is drawn: the paper's 20 to 200 mm, on to where a weak lens has its
/// optimum behind it, and closer about the optimum.
std::vector<double> sweep_radii_mm(double best_mm) {
  constexpr int count = 36;
  constexpr double paper_first_mm = 20, paper_last_mm = 200, flattest_mm = 5000;
  const double first_mm = std::min(paper_first_mm, best_mm / 2);
  const double last_mm = std::max(paper_last_mm, std::min(2 * best_mm, flattest_mm));
  std::vector<double> radii;
  for (int i = 0; i < count; ++i)
    radii.push_back(first_mm * std::pow(last_mm / first_mm, double(i) / (count - 1)));
  if (best_mm < flattest_mm)
    for (const double times : {0.9, 0.95, 1.0, 1.05, 1.1}) radii.push_back(times * best_mm);
  std::sort(radii.begin(), radii.end());
  return radii;
}

/// What the full lens (M, J) says of plano-cylinders. One of power (+-r, r u) leaves blur as long as the
/// difference of the two, least at u = J/|J| and r = (+-M + |J|)/2: it corrects one meridian, 2r, and leaves
/// the other, |M -+ |J||.
struct ExpectedCylinder {
  Eigen::Vector2d u;  ///< 180 degrees without astigmatism, when every axis is as good
  double half_power_D;
  AxisFrom axis_from;
};

ExpectedCylinder expected_cylinder(const PowerVector& full, int sign, double depth_of_focus_D) {
  const double J_D = std::hypot(full.J0_D, full.J45_D);
  const double half_power_D = (sign * full.M_D + J_D) / 2, left_D = std::abs(sign * full.M_D - J_D);
  // A plus cylinder at 180 degrees is a minus cylinder at 90.
  if (2 * J_D < least_cylinder_D) return {{-sign, 0}, half_power_D, AxisFrom::convention};
  // Where more is left than half of what is corrected, or much against the depth of focus, blur along one
  // line is all that a turn changes, and what detail the chart happens to have across it would choose the
  // axis (10 degrees off at 4.8 D left).
  constexpr double most_depths_of_focus = 5;
  return {Eigen::Vector2d(full.J0_D, full.J45_D) / J_D, half_power_D,
          left_D <= std::min(half_power_D, most_depths_of_focus * depth_of_focus_D) ? AxisFrom::sharpness
                                                                                    : AxisFrom::refraction};
}

/// From the expected, a weak and a strong lens of the sign that leaves less blur, and from the expected one
/// of the other sign where that is a cylinder at all.
std::vector<Start> plano_cylinder_starts(const PowerVector& full, double distance_mm, double index,
                                         double depth_of_focus_D) {
  constexpr double weakest_D = 0.05, strongest_D = 12;
  std::vector<Start> starts;
  const auto add = [&](int sign, double times) {
    const ExpectedCylinder expected = expected_cylinder(full, sign, depth_of_focus_D);
    const LensFamily any = plano_cylinder(sign, distance_mm, index);
    const double half_D = std::clamp(expected.half_power_D, weakest_D, strongest_D),
                 start_D = std::min(times * half_D, strongest_D);
    if (expected.axis_from == AxisFrom::sharpness)
      starts.push_back({polar(any, half_D * expected.u), Eigen::Vector2d(start_D, 0)});
    else
      starts.push_back({along(any, expected.u), Eigen::VectorXd::Constant(1, start_D)});
  };
  const int better = full.M_D < 0 ? -1 : 1;
  for (const double times : {1.0, 0.3, 2.0}) add(better, times);
  if (expected_cylinder(full, -better, depth_of_focus_D).half_power_D > weakest_D) add(-better, 1);
  return starts;
}

PlanoCylinderResult best_plano_cylinder(const raytrace::Tracer& tracer,
                                        const std::shared_ptr<const raytrace::Scene>& scene,
                                        const EyeModel& eye, const PrescriptionSettings& settings,
                                        const PowerVector& at_lens) {
  const double index = settings.plano_cylinder_index, distance_mm = settings.plano_cylinder_distance_mm;
  const std::vector<ImagingLevel> levels = levels_of(settings);
  const double depth_of_focus_D = levels.back().depth_of_focus_D();
  PlanoCylinderResult best;
  best.search = find_sharpest(tracer, scene, eye, levels,
                              plano_cylinder_starts(at_lens, distance_mm, index, depth_of_focus_D));
  const Eigen::VectorXd& found = best.search.best.lens;
  const PowerVector power = best.search.family.power(found);
  const int sign = power.M_D < 0 ? -1 : 1;
  best.axis_from = expected_cylinder(at_lens, sign, depth_of_focus_D).axis_from;
  best.lens = plano_cylinder_of(sign, Eigen::Vector2d(power.J0_D, power.J45_D), index);
  best.sharpness = best.search.best.sharpness;

  ImagingLevel quick = levels.back();
  quick.pixels /= 2;   // a curve to look at: the same field at half the resolution,
  quick.samples *= 4;  // with as many rays: far from focus their noise must not pass for detail
  const RetinalSharpness sharpness(tracer, scene, eye, plano_cylinder(sign, distance_mm, index), quick);
  for (const double radius_mm : sweep_radii_mm(std::abs(best.lens.radius_mm))) {
    const double signed_mm = -sign * radius_mm;
    best.sweep.push_back(
        {signed_mm, 1e3 * (1 - index) / signed_mm,
         sharpness.by_all_criteria(plano_cylinder_parameters(signed_mm, best.lens.axis_deg, index))});
  }
  // Along the radius only: with power P = 1000 (1 - n) / R the first parameter, half the power, moves by its
  // R-th part a millimetre.
  best.radius_curvature_per_mm2 = best.search.curvature(0, 0) * std::pow(found[0] / best.lens.radius_mm, 2);
  return best;
}

}  // namespace

std::shared_ptr<const raytrace::Scene> judged_scene(const EyeModel& eye,
                                                    const PrescriptionSettings& settings) {
  const Eigen::Vector3d towards =
      raytrace::RetinalPencil(eye, settings.wavelength_nm, settings.fovea_mm).line_of_sight();
  if (settings.chart.empty()) return refraction_chart(towards);
  std::shared_ptr<const raytrace::Scene> given = read_chart(settings.chart, towards);
  if (!shows_something(*given, towards))
    throw usage_error(
        fmt::format(
            "the retina at x = {:g}, y = {:g} mm from its pole looks past --chart {}: {:.1f} degrees off "
            "the eye's axis",
            settings.fovea_mm.x(), settings.fovea_mm.y(), settings.chart,
            std::atan2(towards.head<2>().norm(), towards.z()) / degree),
        "widen its planes, or leave it out: the texture, like a chart by its name, is where the retina looks");
  return given;
}

void PrescriptionSettings::check() const {
  check_vertex_distance("--vertex-distance (vertex_distance_mm)", vertex_distance_mm);
  check_setting("--pupil (pupil_mm)", pupil_mm, iris_aperture_mm, " mm");
  check_setting("--wavelength (wavelength_nm)", wavelength_nm, {380, 780}, " nm");
  check_setting("--plano-cylinder-distance (plano_cylinder_distance_mm)", plano_cylinder_distance_mm, {0, 30},
                " mm");
  check_setting("--plano-cylinder-index (plano_cylinder_index)", plano_cylinder_index, {1.3, 2});
  check_setting("--lens-diameter (twice spectacle.semi_diameter_mm)", 2 * spectacle.semi_diameter_mm,
                {20, 90}, " mm");
  if (spectacle.base_D) check_setting("--base-curve (spectacle.base_D)", *spectacle.base_D, {0, 20}, " D");
  if (spectacle.centre_thickness_mm)
    check_setting("--centre-thickness (spectacle.centre_thickness_mm)", *spectacle.centre_thickness_mm,
                  {0.5, 20}, " mm");
}

int Prescription::images() const {
  int images = plano_cylinder.search.images;
  for (const RealLens& lens : lenses) images += lens.images;
  return images;
}

SearchResult sharpest_lens(const raytrace::Tracer& tracer, const EyeModel& eye,
                           const PrescriptionSettings& settings) {
  const LensFamily family = thin_lens(settings.vertex_distance_mm);
  // The wavefront's answer, whose maximum the others most often find too; no lens at all; and a sphere beyond
  // the answer, from the other side.
  const Eigen::Vector3d from_wavefront =
      as_vector(raytrace::refraction_by_wavefront(with_pupil(eye, settings.pupil_mm),
                                                  wavefront_settings(settings), settings.vertex_distance_mm)
                    .minimum_rms_wavefront);
  if (!family.bounds.contain(from_wavefront))
    throw no_result_error(
        fmt::format(
            "by its wavefront this eye needs a lens of M {:.1f}, J0 {:.1f}, J45 {:.1f} D {:g} mm in front of it; "
            "lenses are sought up to M {:g}, J {:g} D",
            from_wavefront[0], from_wavefront[1], from_wavefront[2], settings.vertex_distance_mm,
            family.bounds.upper[0], family.bounds.upper[1]),
        "check the eye's length and powers; with a smaller --vertex-distance a short-sighted eye needs a weaker lens");
  const Eigen::Vector3d beyond(1.5 * from_wavefront[0] + std::copysign(1, from_wavefront[0]), 0, 0);
  std::vector<Start> starts;
  for (const Eigen::Vector3d& start : {from_wavefront, Eigen::Vector3d(0, 0, 0), beyond})
    if (family.bounds.contain(start)) starts.push_back({family, start});
  SearchResult search = find_sharpest(tracer, judged_scene(eye, settings), eye, levels_of(settings), starts);
  if (!search.accepted) {
    const PowerVector near = family.power(search.best.lens);
    std::string remedy;
    if (!settings.chart.empty())
      remedy = "leave out --chart: where the retina looks it may have too little detail";
    else if (settings.pupil_mm > 3)
      remedy =
          "give a smaller --pupil: through a wide one an aberrated eye's image hardly depends on the lens";
    throw no_result_error(fmt::format("{} (near M {:.2f}, J0 {:.2f}, J45 {:.2f} D)", search.reason, near.M_D,
                                      near.J0_D, near.J45_D),
                          remedy);
  }
  return search;
}

Prescription prescribe(const raytrace::Tracer& tracer, const EyeModel& eye,
                       const PrescriptionSettings& settings) {
  Prescription result;
  result.settings = settings;
  const auto scene = judged_scene(eye, settings);
  Progress progress("looking for the sharpest lens", 3, settings.verbosity);
  const EyeModel seeing = with_pupil(eye, settings.pupil_mm);
  result.wavefront = raytrace::measure_wavefront(seeing, wavefront_settings(settings));
  result.check = raytrace::refraction_by_wavefront(result.wavefront, settings.vertex_distance_mm);
  constexpr double field_reach_deg = 30;
  constexpr int field_points_across = 7;
  result.field = peripheral_refraction(seeing, settings.wavelength_nm, field_reach_deg, field_points_across);
  progress.advance();

  result.search = sharpest_lens(tracer, eye, settings);
  const LensFamily& family = result.search.family;
  result.refraction = family.power(result.search.best.lens);
  result.sharpness_without_lens =
      RetinalSharpness(tracer, scene, eye, family, levels_of(settings).back())(Eigen::Vector3d::Zero()).value;
  result.lenses = sharpest_real_lenses(tracer, scene, eye, levels_of(settings).back(), settings.spectacle,
                                       result.refraction, settings.vertex_distance_mm);
  RealLens thin;
  thin.kind = family.name;
  thin.vertex_distance_mm = settings.vertex_distance_mm;
  thin.power = result.refraction;
  thin.sharpness = result.search.best.sharpness;
  thin.images = result.search.images;
  result.lenses.insert(result.lenses.begin(), thin);
  progress.advance();

  const PowerVector at_cornea = move_towards_eye(result.refraction, settings.vertex_distance_mm);
  result.plano_cylinder = best_plano_cylinder(
      tracer, scene, eye, settings, move_towards_eye(at_cornea, -settings.plano_cylinder_distance_mm));
  progress.advance();
  return result;
}

PowerVector refraction_by_spot(const EyeModel& eye, const PrescriptionSettings& settings) {
  const raytrace::Wavefront wavefront =
      raytrace::measure_wavefront(with_pupil(eye, settings.pupil_mm), wavefront_settings(settings));
  return raytrace::at_vertex(wavefront, wavefront.minimum_rms_spot, settings.vertex_distance_mm);
}

std::string contradiction_in(const PrescriptionUncertainty& uncertainty) {
  return uncertainty.calibration ? reason_of_contradiction(uncertainty.calibration->innovation_sigma) : "";
}

PrescriptionUncertainty uncertainty_of(const Prescription& prescription, const UncertainOptics* optics,
                                       const std::optional<Calibration>& calibration) {
  PrescriptionUncertainty result;
  result.calibration = calibration;
  const Eigen::Vector3d sampling = prescription.search.sampling_sigma_D;
  if (optics) {
    const PrescriptionSettings& settings = prescription.settings;
    // The least-squares fit of ray slopes moves with the eye as the sharpest lens does, at a fraction of the
    // cost.
    const RefractionOf refraction = [&](const EyeModel& changed) {
      return refraction_by_spot(changed, settings);
    };
    const Eigen::MatrixXd sensitivity = refraction_sensitivity(*optics, refraction);
    for (int i = 0; i < 3; ++i) result.origins[i] = optics->known.origin_of(sensitivity.row(i));
    result.data = optics->known.learnt_from();
    result.budget = uncertainty_budget(*optics, sensitivity);
    result.budget.pop_back();  // the total follows with the sampling in it
    result.covariance = sensitivity * optics->known.eye().covariance * sensitivity.transpose();
    if (calibration)
      for (int i = 0; i < 3; ++i)
        result.origins[i] =
            with_refraction(result.origins[i], calibration->covariance_before(i, i), result.covariance(i, i));
    const auto add = [&](const std::string& name, const PlannedObservation& measurement) {
      const Eigen::Vector3d sigma =
          (sensitivity * covariance_after(optics->known.eye().covariance, measurement) *
           sensitivity.transpose())
              .diagonal()
              .cwiseMax(0)
              .cwiseSqrt();
      result.if_measured.push_back({name, {"", sigma[0], sigma[1], sigma[2]}});
    };
    add("keratometry +-0.25 D", keratometry(*optics, 0.25));
    add("optical axial length +-0.05 mm", optical_axial_length(*optics, 0.05));
    add("refraction +-0.25 D", known_refraction(sensitivity, 0.25));
  }
  result.covariance += Eigen::Matrix3d(sampling.cwiseAbs2().asDiagonal());
  result.budget.push_back({"image sampling", sampling[0], sampling[1], sampling[2]});
  const Eigen::Vector3d total = result.covariance.diagonal().cwiseSqrt();
  result.budget.push_back({"total", total[0], total[1], total[2]});
  return result;
}

}  // namespace emmetrope::correction
