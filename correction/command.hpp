#pragma once
#include "pipeline/base/command_line.hpp"

namespace emmetrope::correction {

/// `emmetrope correct`: its options, as settings of the stage.
Command command();

}  // namespace emmetrope::correction
