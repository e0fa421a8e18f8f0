#pragma once
#include "pipeline/report/case/case_data.hpp"
#include "pipeline/report/content/content.hpp"
#include "pipeline/report/page/html.hpp"

namespace emmetrope::report {

/// Whether the viewer's volume holds what lies further forward (in the scanner's frame) than the eyes' centres, beside the
/// eyes and their lids: nose, brow, the front of the cheeks.
enum class Face { shown, taken_off };

/// What the interactive viewer shows: the orbits' part of the stacks, 8 bits, with their labels and the
/// surfaces. Where that is more than the page has room for, every second, third or fourth voxel of the slices
/// is kept, then the last stacks are left out, then the viewer. Empty where this build has no viewer or the
/// case nothing to show; `note` says what is missing.
/// \param most_bytes  room in the page
/// \param face  by whose surface somebody may be known again
ViewerData make_viewer_data(const CaseData& data, std::size_t most_bytes, Face face = Face::shown);

/// Whether the viewer library was there when this program was built.
bool has_viewer_library();

}  // namespace emmetrope::report
