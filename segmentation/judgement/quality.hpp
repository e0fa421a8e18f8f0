#pragma once
#include <string>
#include <vector>

#include "pipeline/base/json.hpp"
#include "segmentation/fit/eye_fit.hpp"

namespace emmetrope::segmentation {

/// What a failed gate takes from an eye's results.
enum class Withholds {
  nothing,  ///< a warning
  cornea,   ///< its shape, and all that light does
  front,    ///< cornea, chamber and lens, and what is measured from them; the back of the globe stands
  fit,      ///< everything that was fitted
};
const char* to_string(Withholds withholds);

/// One gate: a number against its limit.
struct QualityGate {
  std::string name;
  double value = 0, limit = 0;
  bool passed = true;
  Withholds withholds = Withholds::fit;
  std::string reason;  ///< why it failed, in the user's words; empty when passed
};

/// Judges a fit: globe inside the stack, lens and cornea seen, lengths determined, residuals explained,
/// shapes of an eye, the edges of an independent reading where that is sure of them. Of an eye whose front was blanked
/// the globe alone.
std::vector<QualityGate> judge_quality(const FoundEye& found, const EyeFit& fit,
                                       const std::optional<ReadEye>& edges);
/// Where no fit came to an end: the reason, and what is told of the images without one.
/// \param globe_centres_lps  in each of the stacks
std::vector<QualityGate> judge_without_fit(const std::string& reason, const std::vector<const Stack*>& stacks,
                                           const std::vector<Eigen::Vector3d>& globe_centres_lps);
/// A fit to labels beside the edges of the image that they were drawn on: labels stand, as somebody drew them who may
/// have known better, but not without a word.
/// \param seen   the eye as it was found in the images
/// \param edges  of it, in the image that was drawn on; none: its centre tells
QualityGate judge_labels(const EyeFit& drawn, const FoundEye& seen, const std::optional<ReadEye>& edges);
/// Whether a gate failed that withholds this; and the reasons of those, once each.
bool is_withheld(const std::vector<QualityGate>& gates, Withholds what);
std::string reasons_for(const std::vector<QualityGate>& gates, Withholds what);
Json to_json(const QualityGate& gate);

}  // namespace emmetrope::segmentation
