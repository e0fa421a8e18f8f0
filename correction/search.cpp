#include "correction/search.hpp"

#include <fmt/core.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace emmetrope::correction {
namespace {

/// Optima closer than this are one (half a clinical step).
constexpr double same_optimum_D = 0.12;
/// A coarse optimum is followed to the fine level only where it comes near the sharpest.
constexpr double worth_following = 0.8;

/// Sorts by sharpness and drops what is near a sharper one.
std::vector<Optimum> distinct(std::vector<Optimum> optima, double apart_D) {
  std::stable_sort(optima.begin(), optima.end(),
                   [](const Optimum& a, const Optimum& b) { return a.sharpness > b.sharpness; });
  std::vector<Optimum> kept;
  for (const Optimum& optimum : optima)
    if (std::none_of(kept.begin(), kept.end(),
                     [&](const Optimum& other) { return (other.lens - optimum.lens).norm() < apart_D; }))
      kept.push_back(optimum);
  return kept;
}

}  // namespace

std::vector<ImagingLevel> imaging_levels(Measure measure, double pupil_mm, double wavelength_nm,
                                         const Eigen::Vector2d& centre_mm, std::uint64_t seed) {
  ImagingLevel coarse;
  coarse.measure = Measure::gradient_energy;
  coarse.pixels = 96;
  coarse.field_mm = 4;
  coarse.samples = 32;
  coarse.blur_arcmin = 8;
  coarse.pupil_mm = std::min(pupil_mm, 3.0);
  ImagingLevel fine;
  fine.measure = measure;
  for (ImagingLevel* level : {&coarse, &fine}) {
    level->wavelength_nm = wavelength_nm;
    level->centre_mm = centre_mm;
    level->seed = seed;
  }
  fine.pupil_mm = pupil_mm;
  return {coarse, fine};
}

SearchResult find_sharpest(const raytrace::Tracer& tracer, const std::shared_ptr<const raytrace::Scene>& scene,
                           const EyeModel& eye, const LensFamily& family, const std::vector<ImagingLevel>& levels,
                           const std::vector<Eigen::VectorXd>& starts) {
  SearchResult result;
  std::vector<Optimum> ends;
  for (const Eigen::VectorXd& start : starts) {
    Optimum at_start;
    at_start.lens = start;
    ends.push_back(at_start);
  }
  for (std::size_t k = 0; k < levels.size(); ++k) {
    const bool last = k + 1 == levels.size();
    const RetinalSharpness sharpness(tracer, scene, eye, family, levels[k]);
    OptimiserSettings settings;
    if (!last) {  // near enough for the next level to take over
      settings.gradient_tolerance_per_D = 0.02;
      settings.function_tolerance = 1e-3;
      settings.max_iterations = 12;
    }
    std::vector<Optimum> climbed;
    for (const Optimum& end : ends) climbed.push_back(climb(std::cref(sharpness), end.lens, family.bounds, settings));
    ends = distinct(std::move(climbed), last ? same_optimum_D : 2 * same_optimum_D);
    if (!last)
      ends.erase(std::remove_if(ends.begin(), ends.end(),
                                [&](const Optimum& end) {
                                  return end.sharpness < worth_following * ends.front().sharpness;
                                }),
                 ends.end());
    if (last) {
      result.best = ends.front();
      result.curvature = curvature_of_log(std::cref(sharpness), result.best.lens, 0.1);
      ImagingLevel other_rays = levels[k];
      other_rays.seed += 1;
      const RetinalSharpness again(tracer, scene, eye, family, other_rays);
      const SharpnessValue value = again(result.best.lens);
      // The optimum moves by H^-1 times the change of slope; two sets of rays differ by sqrt(2) times one set's error.
      result.sampling_sigma_D = (result.curvature.ldlt().solve(value.gradient / value.value - result.best.gradient))
                                    .cwiseAbs() /
                                std::sqrt(2.0);
      result.images += again.images();
    }
    result.images += sharpness.images();
  }
  for (const Optimum& end : ends) result.optima.push_back(end.lens);

  const double flattest =
      Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(result.curvature).eigenvalues().maxCoeff();
  const double next_step_D = result.curvature.ldlt().solve(result.best.gradient).norm();
  if (!result.best.converged)
    result.reason = "the search for the sharpest image did not converge: " + result.best.reason;
  else if (!(flattest < 0))
    result.reason = "the image has no sharpest lens: sharpness does not fall in every direction from where the search ended";
  else if (!(next_step_D < 0.02))
    result.reason = fmt::format("the search ended {:.2f} D before the sharpest lens", next_step_D);
  result.accepted = result.reason.empty();
  return result;
}

}  // namespace emmetrope::correction
