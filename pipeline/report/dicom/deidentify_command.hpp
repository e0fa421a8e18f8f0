#pragma once
#include "pipeline/base/command_line.hpp"

namespace emmetrope::report {

/// `emmetrope deidentify`: a case's DICOM objects by the Basic Application Level Confidentiality Profile.
Command deidentify_command();

}  // namespace emmetrope::report
