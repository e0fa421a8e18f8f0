#include "segmentation/judgement/two_contrasts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <optional>
#include <utility>

#include "pipeline/eye/population/limits.hpp"
#include "segmentation/fit/both_contrasts.hpp"
#include "segmentation/fit/intraocular_mass.hpp"

namespace emmetrope::segmentation {
namespace {

bool knows_more(const JudgedEye& a, const JudgedEye& b) {
  return std::pair(a.rank(), a.is_read()) > std::pair(b.rank(), b.is_read());
}

/// Whether a reading may be narrowed by another, or stand for being surer.
bool is_plain(const JudgedEye& eye) {
  return eye.has_front() && !eye.rival && !eye.fit->layout.irregular_cornea;
}

/// Whether the other readings, one of each eye, know lengths better.
bool are_surer(const std::vector<JudgedEye>& others, const std::vector<JudgedEye>& eyes) {
  if (others.size() != eyes.size()) return false;
  double gained_mm2 = 0;
  for (std::size_t i = 0; i < eyes.size(); ++i) {
    if (!is_plain(others[i]) || !is_plain(eyes[i])) return false;
    gained_mm2 +=
        std::pow(eyes[i].fit->pole_depth_sigma_mm(), 2) - std::pow(others[i].fit->pole_depth_sigma_mm(), 2);
  }
  return gained_mm2 > 0;
}

bool is_one_of(const QualityGate& gate, std::initializer_list<const char*> names) {
  return std::any_of(names.begin(), names.end(), [&](const char* name) { return gate.name == name; });
}

/// What no healthy eye has.
std::vector<QualityGate> illness_in(const JudgedEye& eye) {
  std::vector<QualityGate> found;
  for (const QualityGate& gate : eye.gates)
    if (!gate.passed && is_one_of(gate, {"natural_lens_mm", "fluid_difference_t2", "intraocular_mass_mm3",
                                         "unexplained_in_vitreous_mm3", "intraocular_mass_seen_mm3"}))
      found.push_back(gate);
  return found;
}

/// Whether a sign of illness in one reading tells of the eye, which another reading may have right. A fit that is refused
/// has its globe or its front in the wrong place, and with it the lens's thickness and what it took for the aqueous; unless
/// nothing refuses it but what oil, blood or a mass does. Of a mass the voxels are seen: of a globe in the wrong place they
/// are wall, fat or lens, and lie in no vitreous by the other reading.
bool tells_of_eye(const QualityGate& sign, const JudgedEye& seen_by, const JudgedEye& eye) {
  if (seen_by.is_fitted()) return true;
  if (is_one_of(sign, {"natural_lens_mm", "fluid_difference_t2"}))
    return std::none_of(seen_by.gates.begin(), seen_by.gates.end(), [](const QualityGate& gate) {
      return !gate.passed && gate.withholds == Withholds::fit &&
             !is_one_of(gate, {"surroundings_over_vitreous_t2", "intraocular_mass_mm3",
                               "unexplained_in_vitreous_mm3"});
    });
  const EyeFit& fit = *seen_by.fit;
  const IntraocularMass& mass = sign.name == "unexplained_in_vitreous_mm3" ? fit.unexplained : fit.mass;
  return !eye.is_fitted() || is_in_vitreous(mass, *eye.fit);
}

constexpr std::array<const char*, distance_count> distance_names{"axial length", "anterior chamber", "lens",
                                                                 "globe's width", "globe's height"};

/// What both cannot be right in.
std::optional<QualityGate> contradiction_of_contrasts(const JudgedEye& a, const JudgedEye& b) {
  const Agreement agreement = agreement_of(*a.fit, *b.fit);
  const char* name = "contrast_difference";
  const Range allowed = limits_of(name).plausible;
  if (allowed.contains(agreement.sigmas)) return std::nullopt;
  QualityGate gate;
  gate.name = name;
  gate.value = agreement.sigmas;
  gate.limit = allowed.high;
  gate.passed = false;
  gate.withholds = Withholds::nothing;
  gate.reason = fmt::format(
      "{} and {} contradict each other: the {} is {:.1f} mm {} in {}, so that one was misread; the intervals of "
      "this eye are wider for it",
      to_string(a.found.weighting), to_string(b.found.weighting),
      distance_names[static_cast<std::size_t>(agreement.farthest)], std::abs(agreement.apart_mm),
      agreement.apart_mm > 0 ? "larger" : "smaller", to_string(a.found.weighting));
  return gate;
}

void judge_together(JudgedEye& eye, JudgedEye& other) {
  const std::vector<QualityGate> ill = illness_in(other);
  for (QualityGate gate : ill) {
    if (!tells_of_eye(gate, other, eye)) continue;
    gate.reason = fmt::format("in {}: {}", to_string(other.found.weighting), gate.reason);
    eye.gates.push_back(gate);
  }
  // A reading that may be another is not made surer by a second one.
  if (!eye.has_front() || !other.has_front() || eye.rival || other.rival || !ill.empty() ||
      !illness_in(eye).empty())
    return;
  if (const std::optional<QualityGate> contradicted = contradiction_of_contrasts(eye, other)) {
    eye.gates.push_back(*contradicted);
    doubt_each_other(*eye.fit, *other.fit);
  } else {
    join_contrasts(*eye.fit, *other.fit,
                   eye.is_measured() && other.is_measured() ? Joined::all : Joined::behind_cornea);
    eye.is_joined = true;
  }
}

/// What became of the other contrast.
std::string fate_of_other(const JudgedEye& eye) {
  const JudgedEye& other = eye.in_other_contrast.front();
  const char* name = to_string(eye.found.weighting);
  if (eye.is_joined) return fmt::format("fitted by itself, and joined with {}", name);
  if (knows_more(eye, other)) return fmt::format("fitted by itself; {} stands, as more is known by it", name);
  return fmt::format("fitted by itself; {} stands", name);
}

}  // namespace

bool is_other_contrast_wanted(const JudgedEye& eye, const FoundEye& in_other_contrast) {
  constexpr double much = 0.1;  // as of stacks of one contrast
  return !eye.is_measured() || in_other_contrast.merit() >= much * eye.found.merit();
}

void put_together(std::vector<JudgedEye>& eyes, std::vector<JudgedEye> in_other_contrast) {
  const bool surer = are_surer(in_other_contrast, eyes);
  for (JudgedEye& other : in_other_contrast) {
    const auto eye = std::find_if(eyes.begin(), eyes.end(), [&](const JudgedEye& one) {
      return one.found.laterality == other.found.laterality;
    });
    if (knows_more(other, *eye) || (surer && !knows_more(*eye, other))) std::swap(*eye, other);
    judge_together(*eye, eye->in_other_contrast.emplace_back(std::move(other)));
  }
}

void explain_contrasts(std::vector<StackChoice>& choices, const std::vector<JudgedEye>& eyes) {
  for (StackChoice& choice : choices) choice.used = false;
  for (const JudgedEye& eye : eyes) {
    const auto say = [&](const EyeView& view, const std::string& what) {
      choices[view.stack].reason += fmt::format(". {}: {}", to_string(eye.found.laterality), what);
    };
    for (const JudgedEye* reading : eye.readings())
      for (const EyeView& view : reading->found.views) choices[view.stack].used = true;
    if (eye.in_other_contrast.empty()) {
      for (const EyeView& view : eye.found.left_out)
        if (view.globe.weighting != eye.found.weighting) say(view, "not used");
      continue;
    }
    const std::string fate = fate_of_other(eye);
    for (const EyeView& view : eye.found.views) say(view, "stands");
    for (const EyeView& view : eye.in_other_contrast.front().found.views) say(view, fate);
  }
}

}  // namespace emmetrope::segmentation
