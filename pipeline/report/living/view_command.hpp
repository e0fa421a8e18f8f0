#pragma once
#include "pipeline/base/command_line.hpp"

namespace emmetrope::report {

/// `emmetrope view`: the page in which an eye looks at charts and scenes.
Command view_command();

}  // namespace emmetrope::report
