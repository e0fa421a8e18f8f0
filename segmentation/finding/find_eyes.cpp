#include "segmentation/finding/find_eyes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <optional>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "segmentation/finding/lens_axis.hpp"
#include "segmentation/finding/shared_noise.hpp"
#include "segmentation/intake/canonical_stack.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;

constexpr double least_separation_mm = 42, largest_separation_mm = 82;  // from small children to wide adults
constexpr double least_score = 0.45;
constexpr double same_eye_mm = 12;  ///< the head moves less than this between series
/// a globe farther to one side is that side's: half the least separation
constexpr double off_midline_mm = 10;
constexpr std::size_t most_stacks = 4;

/// Two places side by side: distance in range, more across than along the head.
bool are_side_by_side(const Vector3d& a, const Vector3d& b) {
  const Vector3d d = b - a;
  return d.norm() > least_separation_mm && d.norm() < largest_separation_mm &&
         std::abs(d.x()) > 0.85 * d.norm();
}

/// Two globes side by side, of like size.
bool is_pair(const EyeCandidate& a, const EyeCandidate& b) {
  return a.weighting == b.weighting && are_side_by_side(a.centre, b.centre) &&
         std::abs(a.radius_mm - b.radius_mm) < 0.2 * (a.radius_mm + b.radius_mm) / 2;
}

double merit_of(const Stack& stack, const EyeCandidate& globe) {
  const double thickness = std::max(stack.slice_thickness_mm, 0.1);
  const double contrast = std::min(globe.contrast_to_spread, 100.0);
  // Any other image of an eye through which the face was taken off says more of it.
  constexpr double of_blanked = 1e-3;
  return (globe.blanked > 0 ? of_blanked : 1) * contrast * contrast * globe.score() /
         (stack.column_spacing_mm * stack.row_spacing_mm * thickness);
}

/// The best pair, or nothing.
std::vector<EyeCandidate> best_pair(const std::vector<EyeCandidate>& candidates) {
  std::vector<EyeCandidate> best;
  double best_score = 0;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    for (std::size_t j = i + 1; j < candidates.size(); ++j) {
      const double score = candidates[i].score() + candidates[j].score();
      if (!is_pair(candidates[i], candidates[j]) || score <= best_score) continue;
      best_score = score;
      best = {candidates[i], candidates[j]};
    }
  }
  return best;
}

/// What one stack shows: a pair, or its best single globe.
struct SeenGlobes {
  std::vector<EyeCandidate> globes;
  Zeros zeros = Zeros::dark;  ///< as they were taken for
};

/// Where no pair is sure the face may have been taken off through the eyes: then a pair that nearly all edges agree on
/// which touch no zero.
SeenGlobes globes_in_stack(const Stack& stack) {
  // Of 31 blanked heads other places have 0.61 at most.
  constexpr double sure_agreement = 0.65, least_seen = 0.25;
  const auto is_sure = [](const EyeCandidate& c) {
    return c.agreement >= sure_agreement && c.score() >= least_score &&
           c.inside * (1 - c.blanked) >= least_seen;
  };
  const std::vector<EyeCandidate> candidates = find_candidates(stack);
  std::vector<EyeCandidate> globes = best_pair(candidates);
  if (globes.empty() || !std::all_of(globes.begin(), globes.end(), is_sure)) {
    std::vector<EyeCandidate> sure = find_candidates(stack, Zeros::blanked);
    sure.erase(std::remove_if(sure.begin(), sure.end(), std::not_fn(is_sure)), sure.end());
    const std::vector<EyeCandidate> of_defaced = best_pair(sure);
    if (!of_defaced.empty()) return {of_defaced, Zeros::blanked};
  }
  if (globes.empty() && !candidates.empty()) globes = {candidates.front()};
  SeenGlobes seen;
  for (const EyeCandidate& c : globes)
    if (c.score() >= least_score) seen.globes.push_back(c);
  return seen;
}

struct Cluster {
  std::vector<EyeView> views;
  Vector3d centre() const {
    Vector3d sum = Vector3d::Zero();
    for (const EyeView& v : views) sum += v.globe.centre;
    return sum / static_cast<double>(views.size());
  }
  double merit() const {
    double sum = 0;
    for (const EyeView& v : views) sum += v.merit;
    return sum;
  }
};

/// The same globe as the voxels about it alone show it (all slices of a stack that is no lattice), so that how much
/// else the file holds does not move what the fit starts from. Twice: the first time the part's middle is still that of
/// the whole file.
EyeCandidate seen_from_near(const Stack& stack, EyeCandidate globe, Zeros zeros) {
  constexpr double reach_mm = 40, same_globe_mm = 4;
  for (int i = 0; i < 2; ++i) {
    const std::vector<EyeCandidate> near =
        find_candidates(canonical_part(stack, globe.centre, reach_mm), zeros);
    const auto same = std::find_if(near.begin(), near.end(), [&](const EyeCandidate& other) {
      return other.weighting == globe.weighting && (other.centre - globe.centre).norm() < same_globe_mm;
    });
    if (same == near.end()) break;
    globe = *same;
  }
  return globe;
}

