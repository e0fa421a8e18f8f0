#include "pipeline/report/document/page_template.hpp"

#include "pipeline/base/clean_text.hpp"
#include "pipeline/base/error.hpp"

namespace emmetrope::report {

using kainjow::mustache::data;

data list_of(const std::vector<std::string>& texts) {
  data list{data::type::list};
  for (const auto& text : texts) {
    data item;
    item.set("text", clean_utf8(text));
    list.push_back(item);
  }
  return list;
}

std::string render_template(const char* page_template, const data& page) {
  kainjow::mustache::mustache parsed{std::string(page_template)};
  if (!parsed.is_valid())
    throw Error(ExitStatus::fault, "a page's template is broken: " + parsed.error_message());
  return parsed.render(page);
}

}  // namespace emmetrope::report
