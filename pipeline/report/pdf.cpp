#include "pipeline/report/pdf.hpp"

#include <cairo-pdf.h>
#include <fmt/format.h>
#include <librsvg/rsvg.h>
#include <pango/pangocairo.h>

#include <algorithm>
#include <memory>
#include <sstream>

#include "pipeline/base/error.hpp"
#include "pipeline/base/version.hpp"
#include "pipeline/report/encoding.hpp"

namespace emmetrope::report {
namespace {

// A4 in points.
constexpr double page_width = 595.28, page_height = 841.89, margin = 40;
constexpr double text_width = page_width - 2 * margin, top = 56, bottom = page_height - 48;
constexpr double figure_gap = 8;

struct FreeByGObject {
  void operator()(void* object) const { g_object_unref(object); }
};
using Layout = std::unique_ptr<PangoLayout, FreeByGObject>;
using Svg = std::unique_ptr<RsvgHandle, FreeByGObject>;
struct DestroySurface {
  void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
};
struct DestroyContext {
  void operator()(cairo_t* context) const { cairo_destroy(context); }
};

struct Colour {
  double red, green, blue;
};
constexpr Colour black{0, 0, 0}, soft{0.28, 0.33, 0.38}, rule{0.78, 0.82, 0.86};

Colour colour_of(Light light) {
  switch (light) {
    case Light::green:
      return {0.106, 0.498, 0.231};
    case Light::amber:
      return {0.85, 0.55, 0.0};
    case Light::red:
      break;
  }
  return {0.70, 0.149, 0.118};
}

struct Face {
  double size = 8.5;
  bool bold = false;
  Colour colour = black;
};

/// Writes text and figures downwards and turns the page when it is full.
class Pages {
 public:
  /// \param total  number of pages for the footer, from a first pass
  Pages(const Document& document, cairo_t* context, int total)
      : document_(document), context_(context), total_(total) {
    begin_page();
  }

  int count() const { return page_; }
  double y() const { return y_; }
  void set_y(double y) { y_ = y; }
  void skip(double height) { y_ += height; }
  double room() const { return bottom - y_; }
  bool is_fresh() const { return y_ <= top + 1; }

  void new_page() {
    end_page();
    begin_page();
  }
  /// Turns the page unless `height` fits.
  void need(double height) {
    if (y_ + height > bottom && !is_fresh()) new_page();
  }
  void end() { end_page(); }

  double text_height(const std::string& text, double width, const Face& face) {
    int height = 0;
    pango_layout_get_size(layout_of(text, width, face).get(), nullptr, &height);
    return static_cast<double>(height) / PANGO_SCALE;
  }

  /// \return its height
  double text_at(const std::string& text, double x, double y, double width, const Face& face) {
    const Layout layout = layout_of(text, width, face);
    cairo_set_source_rgb(context_, face.colour.red, face.colour.green, face.colour.blue);
    cairo_move_to(context_, x, y);
    pango_cairo_show_layout(context_, layout.get());
    int height = 0;
    pango_layout_get_size(layout.get(), nullptr, &height);
    return static_cast<double>(height) / PANGO_SCALE;
  }

  void paragraph(const std::string& text, const Face& face, double indent = 0) {
    need(text_height(text, text_width - indent, face));
    y_ += text_at(text, margin + indent, y_, text_width - indent, face);
  }

  void line_at(double x, double y, double width) {
    cairo_set_source_rgb(context_, rule.red, rule.green, rule.blue);
    cairo_set_line_width(context_, 0.5);
    cairo_move_to(context_, x, y);
    cairo_line_to(context_, x + width, y);
    cairo_stroke(context_);
  }

  void box_at(double x, double y, double width, double height, const Colour& colour) {
    cairo_set_source_rgb(context_, colour.red, colour.green, colour.blue);
    cairo_rectangle(context_, x, y, width, height);
    cairo_fill(context_);
  }

  void svg_at(const std::string& svg, double x, double y, double width, double height) {
    GError* fault = nullptr;
    const Svg handle(
        rsvg_handle_new_from_data(reinterpret_cast<const guint8*>(svg.data()), svg.size(), &fault));
    if (!handle) {
      const std::string message = fault->message;
      g_error_free(fault);
      throw Error(ExitStatus::fault, "a figure of the report is no SVG: " + message);
    }
    const RsvgRectangle place{x, y, width, height};
    if (rsvg_handle_render_document(handle.get(), context_, &place, &fault) == 0) {
      const std::string message = fault->message;
      g_error_free(fault);
      throw Error(ExitStatus::fault, "a figure of the report cannot be drawn: " + message);
    }
  }

