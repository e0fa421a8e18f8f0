#include "segmentation/judgement/two_contrasts.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <utility>

#include "pipeline/eye/population/limits.hpp"
#include "segmentation/fit/both_contrasts.hpp"

namespace emmetrope::segmentation {
namespace {

bool knows_more(const JudgedEye& a, const JudgedEye& b) {
  return std::pair(a.rank(), a.is_read()) > std::pair(b.rank(), b.is_read());
}

bool is_surer(const JudgedEye& a, const JudgedEye& b) {
  return a.has_front() && b.has_front() && a.fit->pole_depth_sigma_mm() < b.fit->pole_depth_sigma_mm();
}

constexpr std::array<const char*, distance_count> distance_names{"axial length", "anterior chamber", "lens",
                                                                 "globe's width", "globe's height"};

/// What both cannot be right in.
std::optional<QualityGate> contradiction(const JudgedEye& a, const JudgedEye& b) {
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

void put_together(JudgedEye& eye, JudgedEye in_other_contrast) {
  if (knows_more(in_other_contrast, eye) ||
      (!knows_more(eye, in_other_contrast) && is_surer(in_other_contrast, eye)))
    std::swap(eye, in_other_contrast);
  JudgedEye& other = eye.in_other_contrast.emplace_back(std::move(in_other_contrast));
  // A reading that may be another is not made surer by a second one.
  if (!eye.has_front() || !other.has_front() || eye.rival || other.rival) return;
  if (const std::optional<QualityGate> contradicted = contradiction(eye, other)) {
    eye.gates.push_back(*contradicted);
    doubt_each_other(*eye.fit, *other.fit);
  } else {
    join_contrasts(*eye.fit, *other.fit);
    eye.is_joined = true;
  }
}

void explain_contrasts(std::vector<StackChoice>& choices, const JudgedEye& eye) {
  const auto say = [&](const EyeView& view, const std::string& what) {
    choices[view.stack].reason += fmt::format(". {}: {}", to_string(eye.found.laterality), what);
  };
  for (const EyeView& view : eye.found.views) choices[view.stack].used = true;
  if (eye.in_other_contrast.empty()) {
    for (const EyeView& view : eye.found.left_out)
      if (view.globe.weighting != eye.found.weighting) say(view, "not used");
    return;
  }
  const JudgedEye& other = eye.in_other_contrast.front();
  for (const EyeView& view : other.found.views) {
    say(view, fate_of_other(eye));
    choices[view.stack].used = choices[view.stack].used || eye.is_joined;
  }
}

}  // namespace emmetrope::segmentation
