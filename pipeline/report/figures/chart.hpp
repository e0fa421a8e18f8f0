#pragma once
#include <optional>
#include <string>

#include "pipeline/report/document/document.hpp"

/// Charts as SVG by gnuplot. Black becomes currentColor, so that a chart follows the page's light or dark
/// scheme.
namespace emmetrope::report {

/// Runs `script` (plot commands without terminal and output) and fills in the figure's svg.
/// \param figure  id, width_px and height_px set
/// \return false where gnuplot is missing or fails: the report then says so instead
/// \throw Error (not_writable) where the folder for temporary files (TMPDIR) is none
bool draw_chart(Figure& figure, const std::string& script);

/// Square axes about the middle with the anatomical sides, as the examiner sees the eye: a right eye's temporal side on the
/// left.
/// \param reach  from the middle to the rim of what is drawn; its ticks stand at every `step`
std::string examiner_axes(double reach, double step, const std::string& x_label, const std::string& y_label,
                          bool is_right_eye);

/// Series colours that read on white and on dark grey, and with the common colour blindnesses (Okabe and
/// Ito).
inline constexpr const char* first_colour = "#2b83c6";
inline constexpr const char* second_colour = "#d9661f";
inline constexpr const char* third_colour = "#1f9e77";
inline constexpr const char* quiet_colour = "#8a8a8a";

}  // namespace emmetrope::report