/// The globes of all stacks, those of one place together.
std::vector<Cluster> cluster_globes(const std::vector<const Stack*>& stacks) {
  std::vector<Cluster> clusters;
  for (std::size_t s = 0; s < stacks.size(); ++s) {
    const SeenGlobes seen = globes_in_stack(*stacks[s]);
    for (const EyeCandidate& in_all : seen.globes) {
      const EyeCandidate globe = seen_from_near(*stacks[s], in_all, seen.zeros);
      const EyeView view{s, globe, merit_of(*stacks[s], globe)};
      const auto known = std::find_if(clusters.begin(), clusters.end(), [&](const Cluster& c) {
        return (c.centre() - globe.centre).norm() < same_eye_mm;
      });
      if (known != clusters.end()) {
        known->views.push_back(view);
      } else {
        clusters.push_back({{view}});
      }
    }
  }
  return clusters;
}

/// The best pair, the right one first, else the best single globe.
std::vector<Cluster> best_pair_or_globe(const std::vector<Cluster>& clusters) {
  std::vector<Cluster> eyes;
  double best = 0;
  for (std::size_t i = 0; i < clusters.size(); ++i) {
    for (std::size_t j = i + 1; j < clusters.size(); ++j) {
      const Cluster &a = clusters[i], &b = clusters[j];
      const double merit = a.merit() + b.merit();
      if (merit <= best || !are_side_by_side(a.centre(), b.centre())) continue;
      best = merit;
      eyes = b.centre().x() > a.centre().x() ? std::vector<Cluster>{a, b} : std::vector<Cluster>{b, a};
    }
  }
  if (eyes.empty() && !clusters.empty()) {
    eyes.push_back(
        *std::max_element(clusters.begin(), clusters.end(),
                          [](const Cluster& a, const Cluster& b) { return a.merit() < b.merit(); }));
  }
  return eyes;
}

/// The contrast that says more about the eye.
Weighting better_contrast(const Cluster& cluster) {
  double merit[2]{0, 0};
  for (const EyeView& v : cluster.views) merit[v.globe.weighting == Weighting::t2] += v.merit;
  return merit[1] >= merit[0] ? Weighting::t2 : Weighting::t1;
}

bool shows(const Cluster& cluster, Weighting weighting) {
  return std::any_of(cluster.views.begin(), cluster.views.end(),
                     [&](const EyeView& v) { return v.globe.weighting == weighting; });
}

/// Stacks that are no acquisition of their own beside others of their contrast, each with what stands for it.
std::map<std::size_t, std::size_t> find_stored_again(const std::vector<Cluster>& eyes,
                                                     const std::vector<const Stack*>& stacks) {
  std::map<std::size_t, std::size_t> again;
  for (const Weighting weighting : {Weighting::t1, Weighting::t2}) {
    std::map<std::size_t, std::vector<Vector3d>> globes_of;
    for (const Cluster& eye : eyes)
      for (const EyeView& view : eye.views)
        if (view.globe.weighting == weighting) globes_of[view.stack].push_back(eye.centre());
    std::vector<StackOfGlobes> compared;
    std::vector<std::size_t> numbers;
    for (const auto& [stack, globes] : globes_of) {
      compared.push_back({stacks[stack], globes});
      numbers.push_back(stack);
    }
    for (const auto& [copy, source] : find_stored_again(compared)) again[numbers[copy]] = numbers[source];
  }
  return again;
}

/// \param again  stacks that count for nothing where the one that stands for them shows the eye, too
void choose_views(const Cluster& cluster, const std::map<std::size_t, std::size_t>& again, FoundEye& eye) {
  for (const auto& [copy, source] : again)
    if (std::any_of(cluster.views.begin(), cluster.views.end(), [&, stands = source](const EyeView& v) {
          return v.stack == stands && v.globe.weighting == eye.weighting;
        }))
      eye.stored_again[copy] = source;
  std::vector<EyeView> sorted = cluster.views;
  std::stable_sort(sorted.begin(), sorted.end(),
                   [](const EyeView& a, const EyeView& b) { return a.merit > b.merit; });
  for (const EyeView& v : sorted) {
    const bool useful = v.globe.weighting == eye.weighting && eye.stored_again.count(v.stack) == 0 &&
                        (eye.views.empty() || v.merit > 0.1 * eye.views.front().merit) &&
                        eye.views.size() < most_stacks;
    (useful ? eye.views : eye.left_out).push_back(v);
  }
  eye.radius_mm = eye.views.front().globe.radius_mm;
}

