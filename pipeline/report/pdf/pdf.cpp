#include "pipeline/report/pdf/pdf.hpp"

#include <cairo-pdf.h>

#include <algorithm>
#include <memory>
#include <set>

#include "pipeline/base/error.hpp"
#include "pipeline/base/version.hpp"
#include "pipeline/report/pdf/pdf_blocks.hpp"
#include "pipeline/report/pdf/pdf_pages.hpp"

namespace emmetrope::report {
namespace {

constexpr int usual_pages = 4;

struct DestroySurface {
  void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
};
struct DestroyContext {
  void operator()(cairo_t* context) const { cairo_destroy(context); }
};

/// What is done to a document so that it fits: smaller figures, then blocks left out.
struct Fit {
  double figure_scale = 1;
  std::set<const SectionBlock*> left_out;
};

void draw_section(pdf::Pages& pages, const Section& section, const Fit& fit) {
  const auto is_here = [&](const SectionBlock& block) {
    return block.paper != Paper::never && fit.left_out.count(&block) == 0;
  };
  const auto first = std::find_if(section.blocks.begin(), section.blocks.end(), is_here);
  if (first == section.blocks.end()) return;
  pages.need(20 + pdf::least_height(pages, first->block));
  pages.paragraph(section.title, {12, true, pdf::black});
  pages.skip(4);
  for (const auto& block : section.blocks)
    if (is_here(block)) pdf::draw_block(pages, block.block);
  pages.skip(5);
}

int draw(const Document& document, const Fit& fit, cairo_t* context, const pdf::Pass& pass) {
  pdf::Pages pages(document, context, pass);
  for (const auto& section : document.sections) draw_section(pages, section, fit);
  if (!fit.left_out.empty())
    pages.paragraph("For want of room some figures and tables are in the HTML report alone.",
                    {7, false, pdf::soft});
  pages.end();
  return pages.count();
}

cairo_status_t append(void* bytes, const unsigned char* data, unsigned int length) {
  static_cast<std::string*>(bytes)->append(reinterpret_cast<const char*>(data), length);
  return CAIRO_STATUS_SUCCESS;
}

Pdf render(const Document& document, const Fit& fit, bool draws, int total_pages, pdf::TextHeights& heights) {
  Pdf pdf;
  const std::unique_ptr<cairo_surface_t, DestroySurface> surface(
      cairo_pdf_surface_create_for_stream(append, &pdf.bytes, pdf::page_width, pdf::page_height));
  // Without a date of its own Cairo writes the present time.
  const std::string date = (document.date_iso.empty() ? "2000-01-01" : document.date_iso) + "T00:00:00Z";
  cairo_pdf_surface_set_metadata(surface.get(), CAIRO_PDF_METADATA_CREATE_DATE, date.c_str());
  cairo_pdf_surface_set_metadata(surface.get(), CAIRO_PDF_METADATA_TITLE, document.title.c_str());
  cairo_pdf_surface_set_metadata(surface.get(), CAIRO_PDF_METADATA_SUBJECT, research_notice);
  cairo_pdf_surface_set_metadata(surface.get(), CAIRO_PDF_METADATA_CREATOR,
                                 ("Emmetrope " + version()).c_str());
  {
    const std::unique_ptr<cairo_t, DestroyContext> context(cairo_create(surface.get()));
    pdf.pages = draw(document, fit, context.get(), {heights, draws, total_pages, fit.figure_scale});
    if (cairo_status(context.get()) != CAIRO_STATUS_SUCCESS)
      throw Error(ExitStatus::fault,
                  std::string("cannot draw the PDF: ") + cairo_status_to_string(cairo_status(context.get())));
  }
  cairo_surface_finish(surface.get());
  if (cairo_surface_status(surface.get()) != CAIRO_STATUS_SUCCESS)
    throw Error(ExitStatus::fault, "cannot finish the PDF");
  return pdf;
}

int pages_of(const Document& document, const Fit& fit, pdf::TextHeights& heights) {
  return render(document, fit, false, 0, heights).pages;
}

/// Figures shrink a little; then what may be left out is, the last first, until the rest fits, and what fits
/// after all comes back; only then figures shrink more, charts as long as they can be read. What must stand may need
/// more pages all the same.
Fit fit_within(const Document& document, int most_pages, pdf::TextHeights& heights) {
  Fit fit;
  const auto fits_at = [&](double scale) {
    fit.figure_scale = scale;
    return pages_of(document, fit, heights) <= most_pages;
  };
  if (fits_at(1) || fits_at(0.9)) return fit;
  std::vector<const SectionBlock*> optional;
  for (const auto& section : document.sections)
    for (const auto& block : section.blocks)
      if (block.paper == Paper::if_room || block.paper == Paper::first_if_room) optional.push_back(&block);
  std::stable_partition(optional.begin(), optional.end(),
                        [](const SectionBlock* block) { return block->paper == Paper::first_if_room; });
  bool fits = false;
  for (auto block = optional.rbegin(); block != optional.rend() && !fits; ++block) {
    fit.left_out.insert(*block);
    fits = fits_at(0.9);
  }
  for (const double scale : {0.8, 0.7, 0.6, 0.5}) fits = fits || fits_at(scale);
  for (const auto* block : optional) {
    if (fit.left_out.erase(block) > 0 && pages_of(document, fit, heights) > most_pages)
      fit.left_out.insert(block);
  }
  return fit;
}

/// Where what must stand needs a page more, what may stand fills it.
Fit fit_of(const Document& document, pdf::TextHeights& heights) {
  Fit fit = fit_within(document, usual_pages, heights);
  const int needed = pages_of(document, fit, heights);
  return needed > usual_pages ? fit_within(document, needed, heights) : fit;
}

}  // namespace

Pdf render_pdf(const Document& document) {
  pdf::TextHeights heights;
  const Fit fit = fit_of(document, heights);
  return render(document, fit, true, pages_of(document, fit, heights), heights);
}

}  // namespace emmetrope::report
