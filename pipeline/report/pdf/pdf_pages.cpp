#include "pipeline/report/pdf/pdf_pages.hpp"

#include <fmt/format.h>
#include <librsvg/rsvg.h>
#include <pango/pangocairo.h>

#include <algorithm>

#include "pipeline/base/clean_text.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/version.hpp"
#include "pipeline/report/figures/encoding.hpp"

namespace emmetrope::report::pdf {
namespace {

struct FreeByGObject {
  void operator()(void* object) const { g_object_unref(object); }
};
using Layout = std::unique_ptr<PangoLayout, FreeByGObject>;
using Svg = std::unique_ptr<RsvgHandle, FreeByGObject>;

/// An option of a command is one word, which Pango would break behind its dashes: "--keratometry".
void keep_options_whole(PangoLayout* layout, const std::string& text) {
  PangoAttrList* attributes = pango_attr_list_new();
  for (std::size_t start = text.find("--"); start != std::string::npos;) {
    const std::size_t end =
        std::min(text.find_first_not_of("-abcdefghijklmnopqrstuvwxyz", start), text.size());
    PangoAttribute* whole = pango_attr_allow_breaks_new(FALSE);
    whole->start_index = static_cast<guint>(start);
    whole->end_index = static_cast<guint>(end);
    pango_attr_list_insert(attributes, whole);
    start = text.find("--", end);
  }
  pango_layout_set_attributes(layout, attributes);
  pango_attr_list_unref(attributes);
}

Layout layout_of(cairo_t* context, const std::string& text, double width, const Face& face) {
  Layout layout(pango_cairo_create_layout(context));
  PangoFontDescription* font = pango_font_description_from_string("DejaVu Sans");
  pango_font_description_set_absolute_size(font, face.size * PANGO_SCALE);
  if (face.bold) pango_font_description_set_weight(font, PANGO_WEIGHT_BOLD);
  pango_layout_set_font_description(layout.get(), font);
  pango_font_description_free(font);
  pango_layout_set_width(layout.get(), static_cast<int>(width * PANGO_SCALE));
  pango_layout_set_wrap(layout.get(), PANGO_WRAP_WORD_CHAR);
  const std::string clean = clean_utf8(text);
  pango_layout_set_text(layout.get(), clean.c_str(), static_cast<int>(clean.size()));
  keep_options_whole(layout.get(), clean);
  return layout;
}

double height_of(const Layout& layout) {
  int height = 0;
  pango_layout_get_size(layout.get(), nullptr, &height);
  return static_cast<double>(height) / PANGO_SCALE;
}

Error svg_fault(GError* fault) {
  const std::string message = fault->message;
  g_error_free(fault);
  return Error(ExitStatus::fault, "a figure of the report cannot be drawn: " + message);
}

}  // namespace

Pages::Pages(const Document& document, cairo_t* context, const Pass& pass)
    : document_(document), context_(context), pass_(pass) {
  begin_page();
}

void Pages::new_page() {
  end();
  begin_page();
}

void Pages::need(double height) {
  if (y_ + height > bottom && !is_fresh()) new_page();
}

double Pages::text_height(const std::string& text, double width, const Face& face) const {
  const auto [known, is_new] = pass_.heights.try_emplace({text, width, face.size, face.bold}, 0);
  if (is_new) known->second = height_of(layout_of(context_, text, width, face));
  return known->second;
}

double Pages::text_at(const std::string& text, double x, double y, double width, const Face& face) {
  if (!pass_.draws) return text_height(text, width, face);
  const Layout layout = layout_of(context_, text, width, face);
  cairo_set_source_rgb(context_, face.colour.red, face.colour.green, face.colour.blue);
  cairo_move_to(context_, x, y);
  pango_cairo_show_layout(context_, layout.get());
  return height_of(layout);
}

void Pages::paragraph(const std::string& text, const Face& face) {
  need(text_height(text, text_width, face));
  y_ += text_at(text, margin, y_, text_width, face);
}

void Pages::line_at(double x, double y, double width) {
  cairo_set_source_rgb(context_, rule.red, rule.green, rule.blue);
  cairo_set_line_width(context_, 0.5);
  cairo_move_to(context_, x, y);
  cairo_line_to(context_, x + width, y);
  cairo_stroke(context_);
}

void Pages::box_at(double x, double y, double width, double height, const Colour& colour) {
  cairo_set_source_rgb(context_, colour.red, colour.green, colour.blue);
  cairo_rectangle(context_, x, y, width, height);
  cairo_fill(context_);
}

void Pages::svg_at(const std::string& svg, double x, double y, double width, double height) {
  if (!pass_.draws) return;
  GError* fault = nullptr;
  const Svg handle(
      rsvg_handle_new_from_data(reinterpret_cast<const guint8*>(svg.data()), svg.size(), &fault));
  if (!handle) throw svg_fault(fault);
  const RsvgRectangle place{x, y, width, height};
  if (rsvg_handle_render_document(handle.get(), context_, &place, &fault) == 0) throw svg_fault(fault);
}

void Pages::begin_page() {
  ++page_;
  std::string heading = document_.title;
  for (const auto& [name, value] : document_.heading)
    if (name != "Software") heading += fmt::format("   {}: {}", name, value);
  text_at(research_notice, margin, 15, text_width, {8, true, black});
  text_at(heading, margin, 28, text_width, {8, true, soft});
  line_at(margin, 42, text_width);
  y_ = top;
}

void Pages::end() {
  line_at(margin, page_height - 40, text_width);
  const std::string number =
      pass_.total_pages > 0 ? fmt::format("{} / {}", page_, pass_.total_pages) : fmt::format("{}", page_);
  text_at(number, page_width - margin - 40, page_height - 35, 40, {7.5, false, soft});
  cairo_show_page(context_);
}

}  // namespace emmetrope::report::pdf