/// The wrong eye is the worst result: a stack that shows one globe only must not say that it is the other
/// one.
/// \throw Error (input_invalid)
void compare_with_tags(const std::vector<Cluster>& eyes, const std::vector<const Stack*>& stacks,
                       const std::vector<std::string>& laterality_tags) {
  const double midline_mm = eyes.size() == 2 ? (eyes[0].centre() + eyes[1].centre()).x() / 2 : 0;
  for (const Cluster& eye : eyes) {
    for (const EyeView& view : eye.views) {
      const auto shows_it_too = [&](const Cluster& other) {
        return &other != &eye && std::any_of(other.views.begin(), other.views.end(),
                                             [&](const EyeView& v) { return v.stack == view.stack; });
      };
      if (std::any_of(eyes.begin(), eyes.end(), shows_it_too)) continue;
      const std::string& tag = laterality_tags[view.stack];
      const double to_left_mm = view.globe.centre.x() - midline_mm;
      if ((tag == "R" && to_left_mm > off_midline_mm) || (tag == "L" && to_left_mm < -off_midline_mm))
        throw input_error(
            fmt::format(
                "{}: (0020,9072) FrameLaterality, (0020,0062) ImageLaterality or (0020,0060) Laterality says {}, "
                "but by (0020,0032) ImagePositionPatient the only eye in its images lies {:.0f} mm to the patient's {}",
                stacks[view.stack]->name, tag, std::abs(to_left_mm), to_left_mm > 0 ? "left" : "right"),
            "find out which of them is wrong; --series uses other series only");
    }
  }
}

/// Headers of orbit protocols may name the eye that was asked about in images of both.
std::vector<std::string> notes_on_tags(const std::vector<Cluster>& eyes,
                                       const std::vector<const Stack*>& stacks,
                                       const std::vector<std::string>& laterality_tags) {
  std::vector<std::string> notes;
  for (std::size_t s = 0; s < stacks.size(); ++s) {
    const auto is_shown = [&](const Cluster& eye) {
      return std::any_of(eye.views.begin(), eye.views.end(),
                         [&](const EyeView& view) { return view.stack == s; });
    };
    if (eyes.size() == 2 && std::all_of(eyes.begin(), eyes.end(), is_shown) &&
        (laterality_tags[s] == "R" || laterality_tags[s] == "L"))
      notes.push_back(fmt::format(
          "{}: (0020,0062) ImageLaterality, (0020,0060) Laterality or (0020,9072) FrameLaterality "
          "says {}, but both eyes are seen; their sides are those of (0020,0032) "
          "ImagePositionPatient",
          stacks[s]->name, laterality_tags[s]));
  }
  return notes;
}

/// Which eye a globe is that is seen alone.
/// \param note  receives how that was decided
/// \throw Error (input_invalid) where nothing tells
Laterality laterality_of_single(const Cluster& globe, const std::string& tag, std::optional<Laterality> asked,
                                std::string& note) {
  if (tag == "R" || tag == "L") {
    note = "one eye only is seen; its side is the image's laterality tag";
    return tag == "R" ? Laterality::od : Laterality::os;
  }
  const double x = globe.centre().x();
  const std::string place = fmt::format("{:.0f} mm to the patient's {} of the scanner's centre", std::abs(x),
                                        x < 0 ? "right" : "left");
  if (std::abs(x) < off_midline_mm) {
    if (!asked)
      throw input_error("one eye only is seen, " + place + ", and no tag says which it is",
                        "say it: --laterality od (right) or os (left)");
    note = fmt::format("one eye only is seen, {}; that it is the {} is what --laterality says", place,
                       clinical_name(*asked));
    return *asked;
  }
  note = "one eye only is seen; its side is taken from its place, " + place;
  return x < 0 ? Laterality::od : Laterality::os;
}

/// The chosen views of an eye, for the search of its lens.
std::vector<GlobeInStack> globes_of(const FoundEye& eye, const std::vector<const Stack*>& stacks) {
  std::vector<GlobeInStack> views;
  for (const EyeView& v : eye.views) views.push_back({stacks[v.stack], v.globe.centre});
  return views;
}

void find_axis(FoundEye& eye, const std::vector<const Stack*>& stacks) {
  const LensAxis lens = find_lens_axis(globes_of(eye, stacks), eye.radius_mm, eye.weighting);
  eye.axis = lens.axis;
  eye.other_axis = lens.other_axis;
  eye.lens_contrast = lens.lens_contrast;
}

