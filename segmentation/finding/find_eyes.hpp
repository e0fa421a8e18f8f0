#pragma once
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/base/laterality.hpp"
#include "segmentation/finding/eye_candidates.hpp"

namespace emmetrope::segmentation {

/// One stack's view of an eye.
struct EyeView {
  std::size_t stack = 0;  ///< index into the stacks that were searched
  EyeCandidate globe;
  double merit = 0;  ///< (contrast over noise)^2 per mm^3: how much the stack says about the eye's surfaces
};

struct FoundEye {
  Laterality laterality = Laterality::od;
  Weighting weighting = Weighting::t2;
  std::vector<EyeView> views;  ///< chosen for the fit, best first; of one weighting
  std::vector<EyeView> left_out;
  /// Stacks left out as they are the same acquisition as another one (shared_noise.hpp), which stands here.
  std::map<std::size_t, std::size_t> stored_again;
  Eigen::Vector3d axis;                       ///< outward, LPS
  std::optional<Eigen::Vector3d> other_axis;  ///< what else it may be, see LensAxis
  double lens_contrast = 0;
  double radius_mm = 0;

  double merit() const {
    double sum = 0;
    for (const EyeView& view : views) sum += view.merit;
    return sum;
  }
};

/// Why a stack is used or not, for case.json.
struct StackChoice {
  std::size_t stack = 0;
  bool used = false;
  std::string weighting;  ///< "T1", "T2", or empty where no eye is seen
  std::string reason = "no globe of 9 to 15 mm radius seen in it";
};

struct FoundEyes {
  std::vector<FoundEye> eyes;  ///< right first; at most two
  /// Those of them that images of the other contrast show, too, as these do.
  std::vector<FoundEye> in_other_contrast;
  std::vector<FoundEye> by_images;  ///< what was seen where hand-drawn labels took its place
  std::vector<StackChoice> choices;
  std::vector<std::string> notes;
};

/// Finds the eyes in all stacks (one patient frame), pairs them left and right by LPS x, and chooses for each
/// eye the stacks of the weighting that says most about it, and those of the other one.
/// \param laterality_tags  ImageLaterality of each stack ("R", "L" or else), decides where one eye only is
///   seen, within 10 mm of the midline
/// \param asked  decides there without a tag
/// \throw Error (input_invalid) naming the tags, where a stack shows one eye only and its tag says the other; where
///   nothing tells which one it is; naming the orientation, where by it both eyes look elsewhere than ahead
FoundEyes find_eyes(const std::vector<const Stack*>& stacks, const std::vector<std::string>& laterality_tags,
                    std::optional<Laterality> asked = {});

}  // namespace emmetrope::segmentation
