#pragma once
#include "pipeline/base/command_line.hpp"

namespace emmetrope::raytrace {

/// `emmetrope trace`: the eyes of a case, or one eye by name or file.
Command trace_command();

}  // namespace emmetrope::raytrace
