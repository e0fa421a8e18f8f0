#pragma once
#include <string>

#include "pipeline/report/document/document.hpp"
#include "pipeline/report/living/living_panel.hpp"

namespace emmetrope::report {

/// What the reader may turn and scroll in the page; empty without it.
struct ViewerData {
  std::string script;     ///< the viewer library
  std::string data_json;  ///< volumes and meshes as base64
  std::string note;       ///< what was coarsened or left out to keep the page small; empty where nothing was
};

/// What mail and archives still take (bytes).
inline constexpr std::size_t most_page_bytes = 10'000'000;

/// The document as one self-contained HTML file.
/// \param living  the eyes that look out of it; no markup where none does
std::string render_html(const Document& document, const ViewerData& viewer, const LivingPanel& living);

}  // namespace emmetrope::report
