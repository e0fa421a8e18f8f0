#include "correction/search/search.hpp"

#include <fmt/core.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace emmetrope::correction {
namespace {

/// Optima closer than a third of the depth of focus are one (3 mm pupil: 0.13 D, on the coarse level 1 D).
double same_optimum_D(const ImagingLevel& level) { return level.depth_of_focus_D() / 3; }
/// The fine search stays this near to where the coarse one ended: that is a third of its depth of focus off
/// at most, and spherical aberration adds as much again through 6 mm, by the square of a wider pupil. Farther
/// away, where the picture is all blur, noise has maxima of its own.
double fine_reach_D(double pupil_mm) { return 1 + std::max(1.0, std::pow(pupil_mm / 6, 2)); }
/// A coarse optimum is followed to the fine level only where it comes near the sharpest.
constexpr double worth_following = 0.95;

/// Rays a pixel of the fine picture. Each meets the chart somewhere in the disc of blur, and what they differ
/// by passes for detail. A chart whose power falls as f^-3 varies within a disc as the disc is wide, and
/// spherical aberration widens that as the cube of the pupil: with as many more rays noise is that of 3 mm.
int fine_samples(double pupil_mm) {
  constexpr int at_most_3_mm = 32;  // and multiples of it: lanes times rays in flight
  return at_most_3_mm * static_cast<int>(std::ceil(std::pow(std::max(1.0, pupil_mm / 3), 3)));
}

struct Ascent {
  LensFamily family;
  Optimum end;
};

/// Sorts by sharpness and drops what is near a sharper one of its family.
std::vector<Ascent> distinct(std::vector<Ascent> all, double apart_D) {
  std::stable_sort(all.begin(), all.end(),
                   [](const Ascent& a, const Ascent& b) { return a.end.sharpness > b.end.sharpness; });
  std::vector<Ascent> kept;
  for (Ascent& one : all)
    if (std::none_of(kept.begin(), kept.end(), [&](const Ascent& other) {
          return other.family.name == one.family.name && (other.end.lens - one.end.lens).norm() < apart_D;
        }))
      kept.push_back(std::move(one));
  return kept;
}

/// What is near the sharpest in sharpness, from a sorted list.
std::vector<Ascent> worthwhile(std::vector<Ascent> sorted) {
  const double least = worth_following * sorted.front().end.sharpness;
  sorted.erase(std::find_if(sorted.begin(), sorted.end(),
                            [&](const Ascent& one) { return one.end.sharpness < least; }),
               sorted.end());
  return sorted;
}

}  // namespace

double accepted_step_D(double sampling_sigma_D) {
  constexpr double most_D = 0.0625;  // a quarter of the step that lenses come in
  return std::max(0.02, std::min(sampling_sigma_D, most_D));
}

std::vector<ImagingLevel> imaging_levels(SharpnessCriterion criterion, double pupil_mm, double wavelength_nm,
                                         const Eigen::Vector2d& centre_mm, std::uint64_t seed) {
  ImagingLevel coarse;
  coarse.criterion = SharpnessCriterion::gradient_energy;
  coarse.pixels = 96;
  coarse.field_mm = 4;
  coarse.samples = 32;
  coarse.blur_arcmin = 8;
  coarse.pupil_mm = std::min(pupil_mm, 3.0);
  ImagingLevel fine;
  fine.criterion = criterion;
  fine.pixels = 192;
  fine.field_mm = 1.2;  // pixels fine enough for the chart's detail, whatever a lens magnifies
  fine.samples = fine_samples(pupil_mm);
  for (ImagingLevel* level : {&coarse, &fine}) {
    level->wavelength_nm = wavelength_nm;
    level->centre_mm = centre_mm;
    level->seed = seed;
  }
  fine.pupil_mm = pupil_mm;
  return {coarse, fine};
}

SearchResult find_sharpest(const raytrace::Tracer& tracer,
                           const std::shared_ptr<const raytrace::Scene>& scene, const EyeModel& eye,
                           const std::vector<ImagingLevel>& levels, const std::vector<Start>& starts) {
  SearchResult result;
  std::vector<Ascent> ascents;
  for (const Start& start : starts) {
    ascents.push_back({start.family, {}});
    ascents.back().end.lens = start.lens;
  }
  for (const ImagingLevel& level : levels) {
    const bool last = &level == &levels.back();
    for (auto one = ascents.begin(); one != ascents.end(); ++one) {
      OptimiserSettings settings = last ? OptimiserSettings{} : coarse_search();
      if (last) settings.reach_D = fine_reach_D(level.pupil_mm);
      settings.known_maximum_reach_D = last ? 0 : same_optimum_D(level);
      for (auto before = ascents.begin(); before != one; ++before)
        if (before->family.name == one->family.name) settings.known_maxima.push_back(before->end.lens);
      const RetinalSharpness sharpness(tracer, scene, eye, one->family, level);
      one->end = ascend(sharpness, one->end.lens, settings);
      result.images += sharpness.images();
    }
    ascents = distinct(std::move(ascents), same_optimum_D(level));
    if (!last) ascents = worthwhile(std::move(ascents));
  }
  result.family = ascents.front().family;
  result.best = ascents.front().end;
  for (const Ascent& one : ascents)
    if (one.family.name == result.family.name) result.optima.push_back(one.end.lens);

  const RetinalSharpness sharpness(tracer, scene, eye, result.family, levels.back());
  result.curvature = curvature_of_log(std::cref(sharpness), result.best);
  ImagingLevel other_rays = levels.back();
  other_rays.seed += 1;
  const RetinalSharpness again(tracer, scene, eye, result.family, other_rays);
  const SharpnessValue value = again(result.best.lens);
  // The optimum moves by H^-1 times the change of slope; two sets of rays differ by sqrt(2) times one set's
  // error.
  const auto inverse = result.curvature.ldlt();
  result.sampling_sigma_D =
      inverse.solve(value.gradient / value.value - result.best.gradient).cwiseAbs() / std::sqrt(2.0);
  result.images += sharpness.images() + again.images();

  const double flattest = largest_eigenvalue(result.curvature);
  const double next_step_D = inverse.solve(result.best.gradient).norm();
  if (!result.best.converged)
    result.reason = "the search for the sharpest image did not converge: " + result.best.reason;
  else if (!(flattest < 0))
    result.reason =
        "there is no sharpest lens: sharpness does not fall in every direction from where the search ended";
  else if (!(next_step_D < accepted_step_D(result.sampling_sigma_D.norm())))
    result.reason = fmt::format("the search ended {:.2f} D before the sharpest lens", next_step_D);
  result.accepted = result.reason.empty();
  return result;
}

}  // namespace emmetrope::correction
