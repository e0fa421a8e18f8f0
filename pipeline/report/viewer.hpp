#pragma once
#include "pipeline/report/case_data.hpp"
#include "pipeline/report/content.hpp"
#include "pipeline/report/html.hpp"

namespace emmetrope::report {

/// What the interactive viewer shows: the orbits' part of the best stacks, 8 bits, with their labels and the
/// surfaces. Empty where this build has no viewer or the case nothing to show.
ViewerData make_viewer_data(const CaseData& data, Notes& notes);

/// Whether the viewer library was there when this program was built.
bool has_viewer_library();

}  // namespace emmetrope::report
