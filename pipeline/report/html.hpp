#pragma once
#include <string>

#include "pipeline/report/document.hpp"

namespace emmetrope::report {

/// What the reader may turn and scroll in the page; empty without it.
struct ViewerData {
  std::string script;     ///< the viewer library
  std::string data_json;  ///< volumes and meshes as base64
};

/// The document as one self-contained HTML file.
std::string render_html(const Document& document, const ViewerData& viewer);

}  // namespace emmetrope::report
