#pragma once
#include "pipeline/base/command_line.hpp"

namespace emmetrope::driver {

/// Checks what the commands need on this machine: OpenCL device and kernel cache, disk space, fonts, helper
/// programs, dictionary of DICOM tags, and that all commands are there. Each failed check names its remedy.
/// Status: done when all that is needed is there (a missing optional tool is only said), else the status that
/// the commands would end with: no_device, not_writable or fault.
Answer examine_machine(const CommonOptions& common);

}  // namespace emmetrope::driver
