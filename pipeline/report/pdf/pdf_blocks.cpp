#include "pipeline/report/pdf/pdf_blocks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <sstream>

#include "pipeline/report/figures/encoding.hpp"

namespace emmetrope::report::pdf {
namespace {

constexpr double figure_gap = 8;
constexpr std::size_t most_items = 8;  ///< of a list; the HTML page has all

Colour colour_of(Light light) {
  switch (light) {
    case Light::green:
      return {0.106, 0.498, 0.231};
    case Light::amber:
      return {0.72, 0.45, 0.0};
    case Light::red:
      break;
  }
  return {0.70, 0.149, 0.118};
}

/// The first of a list's items, and how many more there are.
std::vector<std::string> first_of(const std::vector<std::string>& items, std::size_t most) {
  if (items.size() <= most) return items;
  std::vector<std::string> first(items.begin(), items.begin() + static_cast<std::ptrdiff_t>(most));
  first.push_back(fmt::format("{} more are in the HTML report.", items.size() - most));
  return first;
}

double cell_width(const Pages& pages, const std::string& text, const Face& face) {
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
std::vector<double> column_widths(const Pages& pages, const Table& table, double width, const Face& face) {
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
  // Then the widest yields, as a sentence breaks better than a number.
  const double excess = widths[0] + others - width;
  auto widest = std::max_element(widths.begin(), widths.end());
  if (excess > 0) *widest = std::max(*widest - excess, 80.0);
  const double total = std::accumulate(widths.begin(), widths.end(), 0.0);
  if (total > width)
    for (double& w : widths) w *= width / total;
  return widths;
}

constexpr Face table_body{8, false, black}, table_head{7.5, true, soft};

double row_height(const Pages& pages, const std::vector<std::string>& cells,
                  const std::vector<double>& widths, const Face& face) {
  double height = 0;
  for (std::size_t i = 0; i < cells.size(); ++i)
    height = std::max(height, pages.text_height(cells[i], widths[i] - 6, face));
  return height;
}

/// What of a table stays on one page: a short one whole, of a long one caption, header and some rows.
double least_table_height(const Pages& pages, const Table& table, const std::vector<double>& widths) {
  constexpr std::size_t short_rows = 8;
  if (table.rows.size() > short_rows) return 80;
  double whole = 24 + row_height(pages, table.header, widths, table_head);
  for (const auto& row : table.rows) whole += row_height(pages, row, widths, table_body) + 3;
  return whole;
}

void draw_table_at(Pages& pages, const Table& table, double x, double width) {
  const Face &body = table_body, &head = table_head;
  const auto widths = column_widths(pages, table, width, body);
  double total = 0;
  for (const double w : widths) total += w;
  const auto height_of = [&](const std::vector<std::string>& cells, const Face& face) {
    return row_height(pages, cells, widths, face);
  };
  const auto draw_row = [&](const std::vector<std::string>& cells, const Face& face) {
    double left = x;
    for (std::size_t i = 0; i < cells.size(); ++i) {
      if (!cells[i].empty()) pages.text_at(cells[i], left, pages.y(), widths[i] - 6, face);
      left += widths[i];
    }
    pages.skip(height_of(cells, face) + 1.5);
    pages.line_at(x, pages.y(), total);
    pages.skip(1.5);
  };
  pages.need(least_table_height(pages, table, widths));
  pages.skip(pages.text_at(table.caption, x, pages.y(), width, {8.5, true, black}) + 3);
  draw_row(table.header, head);
  for (const auto& row : table.rows) {
    const int page = pages.count();
    pages.need(height_of(row, body) + 3);
    if (pages.count() != page) draw_row(table.header, head);
    draw_row(row, body);
  }
  pages.skip(7);
}

/// How the figures of a row share the lines of a page.
struct FigureLine {
  std::size_t count = 2;
  double width_of_one = 0;
};

/// Lettering of 11 pixels in a chart 400 wide is 5.6 pt high then.
constexpr double least_chart_scale = 0.8;

FigureLine figure_line(const Pages& pages, const FigureRow& row) {
  const bool is_chart = row.figures.front().width_px >= 400;  // has small lettering
  const std::size_t count = is_chart ? 2 : 4;
  const double share =
      (text_width - figure_gap * static_cast<double>(count - 1)) / static_cast<double>(count);
  return {count,
          share * (is_chart ? std::max(pages.figure_scale(), least_chart_scale) : pages.figure_scale())};
}

void draw_figures(Pages& pages, const FigureRow& row) {
  if (row.figures.empty()) return;
  const auto [per_line, width] = figure_line(pages, row);
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
         "0 100 100\"><image width=\"100\" height=\"100\" xlink:href=\"" +
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
  if (!card.headline.empty()) y += pages.text_at(card.headline, x, y, inner, {13, true, black}) + 1;
  if (!card.note.empty()) y += pages.text_at(card.note, x, y, inner, {7.5, false, soft}) + 4;
  constexpr double name_width = 58;
  pages.text_at("Do next", x, y, name_width, {8, true, black});
  y += pages.text_at(card.next, x + name_width, y, inner - name_width, {8, true, black}) + 1;
  for (const auto& [name, value] : card.facts) {
    pages.text_at(name, x, y, name_width, {8, false, soft});
    y += pages.text_at(value, x + name_width, y, inner - name_width, {8, false, black}) + 1;
  }
  y += 2;
  std::vector<std::string> reasons;
  for (const Finding& finding : card.reasons)
    reasons.push_back(finding.to_do.empty() ? finding.what : finding.what + " \u2192 " + finding.to_do);
  for (const auto& reason : first_of(reasons, most_findings)) {
    pages.text_at("\u2022", x, y, 8, {8, false, black});
    y += pages.text_at(reason, x + 8, y, inner - 8, {8, false, black}) + 2;
  }
  if (!card.before_png.empty() && !card.after_png.empty()) {
    const double side = (inner - figure_gap) / 2 * pages.figure_scale();
    y += 4;
    pages.text_at("Before", x, y, side, {7.5, true, black});
    y += pages.text_at("After", x + side + figure_gap, y, side, {7.5, true, black}) + 1;
    pages.svg_at(picture_svg(card.before_png), x, y, side, side);
    pages.svg_at(picture_svg(card.after_png), x + side + figure_gap, y, side, side);
    y += side + 3;
    y += pages.text_at(card.picture_caption, x, y, inner, {7, false, soft}) + 4;
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
    for (const auto& item : block.small ? block.items : first_of(block.items, most_items)) {
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
  void operator()(const SignatureLines& block) const {
    const Face face{8, false, soft};
    constexpr double pitch = 20, label_width = 140;
    pages.need(pitch * static_cast<double>(block.labels.size()));
    for (const auto& label : block.labels) {
      pages.skip(pitch - 10);
      pages.text_at(label, margin, pages.y(), label_width, face);
      pages.skip(10);
      pages.line_at(margin + label_width, pages.y(), text_width - label_width);
    }
  }
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
  const Pages& pages;

  double operator()(const Paragraph& block) const { return pages.text_height(block.text, text_width, {}); }
  double operator()(const FigureRow& block) const { return figure_line(pages, block).width_of_one; }
  double operator()(const EyeCards& /*block*/) const { return 200; }
  double operator()(const Table& block) const {
    return least_table_height(pages, block, column_widths(pages, block, text_width, table_body));
  }
  double operator()(const BulletList& /*block*/) const { return 30; }
  double operator()(const SignatureLines& block) const {
    return 20 * static_cast<double>(block.labels.size());
  }
  double operator()(const Folded& /*block*/) const { return 0; }
};

}  // namespace

void draw_block(Pages& pages, const Block& block) { std::visit(DrawBlock{pages}, block); }

double least_height(const Pages& pages, const Block& block) { return std::visit(LeastHeight{pages}, block); }

}  // namespace emmetrope::report::pdf
