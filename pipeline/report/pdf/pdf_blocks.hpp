#pragma once
#include "pipeline/report/pdf/pdf_pages.hpp"

namespace emmetrope::report::pdf {

/// Draws one block of a section at the place that the pages have reached.
void draw_block(Pages& pages, const Block& block);

/// What of a block must stand on the page of the title above it.
double least_height(const Pages& pages, const Block& block);

}  // namespace emmetrope::report::pdf
