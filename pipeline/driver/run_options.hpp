#pragma once
#include "pipeline/driver/run.hpp"

namespace emmetrope::driver {

/// Declares the options of `emmetrope run` on its command line.
void declare(CLI::App& app, RunOptions& options);

}  // namespace emmetrope::driver
