#include "pipeline/report/page/html.hpp"

#include <fmt/format.h>

#include "pipeline/base/clean_text.hpp"
#include "pipeline/base/version.hpp"
#include "pipeline/report/document/page_template.hpp"
#include "pipeline/report/figures/encoding.hpp"

namespace emmetrope {
extern const char report_template[];
extern const char report_style[];
extern const char report_script[];
}  // namespace emmetrope

namespace emmetrope::report {
namespace {

using kainjow::mustache::data;

const char* light_name(Light light) {
  switch (light) {
    case Light::green:
      return "green";
    case Light::amber:
      return "amber";
    case Light::red:
      break;
  }
  return "red";
}

data table_data(const Table& table) {
  data result;
  result.set("caption", clean_utf8(table.caption));
  result.set("header", list_of(table.header));
  data rows{data::type::list};
  for (std::size_t i = 0; i < table.rows.size(); ++i) {
    const std::vector<std::string>& row = table.rows[i];
    data cells;
    cells.set("name", clean_utf8(row.front()));
    cells.set("cells", list_of({row.begin() + 1, row.end()}));
    if (i < table.links.size() && !table.links[i].empty()) cells.set("link", clean_utf8(table.links[i]));
    rows.push_back(cells);
  }
  result.set("rows", rows);
  result.set("wide", table.header.size() > 4);
  result.set("folded", table.folded);
  return result;
}

/// The picture itself is markup of our own making and goes in unescaped; all text around it is escaped.
data figure_data(const Figure& figure) {
  data result;
  result.set("id", figure.id);
  result.set("title", clean_utf8(figure.title));
  result.set("caption", clean_utf8(figure.caption));
  result.set("alt", clean_utf8(figure.alt));
  result.set("svg", figure.svg);
  return result;
}

data card_data(const EyeCard& card) {
  data result;
  result.set("eye", card.eye);
  result.set("id", card.id);
  result.set("light", light_name(card.light));
  result.set("verdict", clean_utf8(card.verdict));
  data first{data::type::list}, rest{data::type::list};
  for (const Finding& finding : card.reasons) {
    data one;
    one.set("what", clean_utf8(finding.what));
    one.set("to_do", clean_utf8(finding.to_do));
    (first.list_value().size() < most_findings ? first : rest).push_back(one);
  }
  const std::size_t folded = rest.list_value().size();
  result.set("reasons", first);
  result.set("has_reasons", !card.reasons.empty());
  result.set("more_reasons", rest);
  result.set("has_more_reasons", folded > 0);
  result.set("more_count", std::to_string(folded));
  result.set("has_headline", !card.headline.empty());
  result.set("headline", clean_utf8(card.headline));
  data facts{data::type::list};
  for (const auto& [name, value] : card.facts) {
    data fact;
    fact.set("name", clean_utf8(name));
    fact.set("value", clean_utf8(value));
    facts.push_back(fact);
  }
  result.set("has_facts", !card.facts.empty());
  result.set("facts", facts);
  result.set("next", clean_utf8(card.next));
  result.set("note", clean_utf8(card.note));
  result.set("has_details", !card.details.rows.empty());
  result.set("details", table_data(card.details));
  result.set("has_pictures", !card.before_png.empty() && !card.after_png.empty());
  result.set("before", png_url(card.before_png));
  result.set("after", png_url(card.after_png));
  result.set("picture_caption", clean_utf8(card.picture_caption));
  return result;
}

/// One entry with exactly one of the block kinds set; the template picks by kind.
struct BlockToData {
  data operator()(const Paragraph& block) const { return kind("paragraph", "text", clean_utf8(block.text)); }
  data operator()(const BulletList& block) const {
    data result = kind("list", "items", list_of(block.items));
    result.set("small", block.small);
    return result;
  }
  data operator()(const Table& block) const { return kind("table", "table", table_data(block)); }
  data operator()(const FigureRow& block) const {
    data figures{data::type::list};
    for (const auto& figure : block.figures) figures.push_back(figure_data(figure));
    data result = kind("figures", "figures", figures);
    result.set("anatomical", block.anatomical);
    result.set("row_caption", clean_utf8(block.caption));
    result.set("row_folded", clean_utf8(block.folded));
    result.set("is_folded_row", !block.folded.empty());
    return result;
  }
  data operator()(const Folded& block) const {
    data result = kind("folded", "summary", clean_utf8(block.summary));
    std::string lines;  // line breaks stay: this is preformatted text
    std::size_t start = 0;
    for (auto end = block.text.find('\n'); end != std::string::npos; end = block.text.find('\n', start)) {
      lines += clean_utf8(block.text.substr(start, end - start)) + "\n";
      start = end + 1;
    }
    result.set("text", lines + clean_utf8(block.text.substr(start)));
    return result;
  }
  data operator()(const SignatureLines& block) const {
    return kind("lines", "labels", list_of(block.labels));
  }
  data operator()(const EyeCards& block) const {
    data cards{data::type::list};
    for (const auto& card : block.cards) cards.push_back(card_data(card));
    return kind("cards", "cards", cards);
  }

 private:
  static data kind(const char* name, const char* key, const data& value) {
    data result;
    for (const char* other : {"paragraph", "list", "table", "figures", "folded", "cards", "lines"})
      result.set(std::string("is_") + other, std::string(other) == name);
    result.set("anatomical", false);
    result.set("is_folded_row", false);
    result.set(key, value);
    return result;
  }
};

}  // namespace

std::string render_html(const Document& document, const ViewerData& viewer, const LivingPanel& living) {
  data page;
  page.set("title", clean_utf8(document.title));
  page.set("notice", research_notice);
  page.set("style", report_style + living.style);
  page.set("script", report_script);
  page.set("has_viewer", !viewer.script.empty());
  page.set("viewer_script", viewer.script);
  page.set("viewer_data", viewer.data_json);
  page.set("viewer_note", clean_utf8(viewer.note));
  page.set("has_living", !living.markup.empty());
  page.set("living_panel", living.markup);
  page.set("living_scripts", living.scripts);
  page.set("living_notes", list_of(living.notes));
  data heading{data::type::list};
  for (const auto& [name, value] : document.heading) {
    data line;
    line.set("name", clean_utf8(name));
    line.set("value", clean_utf8(value));
    heading.push_back(line);
  }
  page.set("heading", heading);
  data sections{data::type::list};
  for (const auto& section : document.sections) {
    data entry;
    entry.set("id", section.id);
    entry.set("section_title", clean_utf8(section.title));
    entry.set("living_follows", section.id == "result" && (!living.markup.empty() || !living.notes.empty()));
    entry.set("viewer_here", !viewer.script.empty() && section.id == "images");
    entry.set("viewer_missing", viewer.script.empty() && !viewer.note.empty() && section.id == "images");
    data blocks{data::type::list};
    for (const auto& block : section.blocks) blocks.push_back(std::visit(BlockToData{}, block.block));
    entry.set("blocks", blocks);
    sections.push_back(entry);
  }
  page.set("sections", sections);
  return render_template(report_template, page);
}

}  // namespace emmetrope::report
