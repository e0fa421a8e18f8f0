#pragma once
#include <optional>
#include <vector>

#include "segmentation/finding/find_eyes.hpp"

namespace emmetrope::segmentation {

/// What two stacks of a head have in common, in bits of mutual information (Wells et al. 1996), within the face and the
/// front of the brain: as their headers say, and with one of them mirrored about the plane between its eyes.
struct CommonInformation {
  double as_told = 0, mirrored = 0;
};

/// Where the globes lie in a stack, LPS.
struct GlobePair {
  Eigen::Vector3d right, left;
};

/// By the globes the second stack is moved onto the first. Nothing where the two have too little of the head in common.
std::optional<CommonInformation> common_information(const Stack& one, const GlobePair& globes_of_one,
                                                    const Stack& other, const GlobePair& globes_of_other);

/// A volume that a program stored from left to right shows each eye in the other's place, and no tag tells. Two of one head
/// tell on each other, since no head is its mirror image.
/// \throw Error (input_invalid) naming two stacks that have more in common if one of them is mirrored
void require_no_mirrored_stack(const FoundEyes& found, const std::vector<const Stack*>& stacks);

}  // namespace emmetrope::segmentation
