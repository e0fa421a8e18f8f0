#pragma once
#include <Eigen/Core>
#include <optional>
#include <vector>

#include "segmentation/volume.hpp"

namespace emmetrope::segmentation {

/// Contrast class of a stack. T2: vitreous brighter than what surrounds the eye; T1: darker.
enum class Contrast { t1, t2 };
inline const char* to_string(Contrast contrast) { return contrast == Contrast::t1 ? "T1" : "T2"; }

/// A globe seen in one stack.
struct EyeCandidate {
  Eigen::Vector3d centre;  ///< LPS, mm
  double radius_mm = 0;    ///< of the strongest step: the inner wall in T2, the outer one in T1
  Contrast contrast = Contrast::t2;
  /// Share of the directions inside the stack whose edge lies on the sphere (within 1.2 mm)
  double agreement = 0;
  double inside = 0;              ///< share of the directions whose wall lies inside the stack
  double contrast_to_spread = 0;  ///< step across the wall over the vitreous' own spread
  double score() const { return agreement * inside; }
};

/// Globes in a stack, best first: gradients vote for centres 9 to 14 mm along their direction (radial
/// symmetry, Loy and Zelinsky 2003, in three dimensions), both polarities; each maximum is then checked and
/// refined on radial profiles. Several places may be false; pairing and the fit decide.
std::vector<EyeCandidate> find_candidates(const Stack& stack);

/// Direction in which an eye looks, from the lens: darker than vitreous and aqueous in T2, brighter in T1.
/// Searched within 60 degrees of straight ahead.
struct Gaze {
  Eigen::Vector3d axis;  ///< unit, out of the eye, LPS
  /// of the lens against its surroundings, relative to the vitreous (T2) or the surround (T1)
  double lens_contrast = 0;
  /// In T1 the globe was found by the edge of the fat, which chemical shift displaces: the axis if the lens
  /// is up to 2 mm nearer or farther than usual, where that is more than 10 degrees away.
  std::optional<Eigen::Vector3d> other_axis;
};
struct GlobeInStack {
  const Stack* stack = nullptr;
  Eigen::Vector3d centre;
};
Gaze find_gaze(const std::vector<GlobeInStack>& views, double globe_radius_mm, Contrast contrast);

}  // namespace emmetrope::segmentation
