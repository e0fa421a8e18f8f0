#pragma once
#include "pipeline/base/command_line.hpp"

namespace emmetrope::segmentation {

/// `emmetrope segment`: its options, as settings of the stage.
Command command();

}  // namespace emmetrope::segmentation
