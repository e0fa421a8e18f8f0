#pragma once
#include <cairo.h>

#include <map>
#include <memory>
#include <string>
#include <tuple>

#include "pipeline/report/document/document.hpp"

/// The pages of the PDF: text, lines and pictures at places in points from the upper left. For the pdf_*.cpp
/// files only.
namespace emmetrope::report::pdf {

// A4.
inline constexpr double page_width = 595.28, page_height = 841.89, margin = 40;
inline constexpr double text_width = page_width - 2 * margin, top = 56, bottom = page_height - 48;

struct Colour {
  double red, green, blue;
};
inline constexpr Colour black{0, 0, 0}, soft{0.28, 0.33, 0.38}, rule{0.78, 0.82, 0.86};

struct Face {
  double size = 8.5;
  bool bold = false;
  Colour colour = black;
};

/// Heights of texts by text, width, size and weight: setting a text takes most of the time, and a document is set a dozen
/// times until it fits its pages.
using TextHeights = std::map<std::tuple<std::string, double, double, bool>, double>;

/// What one pass over the pages does.
struct Pass {
  TextHeights& heights;     ///< of the passes before, and for those to come
  bool draws = true;        ///< a pass that only measures does not
  int total_pages = 0;      ///< for the footer
  double figure_scale = 1;  ///< of what figures would fill
};

/// Writes text and figures downwards and turns the page when it is full.
class Pages {
 public:
  Pages(const Document& document, cairo_t* context, const Pass& pass);

  int count() const { return page_; }
  double figure_scale() const { return pass_.figure_scale; }
  double y() const { return y_; }
  void set_y(double y) { y_ = y; }
  void skip(double height) { y_ += height; }
  void new_page();
  /// Turns the page unless `height` fits.
  void need(double height);
  /// Writes the last page's footer.
  void end();
  bool is_fresh() const { return y_ <= top + 1; }

  double text_height(const std::string& text, double width, const Face& face) const;
  /// \return its height
  double text_at(const std::string& text, double x, double y, double width, const Face& face);
  void paragraph(const std::string& text, const Face& face);
  void line_at(double x, double y, double width);
  void box_at(double x, double y, double width, double height, const Colour& colour);
  /// \throw Error (fault) when the figure is no SVG
  void svg_at(const std::string& svg, double x, double y, double width, double height);

 private:
  void begin_page();

  const Document& document_;
  cairo_t* context_;
  Pass pass_;
  int page_ = 0;
  double y_ = top;
};

}  // namespace emmetrope::report::pdf
