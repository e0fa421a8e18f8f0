#pragma once
#include "pipeline/base/command_line.hpp"

namespace emmetrope::meshing {

/// `emmetrope mesh`: its options, as settings of the stage.
Command command();

}  // namespace emmetrope::meshing