 private:
  Layout layout_of(const std::string& text, double width, const Face& face) {
    Layout layout(pango_cairo_create_layout(context_));
    PangoFontDescription* font = pango_font_description_from_string("DejaVu Sans");
    pango_font_description_set_absolute_size(font, face.size * PANGO_SCALE);
    if (face.bold) pango_font_description_set_weight(font, PANGO_WEIGHT_BOLD);
    pango_layout_set_font_description(layout.get(), font);
    pango_font_description_free(font);
    pango_layout_set_width(layout.get(), static_cast<int>(width * PANGO_SCALE));
    pango_layout_set_wrap(layout.get(), PANGO_WRAP_WORD_CHAR);
    const std::string clean = clean_text(text);
    pango_layout_set_text(layout.get(), clean.c_str(), static_cast<int>(clean.size()));
    return layout;
  }

  void begin_page() {
    ++page_;
    std::string heading = document_.title;
    for (const auto& [name, value] : document_.heading)
      if (name != "Software") heading += "   " + name + ": " + value;
    text_at(heading, margin, 26, text_width, {8, true, soft});
    line_at(margin, 42, text_width);
    y_ = top;
  }

  void end_page() {
    line_at(margin, page_height - 40, text_width);
    text_at(research_notice, margin, page_height - 35, text_width - 60, {7.5, true, soft});
    text_at(fmt::format("{} / {}", page_, total_), page_width - margin - 40, page_height - 35, 40,
            {7.5, false, soft});
    cairo_show_page(context_);
  }

