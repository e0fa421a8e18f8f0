#pragma once
#include <string>

#include "pipeline/report/living/living_data.hpp"

namespace emmetrope::report {

/// The panel in which eyes look out of the page: its markup, style and scripts, self-contained.
struct LivingPanel {
  std::string markup, style;
  std::string scripts;  ///< elements of HTML, for the end of the body; the data among them
  /// What the reader has to know of these eyes: how near the maps come, why one is missing.
  std::vector<std::string> notes;
};

/// \param eyes  living_json() of each; without any only the notes are there
LivingPanel make_living_panel(const std::vector<Json>& eyes, std::vector<std::string> notes);

/// A page of the panel alone.
std::string render_living_page(const std::string& title, const LivingPanel& panel);

}  // namespace emmetrope::report
