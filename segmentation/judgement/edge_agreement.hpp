#pragma once
#include <string>

#include "segmentation/edges/edge_biometry.hpp"
#include "segmentation/fit/eye_fit.hpp"

namespace emmetrope::segmentation {

/// The largest difference between a fit and an independent reading of the same eye, in standard deviations of
/// both.
struct EdgeAgreement {
  double sigmas = 0;
  /// The same where the edges may be those of fat in T1: as far outside the fit's inner wall as its wall is
  /// thick and fat is displaced.
  double sigmas_beyond_wall = 0;
  bool with_length = false;  ///< both know it
  std::string largest;       ///< which difference that is, in the user's words

  /// The two say the same: what else speaks against the fit does not mean that its surfaces are elsewhere.
  bool confirms() const;
};

/// Compares centre, width, height and, where both know it, length.
EdgeAgreement compare_with_edges(const EyeFit& fit, const ReadEye& edges);

/// The largest difference between labels that were drawn on an image and its edges.
struct LabelsBesideEdges {
  double over_ci95 = 0;  ///< half the 95 % interval of such a difference, by the intervals of both
  std::string largest;   ///< as EdgeAgreement's
};
/// \param drawn  the fit to the labels
LabelsBesideEdges compare_labels_with_edges(const EyeFit& drawn, const ReadEye& edges);

/// The edges of an eye whose fit, a globe at the same place, has its borders elsewhere: which of the two took the
/// edge of displaced fat for the wall is not known, and the intervals reach to both.
EdgeBiometry with_doubt(const ReadEye& edges, const EyeFit& fit);

}  // namespace emmetrope::segmentation