  const Document& document_;
  cairo_t* context_;
  int total_;
  int page_ = 0;
  double y_ = top;
};

// --- blocks
// ---------------------------------------------------------------------------------------------------------

double cell_width(Pages& pages, const std::string& text, const Face& face) {
  // Width of the widest word group that should stay on one line, estimated from one unwrapped layout.
  double low = 10, high = text_width;
  const double one_line = pages.text_height("X", text_width, face) * 1.5;
  if (pages.text_height(text, high, face) > one_line) return high;
  while (high - low > 2) {
    const double middle = (low + high) / 2;
    (pages.text_height(text, middle, face) > one_line ? low : high) = middle;
  }
  return high;
}

/// Column widths: what the cells need, the first column yields when there is too little room.
std::vector<double> column_widths(Pages& pages, const Table& table, double width, const Face& face) {
  std::vector<double> widths(table.header.size(), 0);
  const Face head{7.5, true, soft};
  for (std::size_t column = 0; column < widths.size();
       ++column) {  // a header may break, but not inside a word
    std::istringstream words(table.header[column]);
    for (std::string word; words >> word;)
      widths[column] = std::max(widths[column], cell_width(pages, word, head) + 8);
  }
  for (std::size_t column = 0; column < widths.size(); ++column)
    for (const auto& row : table.rows)
      if (column < row.size())
        widths[column] = std::max(widths[column], cell_width(pages, row[column], face) + 8);
  double others = 0;
  for (std::size_t column = 1; column < widths.size(); ++column) others += widths[column];
  if (widths[0] + others > width) widths[0] = std::max(80.0, width - others);
  const double total = widths[0] + others;
  if (total > width)
    for (double& w : widths) w *= width / total;
  return widths;
}

void draw_table_at(Pages& pages, const Table& table, double x, double width) {
  const Face body{8, false, black}, head{7.5, true, soft};
  const auto widths = column_widths(pages, table, width, body);
  double total = 0;
  for (const double w : widths) total += w;
  const auto draw_row = [&](const std::vector<std::string>& cells, const Face& face) {
    double height = 0;
    for (std::size_t i = 0; i < cells.size(); ++i)
      height = std::max(height, pages.text_height(cells[i], widths[i] - 6, face));
    pages.need(height + 3);
    double left = x;
    for (std::size_t i = 0; i < cells.size(); ++i) {
      if (!cells[i].empty()) pages.text_at(cells[i], left, pages.y(), widths[i] - 6, face);
      left += widths[i];
    }
    pages.skip(height + 1.5);
    pages.line_at(x, pages.y(), total);
    pages.skip(1.5);
  };
  pages.need(80);  // a caption and a header never stand alone
  pages.skip(pages.text_at(table.caption, x, pages.y(), width, {8.5, true, black}) + 3);
  draw_row(table.header, head);
  for (const auto& row : table.rows) draw_row(row, body);
  pages.skip(7);
}

/// How the figures of a row share the lines of a page.
struct FigureLine {
  std::size_t count = 2;
  double width_of_one = 0;
};

FigureLine figure_line(const FigureRow& row) {
  const std::size_t most = row.figures.front().width_px >= 400 ? 2 : 4;  // charts have small lettering
  const std::size_t count = std::clamp<std::size_t>(row.figures.size(), 2, most);
  return {count, (text_width - figure_gap * static_cast<double>(count - 1)) / static_cast<double>(count)};
}

void draw_figures(Pages& pages, const FigureRow& row) {
  if (row.figures.empty()) return;
  const auto [per_line, width] = figure_line(row);
  for (std::size_t first = 0; first < row.figures.size(); first += per_line) {
    const std::size_t count = std::min(per_line, row.figures.size() - first);
    const Face title{7.5, true, black}, caption{7, false, soft};
    double title_height = 0, picture_height = 0, caption_height = 0;
    for (std::size_t i = first; i < first + count; ++i) {
      const Figure& figure = row.figures[i];
      title_height = std::max(title_height, pages.text_height(figure.title, width, title));
      picture_height = std::max(picture_height, width * figure.height_px / figure.width_px);
      if (!figure.caption.empty())
        caption_height = std::max(caption_height, pages.text_height(figure.caption, width, caption));
    }
    pages.need(title_height + picture_height + caption_height + 8);
    for (std::size_t i = first; i < first + count; ++i) {
      const Figure& figure = row.figures[i];
      const double x = margin + static_cast<double>(i - first) * (width + figure_gap);
      pages.text_at(figure.title, x, pages.y(), width, title);
      pages.svg_at(figure.svg, x, pages.y() + title_height + 2, width,
                   width * figure.height_px / figure.width_px);
      if (!figure.caption.empty())
        pages.text_at(figure.caption, x, pages.y() + title_height + picture_height + 4, width, caption);
    }
    pages.skip(title_height + picture_height + caption_height + 8);
  }
  if (!row.caption.empty()) pages.paragraph(row.caption, {7, false, soft});
  pages.skip(4);
}

std::string picture_svg(const std::string& png) {
  return "<svg xmlns=\"http://www.w3.org/2000/svg\" xmlns:xlink=\"http://www.w3.org/1999/xlink\" viewBox=\"0 "
         "0 100 "
         "100\"><image width=\"100\" height=\"100\" xlink:href=\"" +
         png_url(png) + "\"/></svg>";
}

/// \return the y below the card
double draw_card(Pages& pages, const EyeCard& card, double x, double width) {
  const double inner = width - 12;
  double y = pages.y();
  pages.box_at(x, y, width, 4, colour_of(card.light));
  y += 9;
  y += pages.text_at(card.eye, x, y, inner, {11, true, black}) + 2;
  pages.box_at(x, y + 2, 7, 7, colour_of(card.light));
  y += pages.text_at(card.verdict, x + 11, y, inner - 11, {9, true, colour_of(card.light)}) + 3;
  if (!card.prescription.empty()) {
    y += pages.text_at(card.prescription, x, y, inner, {17, true, black}) + 1;
    y += pages.text_at(card.prescription_note, x, y, inner, {7.5, false, soft}) + 4;
  }
  for (const auto& reason : card.reasons) {
    pages.text_at("\u2022", x, y, 8, {8, false, black});
    y += pages.text_at(reason, x + 8, y, inner - 8, {8, false, black}) + 2;
  }
  if (!card.before_png.empty() && !card.after_png.empty()) {
    const double side = (inner - figure_gap) / 2;
    y += 4;
    pages.text_at("Before", x, y, side, {7.5, true, black});
    y += pages.text_at("After", x + side + figure_gap, y, side, {7.5, true, black}) + 1;
    pages.svg_at(picture_svg(card.before_png), x, y, side, side);
    pages.svg_at(picture_svg(card.after_png), x + side + figure_gap, y, side, side);
    y += side + 3;
    y += pages.text_at(card.picture_caption, x, y, inner, {7, false, soft}) + 4;
  }
  if (!card.details.rows.empty()) {
    pages.set_y(y + 2);
    draw_table_at(pages, card.details, x, inner);
    y = pages.y();
  }
  return y;
}

struct DrawBlock {
  Pages& pages;

