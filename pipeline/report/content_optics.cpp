#include <fmt/format.h>

#include "pipeline/report/chart.hpp"
#include "pipeline/report/content.hpp"
#include "pipeline/report/encoding.hpp"
#include "pipeline/report/judgement.hpp"
#include "pipeline/report/numbers.hpp"
#include "pipeline/report/point_spread.hpp"

namespace emmetrope::report {
namespace {

constexpr int picture_px = 300;

std::string short_name(const EyeData& eye) { return eye.laterality == Laterality::od ? "OD" : "OS"; }

std::optional<PupilWavefront> wavefront_of(const EyeData& eye) {
  const auto pupil = value_of(eye.wavefront, "pupil_mm"), wavelength = value_of(eye.wavefront, "wavelength_nm");
  if (!pupil || !wavelength || !eye.wavefront.contains("zernike_um")) return std::nullopt;
  return PupilWavefront{*pupil, *wavelength, eye.wavefront["zernike_um"].get<std::vector<double>>()};
}

/// The prescription where it acts on the wavefront: moved from the spectacle plane to the cornea.
std::optional<PowerVector> correction_of(const EyeData& eye) {
  const auto M = value_of(eye.prescription, "M_D"), J0 = value_of(eye.prescription, "J0_D"),
             J45 = value_of(eye.prescription, "J45_D");
  if (!M || !J0 || !J45) return std::nullopt;
  return move_towards_eye({*M, *J0, *J45}, value_of(eye.prescription, "vertex_distance_mm").value_or(12));
}

Figure chart_figure(const EyeData& eye, const std::string& name, const std::string& title) {
  Figure figure;
  figure.id = name + "-" + eye.id();
  figure.title = short_name(eye) + ", " + title;
  figure.width_px = 480;
  figure.height_px = 300;
  return figure;
}

bool zernike_chart(Figure& figure, const PupilWavefront& wavefront) {
  const std::size_t last = std::min<std::size_t>(wavefront.zernike_um.size(), 28);
  std::string script = "$bars << EOD\n";
  for (std::size_t i = 3; i < last; ++i) {
    const int n = static_cast<int>(std::ceil((-3 + std::sqrt(9 + 8.0 * static_cast<double>(i))) / 2 - 1e-9));
    const int m = 2 * static_cast<int>(i) - n * (n + 2);
    script += fmt::format("{} {:.5f} \"{},{}\"\n", i, wavefront.zernike_um[i], n, m);
  }
  script += fmt::format(
      "EOD\nset style fill solid 0.85\nset boxwidth 0.7\nunset key\nset xzeroaxis lt 1 lc rgb '{}'\n"
      "set ylabel 'Coefficient (\u00b5m)'\nset xlabel 'Zernike term n,m (OSA/ANSI)'\n"
      "set xtics rotate by -60 font ',9'\nplot $bars using 1:2:xtic(3) with boxes lc rgb '{}'\n",
      quiet_colour, first_colour);
  return draw_chart(figure, script);
}

bool mtf_chart(Figure& figure, const EyeData& eye, const PupilWavefront& wavefront) {
  const Json mtf = eye.wavefront.value("mtf", Json::object());
  if (!mtf.contains("cpd") || !mtf.contains("tangential") || !mtf.contains("sagittal")) return false;
  const auto cpd = mtf["cpd"].get<std::vector<double>>(), tangential = mtf["tangential"].get<std::vector<double>>(),
             sagittal = mtf["sagittal"].get<std::vector<double>>();
  if (cpd.size() != tangential.size() || cpd.size() != sagittal.size() || cpd.empty()) return false;
  const auto lens = correction_of(eye);
  Modulation corrected;
  if (lens) corrected = modulation_transfer(point_spread(corrected_by(wavefront, *lens)), cpd);
  std::string script = "$mtf << EOD\n";
  for (std::size_t i = 0; i < cpd.size(); ++i)
    script += fmt::format("{:.4f} {:.5f} {:.5f} {:.5f} {:.5f} {:.5f}\n", cpd[i], tangential[i], sagittal[i],
                          diffraction_mtf(cpd[i], wavefront.pupil_mm, wavefront.wavelength_nm),
                          healthy_mtf(cpd[i], wavefront.pupil_mm),
                          lens ? (corrected.horizontal[i] + corrected.vertical[i]) / 2 : 0);
  script += fmt::format(
      "EOD\nset xlabel 'Spatial frequency (cycles per degree)'\nset ylabel 'Modulation transfer'\n"
      "set xrange [0:60]\nset yrange [0:1]\nset key top right samplen 2 font ',10'\n"
      "plot $mtf using 1:4 with lines dt 3 lw 1.5 lc rgb '{3}' title 'diffraction limit', "
      "$mtf using 1:5 with lines lw 1.5 lc rgb '{3}' title 'healthy corrected eyes', "
      "$mtf using 1:2 with lines lw 2 lc rgb '{0}' title 'no lens, vertical', "
      "$mtf using 1:3 with lines lw 2 dt 2 lc rgb '{0}' title 'no lens, horizontal'{2}\n",
      first_colour, second_colour,
      lens ? fmt::format(", $mtf using 1:6 with lines lw 2 lc rgb '{}' title 'with the lens'", second_colour) : "",
      quiet_colour);
  return draw_chart(figure, script);
}

std::string picture_svg(const std::string& png, const std::string& note) {
  return fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" xmlns:xlink=\"http://www.w3.org/1999/xlink\" viewBox=\"0 0 {0} "
      "{0}\"><image width=\"{0}\" height=\"{0}\" xlink:href=\"{1}\"/>{2}</svg>",
      picture_px, png_url(png), note);
}

std::string arcmin_bar(double arcmin, double arcmin_across, const char* colour) {
  return fmt::format(
      "<path d=\"M10 {0}h{1:.1f}\" stroke=\"{2}\" stroke-width=\"3\"/><text x=\"10\" y=\"{3}\" "
      "font-family=\"DejaVu Sans\" font-size=\"12\" fill=\"{2}\">{4:g} arcmin</text>",
      picture_px - 24, picture_px * arcmin / arcmin_across, colour, picture_px - 8, arcmin);
}

Figure spread_figure(const EyeData& eye, const Picture& spread, const std::string& kind,
                     const std::string& title) {
  constexpr double shown_arcmin = 40;
  Figure figure = chart_figure(eye, "psf-" + kind, title);
  figure.width_px = figure.height_px = picture_px;
  const int crop = static_cast<int>(shown_arcmin / spread.arcmin_per_pixel);
  const float peak = *std::max_element(spread.values.begin(), spread.values.end());
  figure.svg = picture_svg(grey_png(spread, crop, picture_px, peak), arcmin_bar(5, shown_arcmin, "#fff"));
  figure.alt = "Image of a point of light on the retina";
  return figure;
}

Figure letters_figure(const EyeData& eye, const Picture& spread, const std::string& kind, const std::string& title) {
  Figure figure = chart_figure(eye, "letters-" + kind, title);
  figure.width_px = figure.height_px = picture_px;
  const Picture letters = blurred_letters(spread, {0.7, 0.4, 0.2, 0.0});
  constexpr double shown_arcmin = 130;
  const int crop = static_cast<int>(shown_arcmin / letters.arcmin_per_pixel);
  figure.svg = picture_svg(grey_png(letters, crop, picture_px, 1), arcmin_bar(5, shown_arcmin, "#000"));
  figure.alt = "Lines of letters as this eye images them";
  return figure;
}

}  // namespace

