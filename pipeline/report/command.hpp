#pragma once
#include "pipeline/base/command_line.hpp"

namespace emmetrope::report {

/// `emmetrope report`: its options, as settings of the stage.
Command command();

}  // namespace emmetrope::report