  void operator()(const Paragraph& block) const {
    pages.paragraph(block.text, {});
    pages.skip(5);
  }
  void operator()(const BulletList& block) const {
    const Face face{block.small ? 6.5 : 8.0, false, black};
    const double indent = block.small ? 0 : 10;
    for (const auto& item : block.items) {
      const double height = pages.text_height(item, text_width - indent, face);
      pages.need(height);
      if (!block.small) pages.text_at("\u2022", margin, pages.y(), 8, face);
      pages.text_at(item, margin + indent, pages.y(), text_width - indent, face);
      pages.skip(height + (block.small ? 0.5 : 1.5));
    }
    pages.skip(4);
  }
  void operator()(const Table& block) const { draw_table_at(pages, block, margin, text_width); }
  void operator()(const FigureRow& block) const { draw_figures(pages, block); }
  void operator()(const Folded& /*block*/) const {}
  void operator()(const EyeCards& block) const {
    const double width = (text_width - 12) / 2, start = pages.y();
    double lowest = start;
    for (std::size_t i = 0; i < block.cards.size(); ++i) {
      pages.set_y(start);
      lowest = std::max(
          lowest, draw_card(pages, block.cards[i], margin + static_cast<double>(i) * (width + 12), width));
    }
    pages.set_y(lowest + 6);
  }
};

/// What must follow a title on its page.
struct LeastHeight {
  Pages& pages;

  double operator()(const Paragraph& block) const { return pages.text_height(block.text, text_width, {}); }
  double operator()(const FigureRow& block) const { return figure_line(block).width_of_one; }
  double operator()(const EyeCards& /*block*/) const { return 200; }
  double operator()(const Table& /*block*/) const { return 80; }
  double operator()(const BulletList& /*block*/) const { return 30; }
  double operator()(const Folded& /*block*/) const { return 0; }
};

int draw(const Document& document, cairo_t* context, int total) {
  Pages pages(document, context, total);
  for (const auto& section : document.sections) {
    const bool any = std::any_of(section.blocks.begin(), section.blocks.end(),
                                 [](const SectionBlock& block) { return block.in_pdf; });
    if (!any) continue;
    if (section.page_break && !pages.is_fresh()) pages.new_page();
    const auto first = std::find_if(section.blocks.begin(), section.blocks.end(),
                                    [](const SectionBlock& block) { return block.in_pdf; });
    pages.need(20 + std::visit(LeastHeight{pages}, first->block));
    pages.paragraph(section.title, {12, true, black});
    pages.skip(4);
    for (const auto& block : section.blocks)
      if (block.in_pdf) std::visit(DrawBlock{pages}, block.block);
    pages.skip(5);
  }
  pages.end();
  return pages.count();
}

cairo_status_t append(void* bytes, const unsigned char* data, unsigned int length) {
  static_cast<std::string*>(bytes)->append(reinterpret_cast<const char*>(data), length);
  return CAIRO_STATUS_SUCCESS;
}

Pdf render(const Document& document, int total) {
  Pdf pdf;
  const std::unique_ptr<cairo_surface_t, DestroySurface> surface(
      cairo_pdf_surface_create_for_stream(append, &pdf.bytes, page_width, page_height));
  // Without a date of its own Cairo writes the present time.
  const std::string date = (document.date_iso.empty() ? "2000-01-01" : document.date_iso) + "T00:00:00Z";
  cairo_pdf_surface_set_metadata(surface.get(), CAIRO_PDF_METADATA_CREATE_DATE, date.c_str());
  cairo_pdf_surface_set_metadata(surface.get(), CAIRO_PDF_METADATA_TITLE, document.title.c_str());
  cairo_pdf_surface_set_metadata(surface.get(), CAIRO_PDF_METADATA_SUBJECT, research_notice);
  cairo_pdf_surface_set_metadata(surface.get(), CAIRO_PDF_METADATA_CREATOR,
                                 ("Emmetrope " + version()).c_str());
  {
    const std::unique_ptr<cairo_t, DestroyContext> context(cairo_create(surface.get()));
    pdf.pages = draw(document, context.get(), total);
    if (cairo_status(context.get()) != CAIRO_STATUS_SUCCESS)
      throw Error(ExitStatus::fault,
                  std::string("cannot draw the PDF: ") + cairo_status_to_string(cairo_status(context.get())));
  }
  cairo_surface_finish(surface.get());
  if (cairo_surface_status(surface.get()) != CAIRO_STATUS_SUCCESS)
    throw Error(ExitStatus::fault, "cannot finish the PDF");
  return pdf;
}

}  // namespace

Pdf render_pdf(const Document& document) {
  const int pages = render(document, 0).pages;
  return render(document, pages);
}

}  // namespace emmetrope::report
