#pragma once
#include <string>

#include "pipeline/report/living/living_data.hpp"

namespace emmetrope::report {

/// The panel in which eyes look out of the page: its markup, style and scripts, self-contained.
struct LivingPanel {
  std::string markup, style;
  std::string scripts;  ///< elements of HTML, for the end of the body; the data among them
};

/// \param eyes  living_json() of each
LivingPanel make_living_panel(const std::vector<Json>& eyes);

/// A page of the panel alone.
/// \param notes  what the reader has to know of these eyes
std::string render_living_page(const std::string& title, const LivingPanel& panel,
                               const std::vector<std::string>& notes);

}  // namespace emmetrope::report
