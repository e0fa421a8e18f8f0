#pragma once
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "segmentation/judgement/edge_agreement.hpp"
#include "segmentation/judgement/quality.hpp"

namespace emmetrope::segmentation {

/// Another reading of the same images, which explains them about as well, and how probable it is that it is the right one.
struct Rival {
  EyeFit fit;
  double probability;
};

/// One eye, from found to judged.
struct JudgedEye {
  FoundEye found;
  ViewEdges edges;  ///< of its views; empty where labels are the evidence
  std::optional<EyeFit> fit;
  std::vector<QualityGate> gates;
  std::optional<Rival> rival;        ///< with its chamber, or its fellow's, elsewhere (fellow_eye.hpp)
  std::string fitted_again_because;  ///< how, and why its first fit was not taken; empty: it was
  Evidence evidence = Evidence::intensities;
  /// The same eye, fitted to images of the other contrast by itself; one or none.
  std::vector<JudgedEye> in_other_contrast = {};
  bool is_joined = false;  ///< with it: the shape is the joint estimate (two_contrasts.hpp)

  /// Whether the globe of the fit stands, and cornea, chamber and lens, and the cornea's shape too.
  bool is_fitted() const { return fit && !is_withheld(gates, Withholds::fit); }
  bool has_front() const { return is_fitted() && !is_withheld(gates, Withholds::front); }
  bool is_measured() const { return has_front() && !is_withheld(gates, Withholds::cornea); }
  /// How much of the fit stands.
  int rank() const { return is_measured() ? 3 : has_front() ? 2 : is_fitted() ? 1 : 0; }
  /// The edges that stand in for a fit that is withheld.
  bool is_read() const;
  /// Of the best view.
  std::optional<ReadEye> main_edges() const { return edges.empty() ? std::nullopt : edges.front(); }
  /// What they tell, doubted where the fit contradicts; nobody saw how deep a globe is whose numbers along the axis are
  /// withheld.
  EdgeBiometry stated_edges() const;
  /// Why the edges' length, chamber and lens are not told: the fit saw no cornea or no lens; empty: they are.
  std::string edges_on_axis_withheld() const;
  /// "measured", "partial" (some quantities are withheld), or "refused" (all are).
  const char* status() const {
    return is_measured() ? "measured" : is_fitted() || is_read() ? "partial" : "refused";
  }
  /// Why something is withheld, in the user's words.
  std::string reasons() const;
  /// This reading, and that of the other contrast where both are joined: whose images the eye's numbers are of.
  std::vector<const JudgedEye*> readings() const;
};

/// Whether as much is known by a second fit, and it leaves hardly larger residuals: what is right may explain the images
/// a little worse than what is not.
bool is_as_good(const JudgedEye& again, const JudgedEye& eye);

/// Fits the eye that was found to its images, which hold its evidence, and judges it; data that cannot
/// support a fit fail a gate.
void fit_and_judge(JudgedEye& eye, const std::vector<const Stack*>& images, const EyeStart& start,
                   const std::function<void()>& advance = {});

}  // namespace emmetrope::segmentation