/// A header by which both eyes look where no face is has the wrong axes; its left may be right, too.
/// \throw Error (input_invalid) naming the tag
void compare_with_orientation(const std::vector<FoundEye>& eyes, const std::vector<const Stack*>& stacks) {
  constexpr double alike_deg = 40;
  std::vector<Vector3d> gazes;
  for (const FoundEye& eye : eyes)
    if (const auto gaze = find_lens_elsewhere(globes_of(eye, stacks), eye.radius_mm, eye.weighting))
      gazes.push_back(*gaze);
  if (gazes.size() != 2 || gazes[0].dot(gazes[1]) < std::cos(alike_deg * degree)) return;
  const Vector3d gaze = (gazes[0] + gazes[1]).normalized();
  Eigen::Index most = 0;
  gaze.cwiseAbs().maxCoeff(&most);
  constexpr std::array<std::array<const char*, 2>, 3> sides{
      {{"right", "left"}, {"front", "back"}, {"feet", "top"}}};
  throw input_error(
      fmt::format(
          "{}: by (0020,0037) ImageOrientationPatient (a NIfTI's sform or qform) both eyes look {:.0f} degrees "
          "away from straight ahead, to the head's {}",
          stacks[eyes[0].views.front().stack]->name, from_ahead_deg(gaze),
          sides[most][gaze[most] > 0 ? 1 : 0]),
      "take the scanner's own file, or one whose orientation is the head's; --series uses other series only");
}

/// Adds to a stack's choice what it shows of an eye.
/// \param why  it is used or not
void explain(StackChoice& choice, const FoundEye& eye, const EyeView& view, const std::string& why) {
  const std::string text = fmt::format(
      "{}: globe seen with {:.0f} % of its wall on a sphere of {:.1f} mm, {:.0f} % of it inside the stack{}, "
      "merit {:.3g}",
      to_string(eye.laterality), 100 * view.globe.agreement, view.globe.radius_mm, 100 * view.globe.inside,
      view.globe.blanked > 0
          ? fmt::format(", of what was not blanked ({:.0f} % was)", 100 * view.globe.blanked)
          : "",
      view.merit);
  if (choice.weighting.empty())
    choice.reason.clear();
  else
    choice.reason += ". ";
  choice.reason += fmt::format("{}; {}", text, why);
  choice.weighting = to_string(view.globe.weighting);
}

std::string why_left_out(const FoundEye& eye, const EyeView& view, const std::vector<const Stack*>& stacks) {
  if (view.globe.weighting != eye.weighting)
    return fmt::format("{} says more about this eye", to_string(eye.weighting));
  if (const auto again = eye.stored_again.find(view.stack); again != eye.stored_again.end())
    return fmt::format("not used: it has the noise of {}: one acquisition that was stored twice",
                       stacks[again->second]->name);
  return "not used: it adds little to the better stacks";
}

}  // namespace

FoundEyes find_eyes(const std::vector<const Stack*>& stacks, const std::vector<std::string>& laterality_tags,
                    std::optional<Laterality> asked) {
  FoundEyes found;
  for (std::size_t s = 0; s < stacks.size(); ++s) {
    StackChoice& choice = found.choices.emplace_back();
    choice.stack = s;
    if (const auto told = stacks[s]->told_weighting)
      choice.reason += fmt::format(" as {} shows it, which its echo, repetition and inversion times tell",
                                   to_string(*told));
  }
  const std::vector<Cluster> eyes = best_pair_or_globe(cluster_globes(stacks));
  compare_with_tags(eyes, stacks, laterality_tags);
  found.notes = notes_on_tags(eyes, stacks, laterality_tags);
  const std::map<std::size_t, std::size_t> again = find_stored_again(eyes, stacks);
  for (std::size_t e = 0; e < eyes.size(); ++e) {
    FoundEye eye;
    eye.weighting = better_contrast(eyes[e]);
    choose_views(eyes[e], again, eye);
    if (eyes.size() == 2)
      eye.laterality = e == 0 ? Laterality::od : Laterality::os;
    else
      eye.laterality = laterality_of_single(eyes[e], laterality_tags[eye.views.front().stack], asked,
                                            found.notes.emplace_back());
    find_axis(eye, stacks);
    for (const EyeView& view : eye.views) {
      explain(found.choices[view.stack], eye, view, "used");
      found.choices[view.stack].used = true;
    }
    for (const EyeView& view : eye.left_out)
      explain(found.choices[view.stack], eye, view, why_left_out(eye, view, stacks));
    found.eyes.push_back(eye);
    FoundEye other;
    other.laterality = eye.laterality;
    other.weighting = eye.weighting == Weighting::t2 ? Weighting::t1 : Weighting::t2;
    if (!shows(eyes[e], other.weighting)) continue;
    choose_views(eyes[e], again, other);
    find_axis(other, stacks);
    found.in_other_contrast.push_back(other);
  }
  compare_with_orientation(found.eyes, stacks);
  return found;
}

}  // namespace emmetrope::segmentation
