#pragma once
#include <Eigen/Core>
#include <vector>

#include "segmentation/fit/observation.hpp"

namespace emmetrope::segmentation {

/// Where the first pass starts. What the finder takes for the globe is the strongest edge: the inner side of
/// the wall, but in T1 maybe its outer side, against fat; and where bright fat is displaced over the wall, a
/// fit that starts without takes it for the wall. There the lens may be misplaced too (EyeStart's other
/// axis). Parameter vectors by axis, the likeliest first: T2 and labels have one.
std::vector<std::vector<Eigen::VectorXd>> globe_starts(const ForwardModel& model,
                                                       const std::vector<const Stack*>& stacks,
                                                       const EyeStart& start, Weighting weighting,
                                                       Evidence evidence);

}  // namespace emmetrope::segmentation
