#include "segmentation/judgement/judged_eye.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/eye/population/limits.hpp"
#include "segmentation/fit/intraocular_mass.hpp"
#include "segmentation/intake/canonical_stack.hpp"

namespace emmetrope::segmentation {
namespace {

/// Whether a globe is so much wider than deep that no eye is, beyond two standard deviations.
bool is_flattened(const EdgeBiometry& globe) {
  const Estimate& widest =
      globe.globe_width.value > globe.globe_height.value ? globe.globe_width : globe.globe_height;
  return widest.value - globe.globe_depth.value - 2 * std::hypot(widest.sigma, globe.globe_depth.sigma) >
         limits_of("globe_flattening_mm").accepted.high;
}

const QualityGate* failed_gate(const std::vector<QualityGate>& gates, const std::string& name) {
  const auto gate = std::find_if(gates.begin(), gates.end(),
                                 [&](const QualityGate& g) { return g.name == name && !g.passed; });
  return gate == gates.end() ? nullptr : &*gate;
}

/// \param stacks  about the eye, in canonical order, of `images`
void fit_once(JudgedEye& eye, const std::vector<const Stack*>& images,
              const std::vector<const Stack*>& stacks, const EyeStart& start,
              const std::function<void()>& advance) {
  try {
    eye.fit = fit_eye_beside_mass(stacks, start, eye.found.weighting, advance, eye.evidence);
    for (std::size_t v = 0; v < images.size(); ++v) {
      eye.fit->stacks[v].stack = images[v];
      eye.fit->stacks[v].left_out = {};  // of the voxels in their canonical order
    }
    eye.gates = judge_quality(eye.found, *eye.fit, eye.main_edges());
  } catch (const Error& error) {
    if (error.status() != ExitStatus::no_result) throw;
    std::vector<Eigen::Vector3d> centres;
    for (std::size_t v = 0; v < stacks.size(); ++v) centres.push_back(start.in_stack(v).globe_centre);
    eye.gates = judge_without_fit(
        error.what(), eye.evidence == Evidence::labels ? std::vector<const Stack*>() : images, centres);
  }
}

}  // namespace

bool is_as_good(const JudgedEye& again, const JudgedEye& eye) {
  constexpr double hardly = 1.15;  // chosen: wrong second fits of real heads left 1.5 to 2.3 times as much
  return again.is_fitted() && again.rank() >= eye.rank() &&
         (!eye.fit || again.fit->chi2_per_voxel <= hardly * eye.fit->chi2_per_voxel);
}

bool JudgedEye::is_read() const {
  // Edges of a globe whose vitreous was clipped lie too far out.
  return !is_fitted() && main_edges() && failed_gate(gates, "clipped_vitreous") == nullptr;
}

std::string JudgedEye::reasons() const {
  std::string text;
  for (const Withholds what : {Withholds::fit, Withholds::front, Withholds::cornea})
    if (const std::string reasons = reasons_for(gates, what); !reasons.empty())
      text += (text.empty() ? "" : "; ") + reasons;
  return text;
}

std::vector<const JudgedEye*> JudgedEye::readings() const {
  std::vector<const JudgedEye*> readings{this};
  if (is_joined) readings.push_back(&in_other_contrast.front());
  return readings;
}

EdgeBiometry JudgedEye::stated_edges() const {
  const ReadEye read = *main_edges();
  if (!fit || is_fitted()) return read.biometry;
  EdgeBiometry stated = with_doubt(read, *fit);
  if (read.reading.axial && !edges_on_axis_withheld().empty())
    stated.globe_depth.sigma = std::hypot(stated.globe_depth.sigma, depth_sigma_without_front_mm);
  return stated;
}

std::string JudgedEye::edges_on_axis_withheld() const {
  if (edges.empty() || !edges.front() || !edges.front()->biometry.axial_length)
    return "cornea or lens have no edges of their own along the eye's axis";
  const EdgeBiometry& read = edges.front()->biometry;
  const double edges_sigma_mm = read.axial_length->sigma;
  if (read.anterior_chamber_depth &&
      !limits_of("edge_chamber_mm").accepted.contains(read.anterior_chamber_depth->value))
    return fmt::format(
        "by edges the chamber would be {:.1f} mm deep: what was taken for the cornea may be the lid",
        read.anterior_chamber_depth->value);
  const bool in_thick_slices = failed_gate(gates, "slice_spacing_t1_mm") != nullptr;
  for (const QualityGate& gate : gates) {
    // In slices that thick a fit is no witness: two fits of one eye's lens had a contrast of 0.67 and of -0.09.
    if (in_thick_slices && gate.name != "front_is_blanked" && gate.name != "blanked_before_cornea" &&
        gate.name != "clipped_lens" && gate.name != "globe_flattening_mm")
      continue;
    // A fit that knows the length better than edges claim to does not speak against them.
    if (gate.name == "axial_length_sigma_mm" && gate.value < edges_sigma_mm) continue;
    // A flat fit of a globe that is not flat by its edges was misread.
    if (gate.name == "globe_flattening_mm" && !is_flattened(read)) continue;
    for (const char* on_axis :
         {"front_is_blanked", "blanked_before_cornea", "clipped_lens", "globe_flattening_mm", "apex_sigma_mm",
          "axial_length_sigma_mm", "lens_contrast", "lens_off_axis_mm", "natural_lens_mm",
          "intraocular_mass_mm3", "unexplained_in_vitreous_mm3", "fluid_difference_t2",
          "surroundings_over_vitreous_t2"})
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
  fit_once(eye, images, canonical, start, advance);
}

}  // namespace emmetrope::segmentation
