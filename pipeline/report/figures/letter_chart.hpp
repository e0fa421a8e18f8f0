#pragma once
#include <string>
#include <vector>

#include "raytrace/wavefront/wavefront.hpp"

/// A chart of letters as an eye images it: Fourier optics on its point spread function.
namespace emmetrope::report {

/// A square picture of linear intensities, row after row, row 0 at the top, as the patient perceives it.
struct Picture {
  int side = 0;
  double arcmin_per_pixel = 0;
  std::vector<float> values;
};

/// One line of a chart.
struct LetterLine {
  double logmar = 0;
  double letter_arcmin = 0;  ///< height and width of a letter: 5 at logMAR 0
  double middle_arcmin = 0;  ///< its middle below that of the chart
  int letters = 0;
};

/// Lines of up to five Sloan letters, as many as fit into `width_arcmin`, a letter high and 0.6 of it apart.
std::vector<LetterLine> letter_lines(const std::vector<double>& logmar, double width_arcmin);

/// The chart, black on white (1), blurred by the point spread; at least `field_arcmin` wide.
Picture blurred_letters(const raytrace::PointSpread& spread, const std::vector<LetterLine>& lines,
                        double field_arcmin);

/// The middle `shown_arcmin` of a picture as an 8-bit grey PNG, intensities encoded as sRGB, `white` and
/// above as white; dark outside the picture.
std::string grey_png(const Picture& picture, double shown_arcmin, int out_side, double white);

}  // namespace emmetrope::report
