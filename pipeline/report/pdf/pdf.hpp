#pragma once
#include <string>

#include "pipeline/report/document/document.hpp"

namespace emmetrope::report {

struct Pdf {
  std::string bytes;
  int pages = 0;
};

/// The document as PDF: A4, selectable text, charts as vectors, by Cairo, Pango and librsvg without a
/// display. The same document gives the same bytes: the file is dated by the study, not by the clock.
Pdf render_pdf(const Document& document);

}  // namespace emmetrope::report
