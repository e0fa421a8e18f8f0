#pragma once
#include <Eigen/Core>
#include <map>
#include <vector>

#include "segmentation/intake/volume.hpp"

namespace emmetrope::segmentation {

/// What a stack shows in the middle of a globe, where nothing is but vitreous.
struct VitreousNoise {
  double relative = 0;      ///< standard deviation about a quadratic of place, over the mean
  double correlation = 0;   ///< multiple one, of that with what other stacks show there
  std::size_t nearest = 0;  ///< of the others, the one that it correlates with most
};

/// Compares a stack with others at the stack's own voxels. Acquisitions have different noise, whatever anatomy they
/// share; one that was filtered, corrected for the coil, cut along other planes or averaged with others keeps its own.
/// \param globes  their centres, LPS
VitreousNoise compare_noise(const Stack& stack, const std::vector<const Stack*>& others,
                            const std::vector<Eigen::Vector3d>& globes);

/// A stack that was chosen to be compared, and the globes that it shows.
struct StackOfGlobes {
  const Stack* stack;
  std::vector<Eigen::Vector3d> globes;
};

/// Which of these stacks hold nothing that others of them do not, each with the one that it is most like. They count for
/// nothing beside the others. Of stacks that are one acquisition those that show most eyes stay, and of these the
/// noisiest: others were smoothed or averaged, and look better than they are. Nothing is told where no image has noise.
std::map<std::size_t, std::size_t> find_stored_again(const std::vector<StackOfGlobes>& stacks);

}  // namespace emmetrope::segmentation
