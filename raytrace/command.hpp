#pragma once
#include "pipeline/base/command_line.hpp"

namespace emmetrope::raytrace {

/// `emmetrope trace`: its options, as settings of the eyes of a case or of one eye by name or file.
Command command();

}  // namespace emmetrope::raytrace