Section optics_section(const CaseData& data, Notes& notes) {
  Section section{"optics", "What the eye does to light", {}, false};
  for (const auto& eye : data.eyes) {
    const auto wavefront = wavefront_of(eye);
    if (!wavefront) continue;
    Table table{"Wavefront, " + std::string(clinical_name(eye.laterality)), {"Quantity", "Value"}, {}};
    table.rows.push_back({"Entrance pupil", format(wavefront->pupil_mm, {2, false, "mm"})});
    table.rows.push_back({"Wavelength", format(wavefront->wavelength_nm, {1, false, "nm"})});
    for (const auto& [key, name, style] :
         {std::tuple{"rms_um", "Wavefront error, rms", NumberStyle{3, false, "\u00b5m"}},
          std::tuple{"higher_order_rms_um", "Higher orders alone, rms", NumberStyle{3, false, "\u00b5m"}},
          std::tuple{"strehl", "Strehl ratio", NumberStyle{3, false, ""}},
          std::tuple{"vsotf", "Visual Strehl ratio (VSOTF)", NumberStyle{3, false, ""}}})
      if (const auto value = value_of(eye.wavefront, key)) table.rows.push_back({name, format(*value, style)});
    section.blocks.push_back({table});

    FigureRow charts;
    Figure bars = chart_figure(eye, "zernike", "Zernike coefficients");
    bars.caption =
        "2,0 is defocus, 2,\u00b12 astigmatism, 3,\u00b11 coma, 4,0 spherical aberration. Second order is what a lens "
        "corrects; the rest stays.";
    bars.alt = "Bars of the Zernike coefficients from second order on";
    if (zernike_chart(bars, *wavefront)) charts.figures.push_back(bars);
    Figure mtf = chart_figure(eye, "mtf", "modulation transfer");
    mtf.caption =
        "Contrast that reaches the retina, by fineness of detail; letters of 20/20 need about 30 cycles per degree. "
        "Grey: the mean of healthy corrected eyes [11] and the diffraction limit of this pupil.";
    mtf.alt = "Modulation transfer function with diffraction limit and a normal eye";
    if (mtf_chart(mtf, eye, *wavefront)) charts.figures.push_back(mtf);
    if (charts.figures.empty())
      notes.push_back(short_name(eye) + ": charts are missing, because gnuplot is not installed or failed.");
    else
      section.blocks.push_back({charts});

    FigureRow pictures;
    const Picture before = point_spread(*wavefront);
    pictures.figures.push_back(spread_figure(eye, before, "before", "a point of light, no lens"));
    pictures.figures.push_back(letters_figure(eye, before, "before", "letters, no lens"));
    if (const auto lens = correction_of(eye); lens && judge(data, eye).has_prescription) {
      const Picture after = point_spread(corrected_by(*wavefront, *lens));
      pictures.figures.push_back(spread_figure(eye, after, "after", "a point of light, with the lens"));
      pictures.figures.push_back(letters_figure(eye, after, "after", "letters, with the lens"));
    }
    pictures.figures.front().caption =
        "From the wavefront, one colour. Each point picture is scaled to its own peak. Lines of letters: logMAR 0.7 "
        "(20/100), 0.4 (20/50), 0.2 (20/32) and 0.0 (20/20).";
    section.blocks.push_back({pictures});
  }
  return section;
}

}  // namespace emmetrope::report
