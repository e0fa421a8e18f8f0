#include "pipeline/report/living/living_panel.hpp"

#include <array>

#include "pipeline/base/clean_text.hpp"
#include "pipeline/base/version.hpp"
#include "pipeline/report/document/page_template.hpp"

namespace emmetrope {
extern const char living_panel[], living_style[], living_page[], report_style[];
extern const char living_eye_map[], living_lens[], living_beam[], living_picture[], living_scenes[],
    living_quality[], living_living[], living_controls[], living_numbers[], living_start[], living_plot[],
    living_plot_style[];
}  // namespace emmetrope

namespace emmetrope::report {

LivingPanel make_living_panel(const std::vector<Json>& eyes, std::vector<std::string> notes) {
  if (eyes.empty()) return {"", "", "", std::move(notes)};
  LivingPanel panel{living_panel, std::string(living_plot_style) + living_style, "", std::move(notes)};
  Json data = living_world_json();
  data["eyes"] = eyes;
  std::string text = data.dump();
  // "</script>" in a name would end the element.
  for (auto at = text.find('<'); at != std::string::npos; at = text.find('<', at + 1))
    text.replace(at, 1, "\\u003c");
  panel.scripts = "<script type=\"application/json\" id=\"living-data\">" + text + "</script>\n";
  for (const char* script :
       {living_plot, living_eye_map, living_lens, living_beam, living_picture, living_scenes, living_quality,
        living_living, living_controls, living_numbers, living_start})
    panel.scripts += "<script>" + std::string(script) + "</script>\n";
  return panel;
}

std::string render_living_page(const std::string& title, const LivingPanel& panel) {
  using kainjow::mustache::data;
  data page;
  page.set("title", clean_utf8(title));
  page.set("notice", research_notice);
  page.set("version", version());
  page.set("style", report_style + panel.style);
  page.set("panel", panel.markup);
  page.set("scripts", panel.scripts);
  page.set("notes", list_of(panel.notes));
  return render_template(living_page, page);
}

}  // namespace emmetrope::report
