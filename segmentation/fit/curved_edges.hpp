#pragma once
#include <Eigen/Core>
#include <vector>

#include "segmentation/fit/observation.hpp"

namespace emmetrope::segmentation {

/// Sets Sample::curved of the rear's samples: what the image of the eye at these parameters, drawn on a fine
/// grid and cut in k-space as the scanner cuts it, has beyond the planar edges of ForwardModel. A border that
/// bends within a few voxels rings otherwise than a plane does, and the rings of one side of the globe cross
/// the other: 0.01 of fat's signal where voxels are 1 mm large. Around the globe lies what the model has
/// there; nothing is known of borders farther away. Stacks with pixels below 0.6 mm are left as they are, and
/// so are the front's samples: what lies before the eye, lashes, fissure and skin, is known too roughly to be
/// drawn.
void add_curved_edges(std::vector<Sample>& samples, const ForwardModel& model,
                      const Eigen::VectorXd& parameters, const std::vector<ObservedStack>& stacks);

}  // namespace emmetrope::segmentation
