#pragma once
#include <kainjow/mustache.hpp>
#include <string>
#include <vector>

namespace emmetrope::report {

/// Texts as a section of a template: each entry's "text".
kainjow::mustache::data list_of(const std::vector<std::string>& texts);

/// \throw Error (fault) for a template that is broken
std::string render_template(const char* page_template, const kainjow::mustache::data& page);

}  // namespace emmetrope::report
