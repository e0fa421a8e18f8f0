#include "segmentation/judgement/fellow_eye.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <tuple>
#include <utility>

#include "pipeline/base/parallel.hpp"
#include "pipeline/eye/population/limits.hpp"
#include "segmentation/fit/both_eyes.hpp"
#include "segmentation/fit/eye_distances.hpp"

namespace emmetrope::segmentation {
namespace {

bool in_the_same_stacks(const JudgedEye& a, const JudgedEye& b) {
  return a.found.weighting == b.found.weighting &&
         std::equal(a.found.views.begin(), a.found.views.end(), b.found.views.begin(), b.found.views.end(),
                    [](const EyeView& x, const EyeView& y) { return x.stack == y.stack; });
}

/// The largest difference in the displacement of fat that is beyond three standard deviations, mm.
double fat_shifts_apart_mm(const EyeFit& a, const EyeFit& b) {
  double largest = 0;
  for (int s = 0; s < a.layout.stacks; ++s)
    for (const int along : {0, 1}) {
      const int at = a.layout.stack(s) + fat_shift_first + along;
      const double difference_mm = std::abs(a.value(at) - b.value(at));
      if (difference_mm > 3 * std::hypot(a.sigma(at), b.sigma(at)))
        largest = std::max(largest, difference_mm);
    }
  return largest;
}

QualityGate failed(const char* name, double value, double limit, Withholds withholds,
                   const std::string& reason) {
  QualityGate gate;
  gate.name = name;
  gate.value = value;
  gate.limit = limit;
  gate.passed = false;
  gate.withholds = withholds;
  gate.reason = reason;
  return gate;
}

std::optional<QualityGate> fat_contradiction(const EyeFit& a, const EyeFit& b) {
  const char* name = "fat_shift_difference_mm";
  const double apart_mm = fat_shifts_apart_mm(a, b);
  const Range allowed = limits_of(name).accepted;
  if (allowed.contains(apart_mm)) return std::nullopt;
  return failed(name, apart_mm, allowed.high, Withholds::fit,
                fmt::format("the two eyes contradict each other: in the same images the fat around one is "
                            "displaced by {:.1f} mm more than around the other, so that one was misread",
                            apart_mm));
}

constexpr const char* chamber_difference = "chamber_difference";

/// In standard deviations, of which a part is what chambers of a person differ by.
std::optional<QualityGate> chamber_contradiction(const EyeFit& a, const EyeFit& b) {
  const double apart_mm = std::abs(a.value(anterior_chamber_depth) - b.value(anterior_chamber_depth)),
               sigmas = apart_mm / std::hypot(chamber_depth_difference_mm, a.sigma(anterior_chamber_depth),
                                              b.sigma(anterior_chamber_depth));
  const Range allowed = limits_of(chamber_difference).accepted;
  if (allowed.contains(sigmas)) return std::nullopt;
  return failed(
      chamber_difference, sigmas, allowed.high, Withholds::front,
      fmt::format("the two eyes contradict each other: the anterior chamber of one is {:.1f} mm deeper, "
                  "so that the iris or the lid of one was taken for its cornea (or its lens was replaced)",
                  apart_mm));
}

/// What two eyes in the same images cannot both be right in. Where one eye's front was not found it tells nothing of the
/// other's.
std::optional<QualityGate> contradiction(const JudgedEye& a, const JudgedEye& b) {
  if (auto fat = fat_contradiction(*a.fit, *b.fit)) return fat;
  if (!a.has_front() || !b.has_front()) return std::nullopt;
  if (auto chamber = chamber_contradiction(*a.fit, *b.fit)) return chamber;
  const char* name = "vertical_gaze_difference_deg";
  const double apart_deg = std::abs(a.fit->value(gaze_vertical) - b.fit->value(gaze_vertical));
  const Range allowed = limits_of(name).accepted;
  if (allowed.contains(apart_deg)) return std::nullopt;
  return failed(name, apart_deg, allowed.high, Withholds::front,
                fmt::format("the two eyes contradict each other: one looks {:.0f} degrees higher than the "
                            "other, so that the front of one was misread (or the eyes squint)",
                            apart_deg));
}

/// The eye with its own edges and its fellow's sizes and displacement of fat to start from.
JudgedEye fitted_again(const JudgedEye& eye, const JudgedEye& fellow, const std::string& because,
                       const std::vector<const Stack*>& stacks, std::optional<double> age_years,
                       const std::function<void()>& advance) {
  JudgedEye again;
  again.found = eye.found;
  again.fitted_again_because = "beside the other eye: " + because;
  again.edges = eye.edges;
  EyeStart start = start_of(eye.found, eye.edges, age_years);
  start.fellow = fellow.fit->parameters;
  start.fellow.segment<3>(globe_x) = fellow.fit->half_axes_along_voxels_mm;
  if (fellow.has_front()) start.fellows_chamber_mm = fellow.fit->value(anterior_chamber_depth);
  start.others.clear();  // the fellow's sizes are tried instead of a sphere
  fit_and_judge(again, views_of(eye.found, stacks), start, advance);
  return again;
}

/// How far their depths are from what they were thought to be before the images were seen, squared, in standard
/// deviations; a person's chambers are about one number.
double unlikeliness_of_chambers(const FellowPair& pair) {
  double squares = 0;
  for (const JudgedEye* eye : {pair.od, pair.os}) {
    const EyeFit& fit = *eye->fit;
    const int chamber = anterior_chamber_depth;
    squares += std::pow((fit.value(chamber) - fit.priors.mean[chamber]) / fit.priors.sigma[chamber], 2);
  }
  return squares / 2;
}

bool has_chambers_elsewhere(const FellowPair& a, const FellowPair& b) {
  return chamber_contradiction(*a.od->fit, *b.od->fit) || chamber_contradiction(*a.os->fit, *b.os->fit);
}

/// The least of a list that is not empty.
template <typename Badness>
FellowPair least(const std::vector<FellowPair>& pairs, const Badness& badness) {
  return *std::min_element(pairs.begin(), pairs.end(),
                           [&](const FellowPair& a, const FellowPair& b) { return badness(a) < badness(b); });
}

/// Whether no fellow changes what an eye was found to be: without a front, with an implant, full of oil.
bool is_of_its_own(const JudgedEye& eye) {
  return eye.fit && (eye.fit->front_is_blanked() ||
                     std::any_of(eye.gates.begin(), eye.gates.end(), [](const QualityGate& gate) {
                       return !gate.passed &&
                              (gate.name == "natural_lens_mm" || gate.name == "fluid_difference_t2");
                     }));
}

}  // namespace

std::vector<FellowPair> all_pairs(const std::vector<const JudgedEye*>& od,
                                  const std::vector<const JudgedEye*>& os) {
  std::vector<FellowPair> pairs;
  for (const JudgedEye* right : od)
    for (const JudgedEye* left : os) pairs.push_back({right, left});
  return pairs;
}

std::optional<LikeliestPair> likeliest_agreeing(const JudgedEye& od, const JudgedEye& os,
                                                const std::vector<FellowPair>& pairs) {
  std::vector<FellowPair> agreeing;
  for (const FellowPair& pair : pairs)
    if (is_as_good(*pair.od, od) && is_as_good(*pair.os, os) && !contradiction(*pair.od, *pair.os))
      agreeing.push_back(pair);
  if (agreeing.empty()) return std::nullopt;
  const auto residuals = [&](const FellowPair& pair) {
    return pair.od->fit->chi2_per_voxel / od.fit->chi2_per_voxel +
           pair.os->fit->chi2_per_voxel / os.fit->chi2_per_voxel;
  };
  if (!od.has_front() || !os.has_front() || !chamber_contradiction(*od.fit, *os.fit))
    return LikeliestPair{least(agreeing, residuals), {}, 0};
  // An iris or a lid that was taken for the cornea may leave as little: of the depths that there are the likeliest.
  const FellowPair likeliest = least(agreeing, unlikeliness_of_chambers);
  std::vector<FellowPair> alike, rivals;
  std::copy_if(agreeing.begin(), agreeing.end(), std::back_inserter(alike),
               [&](const FellowPair& pair) { return !has_chambers_elsewhere(pair, likeliest); });
  LikeliestPair taken{least(alike, residuals), {}, 0};
  std::copy_if(agreeing.begin(), agreeing.end(), std::back_inserter(rivals),
               [&](const FellowPair& pair) { return has_chambers_elsewhere(pair, taken.pair); });
  if (rivals.empty()) return taken;
  taken.rival = least(rivals, unlikeliness_of_chambers);
  const double odds =
      std::exp((unlikeliness_of_chambers(taken.pair) - unlikeliness_of_chambers(*taken.rival)) / 2);
  taken.rivals_probability = odds / (1 + odds);
  return taken;
}

namespace {

double chamber_mm(const JudgedEye* eye) { return eye->fit->value(anterior_chamber_depth); }

/// Puts the pair that was taken in place of the old fits.
void take(const LikeliestPair& taken, JudgedEye& od, JudgedEye& os) {
  JudgedEye new_od = *taken.pair.od, new_os = *taken.pair.os;
  if (taken.rival) {
    const auto& [right, left] = taken.pair;
    const auto& [other_right, other_left] = *taken.rival;
    new_od.rival = Rival{*other_right->fit, taken.rivals_probability};
    new_os.rival = Rival{*other_left->fit, taken.rivals_probability};
    const auto sigmas_apart = [](const JudgedEye* a, const JudgedEye* b) {
      const auto contradicting = chamber_contradiction(*a->fit, *b->fit);
      return contradicting ? contradicting->value : 0;
    };
    const QualityGate doubt = failed(
        "rival_chamber", std::max(sigmas_apart(right, other_right), sigmas_apart(left, other_left)),
        limits_of(chamber_difference).accepted.high, Withholds::nothing,
        fmt::format(
            "anterior chambers of {:.1f} mm (right) and {:.1f} mm (left) explain the images about as well as "
            "{:.1f} and {:.1f} mm: the intervals of both eyes reach to both",
            chamber_mm(other_right), chamber_mm(other_left), chamber_mm(right), chamber_mm(left)));
    for (JudgedEye* eye : {&new_od, &new_os}) eye->gates.push_back(doubt);
  }
  od = std::move(new_od);
  os = std::move(new_os);
}

}  // namespace

void compare_fellow_eyes(JudgedEye& od, JudgedEye& os, const std::vector<const Stack*>& stacks,
                         std::optional<double> age_years, int threads, Verbosity verbosity) {
  if (!in_the_same_stacks(od, os)) return;
  if (od.rank() != os.rank()) {
    JudgedEye &less = od.rank() < os.rank() ? od : os, &more = od.rank() < os.rank() ? os : od;
    if (!is_of_its_own(less)) {
      Progress progress(fmt::format("fitting {} again", clinical_name(less.found.laterality)), fit_steps,
                        verbosity);
      JudgedEye again =
          fitted_again(less, more, less.reasons(), stacks, age_years, [&] { progress.advance(); });
      // A fit that was withheld is a gain even where the front still contradicts the fellow's: that is judged next.
      if (is_as_good(again, less) && again.rank() > less.rank() && !fat_contradiction(*again.fit, *more.fit))
        less = std::move(again);
    }
  }
  if (!od.is_fitted() || !os.is_fitted()) return;
  const std::optional<QualityGate> found = contradiction(od, os);
  if (!found) return;
  // Each beside the other as it was, and then beside what became of that one.
  Progress progress("fitting both eyes again", std::size_t{4} * fit_steps, verbosity);
  const auto both_beside = [&](const JudgedEye& beside_od, const JudgedEye& beside_os) {
    std::array<JudgedEye, 2> again;
    on_threads(threads, 2, [&](std::size_t i) {
      const JudgedEye &eye = i == 0 ? od : os, &fellow = i == 0 ? beside_od : beside_os;
      if (fellow.is_fitted())
        again[i] = fitted_again(eye, fellow, found->reason, stacks, age_years, [&] { progress.advance(); });
    });
    return again;
  };
  const std::array<JudgedEye, 2> second = both_beside(os, od), third = both_beside(second[1], second[0]);
  const std::vector<FellowPair> pairs = all_pairs({&od, &second[0], &third[0]}, {&os, &second[1], &third[1]});
  if (const auto taken = likeliest_agreeing(od, os, pairs)) return take(*taken, od, os);
  for (JudgedEye* eye : {&od, &os}) eye->gates.push_back(*found);
}

namespace {

/// Extent of the interface along an axis of the globe.
struct Extent {
  Distance of_fit;
  Parameter half_axis;
  Estimate EdgeBiometry::*by_edges;
  const char* dimension;
};

/// As it is told: by the fit, or by the edges that stand in for it.
Estimate told(const JudgedEye& eye, const Extent& extent) {
  if (!eye.is_fitted()) return eye.stated_edges().*extent.by_edges;
  const EyeFit& fit = *eye.fit;
  const Eigen::VectorXd derivatives = distance_derivatives(fit).col(extent.of_fit);
  double extent_mm = 0;
  for (std::size_t i = 0; i < fit.active.size(); ++i)
    extent_mm += derivatives[static_cast<Eigen::Index>(i)] * fit.value(fit.active[i]);
  return {extent_mm, std::sqrt(derivatives.dot(fit.covariance * derivatives))};
}

/// \param by_mm  a standard deviation that is added to the extent's
void widen(JudgedEye& eye, const Extent& extent, double by_mm) {
  if (!eye.is_fitted()) {
    Estimate& by_edges = eye.edges.front()->biometry.*extent.by_edges;
    by_edges.sigma = std::hypot(by_edges.sigma, by_mm);
    return;
  }
  const std::vector<int>& active = eye.fit->active;
  const auto i = std::find(active.begin(), active.end(), static_cast<int>(extent.half_axis)) - active.begin();
  eye.fit->covariance(i, i) += std::pow(by_mm / 2, 2);
}

/// Globes of a person are about equally wide and high. Where they are told to differ by more, one was misread, or the
/// eyes do differ: which is not known, so that the interval of each reaches to the other.
void doubt_unlike_globes(JudgedEye& od, JudgedEye& os) {
  // Standard deviation of the difference; chosen (docs/method/segmentation.md, "Two eyes of one person").
  constexpr double difference_mm = 0.4;
  const char* name = "globe_difference";
  const Range allowed = limits_of(name).plausible;
  for (const Extent& extent : {Extent{globe_width, globe_x, &EdgeBiometry::globe_width, "wide"},
                               {globe_height, globe_y, &EdgeBiometry::globe_height, "high"}}) {
    const Estimate of_od = told(od, extent), of_os = told(os, extent);
    const double apart_mm = std::abs(of_od.value - of_os.value),
                 sigmas = apart_mm / std::hypot(difference_mm, of_od.sigma, of_os.sigma);
    if (allowed.contains(sigmas)) continue;
    for (JudgedEye* eye : {&od, &os}) {
      widen(*eye, extent, apart_mm / 2);
      eye->gates.push_back(failed(
          name, sigmas, allowed.high, Withholds::nothing,
          fmt::format(
              "the right globe is {:.1f} mm {}, the left {:.1f} mm: one was misread, or the eyes differ more "
              "than a person's do; the intervals of both reach to the other",
              of_od.value, extent.dimension, of_os.value)));
    }
  }
}

/// Widens the fit's covariance to the second moment, about what it tells, of a mixture with its rival. A rival that has
/// other free parameters (a cornea with a form) counts as sure as the fit.
void mix_in(EyeFit& fit, const Rival& rival) {
  Eigen::VectorXd apart(static_cast<Eigen::Index>(fit.active.size()));
  for (std::size_t i = 0; i < fit.active.size(); ++i) {
    const int parameter = fit.active[i];
    // A regular cornea has no form, which comes last: it is at the form's prior.
    const bool is_there = parameter < rival.fit.parameters.size();
    apart[static_cast<Eigen::Index>(i)] =
        (is_there ? rival.fit.value(parameter) : fit.priors.mean[parameter]) - fit.value(parameter);
  }
  if (rival.fit.active == fit.active)
    fit.covariance += rival.probability * (rival.fit.covariance - fit.covariance);
  fit.covariance += rival.probability * apart * apart.transpose();
}

}  // namespace

bool couple_fellow_eyes(JudgedEye& od, JudgedEye& os) {
  const bool coupled = od.has_front() && os.has_front() && couple_eyes(*od.fit, *os.fit);
  if (coupled && od.rival && os.rival) couple_eyes(od.rival->fit, os.rival->fit);
  for (JudgedEye* eye : {&od, &os})
    if (eye->rival) mix_in(*eye->fit, *eye->rival);
  const auto is_told_by_images = [](const JudgedEye& eye) {
    return eye.evidence == Evidence::intensities && (eye.is_fitted() || eye.is_read());
  };
  if (is_told_by_images(od) && is_told_by_images(os)) doubt_unlike_globes(od, os);
  return coupled;
}

}  // namespace emmetrope::segmentation
