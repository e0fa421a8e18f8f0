#include "segmentation/judgement/fellow_eye.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/eye/population/limits.hpp"
#include "segmentation/intake/canonical_stack.hpp"

namespace emmetrope::segmentation {
namespace {

bool in_the_same_stacks(const JudgedEye& a, const JudgedEye& b) {
  return a.found.weighting == b.found.weighting &&
         std::equal(a.found.views.begin(), a.found.views.end(), b.found.views.begin(), b.found.views.end(),
                    [](const EyeView& x, const EyeView& y) { return x.stack == y.stack; });
}

/// The largest difference in the displacement of fat that is beyond three standard deviations, mm.
double fat_shift_difference_mm(const EyeFit& a, const EyeFit& b) {
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

QualityGate failed(const char* name, double value, Withholds withholds, const std::string& reason) {
  QualityGate gate;
  gate.name = name;
  gate.value = value;
  gate.limit = limits_of(name).accepted.high;
  gate.passed = false;
  gate.withholds = withholds;
  gate.reason = reason;
  return gate;
}

std::optional<QualityGate> fat_contradiction(const EyeFit& a, const EyeFit& b) {
  const char* name = "fat_shift_difference_mm";
  const double apart_mm = fat_shift_difference_mm(a, b);
  if (limits_of(name).accepted.contains(apart_mm)) return std::nullopt;
  return failed(name, apart_mm, Withholds::fit,
                fmt::format("the two eyes contradict each other: in the same images the fat around one is "
                            "displaced by {:.1f} mm more than around the other, so that one was misread",
                            apart_mm));
}

/// What two eyes in the same images cannot both be right in. Where one eye's front was not found its gaze tells nothing
/// of the other's.
std::optional<QualityGate> contradiction(const JudgedEye& a, const JudgedEye& b) {
  if (auto fat = fat_contradiction(*a.fit, *b.fit)) return fat;
  const char* name = "vertical_gaze_difference_deg";
  const double apart_deg = std::abs(a.fit->value(gaze_vertical) - b.fit->value(gaze_vertical));
  if (!a.has_front() || !b.has_front() || limits_of(name).accepted.contains(apart_deg)) return std::nullopt;
  return failed(name, apart_deg, Withholds::front,
                fmt::format("the two eyes contradict each other: one looks {:.0f} degrees higher than the "
                            "other, so that the front of one was misread (or the eyes squint)",
                            apart_deg));
}

/// Whether it is measured, agrees with its fellow, and explains its images better than before when it starts
/// from what that one is like.
bool improve(JudgedEye& eye, const JudgedEye& fellow, const std::string& because,
             const std::vector<const Stack*>& stacks, std::optional<double> age_years, Verbosity verbosity) {
  Progress progress(fmt::format("fitting {} again", clinical_name(eye.found.laterality)), fit_steps,
                    verbosity);
  JudgedEye again;
  again.found = eye.found;
  again.fitted_again_because = because;
  again.edges = eye.edges;
  EyeStart start = start_of(eye.found, eye.edges, age_years);
  start.fellow = fellow.fit->parameters;
  start.others.clear();  // sizes and tissues are the fellow's
  fit_and_judge(again, views_of(eye.found, stacks), start, [&] { progress.advance(); });
  if (!again.is_fitted() || again.rank() < eye.rank()) return false;
  // A fit that was withheld is a gain even where the front still contradicts the fellow's: that is judged next.
  const bool knows_more = again.rank() > eye.rank();
  if (knows_more ? fat_contradiction(*again.fit, *fellow.fit) : contradiction(again, fellow)) return false;
  if (eye.fit && again.fit->chi2_per_voxel > eye.fit->chi2_per_voxel) return false;
  eye = std::move(again);
  return true;
}

}  // namespace

std::string JudgedEye::reasons() const {
  std::string text;
  for (const Withholds what : {Withholds::fit, Withholds::front, Withholds::cornea})
    if (const std::string reasons = reasons_for(gates, what); !reasons.empty())
      text += (text.empty() ? "" : "; ") + reasons;
  return text;
}

std::string JudgedEye::edges_on_axis_withheld() const {
  if (edges.empty() || !edges.front() || !edges.front()->biometry.axial_length)
    return "cornea or lens have no edges of their own along the eye's axis";
  const double edges_sigma_mm = edges.front()->biometry.axial_length->sigma;
  for (const QualityGate& gate : gates) {
    // A fit that knows the length better than edges claim to does not speak against them.
    if (gate.name == "axial_length_sigma_mm" && gate.value < edges_sigma_mm) continue;
    for (const char* on_axis : {"front_is_blanked", "globe_flattening_mm", "apex_sigma_mm",
                                "axial_length_sigma_mm", "lens_contrast", "lens_off_axis_mm"})
      if (gate.name == on_axis && !gate.passed) return gate.reason;
  }
  return {};
}

void fit_and_judge(JudgedEye& eye, const std::vector<const Stack*>& images, const EyeStart& start,
                   const std::function<void()>& advance) {
  constexpr double reach_mm = 40;
  std::vector<Stack> parts;
  for (std::size_t v = 0; v < images.size(); ++v)
    parts.push_back(canonical_part(*images[v], start.in_stack(v).globe_centre, reach_mm));
  std::vector<const Stack*> canonical;
  for (const Stack& part : parts) canonical.push_back(&part);
  try {
    eye.fit = fit_eye(canonical, start, eye.found.weighting, advance, eye.evidence);
    for (std::size_t v = 0; v < images.size(); ++v) eye.fit->stacks[v].stack = images[v];
    eye.gates = judge_quality(eye.found, *eye.fit, eye.main_edges());
  } catch (const Error& error) {
    if (error.status() != ExitStatus::no_result) throw;
    QualityGate fitted;
    fitted.name = "fit";
    fitted.limit = 1;
    fitted.passed = false;
    fitted.reason = error.what();
    eye.gates = {fitted};
  }
}

void compare_fellow_eyes(JudgedEye& od, JudgedEye& os, const std::vector<const Stack*>& stacks,
                         std::optional<double> age_years, Verbosity verbosity) {
  if (!in_the_same_stacks(od, os)) return;
  if (od.rank() != os.rank()) {
    JudgedEye &less = od.rank() < os.rank() ? od : os, &more = od.rank() < os.rank() ? os : od;
    const bool can_improve = !less.fit || !less.fit->front_is_blanked();  // no fellow brings a front back
    if (can_improve) improve(less, more, less.reasons(), stacks, age_years, verbosity);
  }
  if (!od.is_fitted() || !os.is_fitted()) return;
  const std::optional<QualityGate> found = contradiction(od, os);
  if (!found) return;
  const bool od_is_worse = od.fit->chi2_per_voxel > os.fit->chi2_per_voxel;
  JudgedEye &worse = od_is_worse ? od : os, &better = od_is_worse ? os : od;
  if (improve(worse, better, found->reason, stacks, age_years, verbosity) ||
      improve(better, worse, found->reason, stacks, age_years, verbosity))
    return;
  for (JudgedEye* eye : {&od, &os}) eye->gates.push_back(*found);
}

}  // namespace emmetrope::segmentation
