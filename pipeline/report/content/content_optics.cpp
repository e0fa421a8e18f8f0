#include <fmt/format.h>

#include <algorithm>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/population/limits.hpp"
#include "pipeline/eye/surfaces/zernike.hpp"
#include "pipeline/report/content/content.hpp"
#include "pipeline/report/content/content_tables.hpp"
#include "pipeline/report/content/judgement.hpp"
#include "pipeline/report/content/learnt.hpp"
#include "pipeline/report/figures/chart.hpp"
#include "pipeline/report/figures/encoding.hpp"
#include "pipeline/report/figures/letter_chart.hpp"
#include "pipeline/report/figures/reference_mtf.hpp"

namespace emmetrope::report {
namespace {

constexpr int picture_px = 300;
constexpr std::size_t drawn_terms = 21;  ///< to the fifth order

std::optional<raytrace::Wavefront> wavefront_of(const EyeData& eye) {
  const auto pupil = value_of(eye.wavefront, "pupil_mm"),
             wavelength = value_of(eye.wavefront, "wavelength_nm");
  if (!pupil || !wavelength || !eye.wavefront.contains("zernike_um")) return std::nullopt;
  if (!(*pupil > 0 && *wavelength > 0))
    throw input_error("wavefront.json: pupil_mm or wavelength_nm is not positive",
                      "run emmetrope trace again");
  raytrace::Wavefront wavefront;
  wavefront.pupil_mm = *pupil;
  wavefront.wavelength_nm = *wavelength;
  wavefront.rim.radius_mm = eye.wavefront.value("pupil_rim_mm", std::vector<double>());
  wavefront.stiles_crawford_per_mm2 = value_of(eye.wavefront, "stiles_crawford_per_mm2").value_or(0);
  wavefront.pupil_magnification = value_of(eye.wavefront, "pupil_magnification").value_or(1);
  const double tangential = value_of(eye.wavefront, "tangential_deg").value_or(90) * degree;
  wavefront.tangential = {std::cos(tangential), std::sin(tangential)};
  wavefront.pupil_position_mm = value_of(eye.wavefront, "pupil_position_mm").value_or(3);
  wavefront.zernike_um = eye.wavefront["zernike_um"].get<std::vector<double>>();
  wavefront.zernike_um.resize(std::max<std::size_t>(wavefront.zernike_um.size(), 6), 0);
  return wavefront;
}

/// A refraction of prescription.json where it acts on the wavefront: moved from the spectacle plane to the entrance pupil.
/// \param more_D  added to its spherical equivalent, in the spectacle plane
std::optional<PowerVector> refraction_in_pupil(const EyeData& eye, const raytrace::Wavefront& wavefront,
                                               const std::string& at, double more_D = 0) {
  const auto M = value_at(eye.prescription, at + "/M_D"), J0 = value_at(eye.prescription, at + "/J0_D"),
             J45 = value_at(eye.prescription, at + "/J45_D");
  if (!M || !J0 || !J45) return std::nullopt;
  return raytrace::in_pupil(wavefront, {*M + more_D, *J0, *J45},
                            value_of(eye.prescription, "vertex_distance_mm").value_or(12));
}

/// Nothing where the wavefront is not of the eye that the lens was found for.
std::optional<PowerVector> lens_in_pupil(const CaseData& data, const EyeData& eye,
                                         const raytrace::Wavefront& wavefront, double more_D = 0) {
  if (!judge(data, eye).has_refraction || learnt_since_traced(eye) == Learnt::readings) return std::nullopt;
  return refraction_in_pupil(eye, wavefront, "", more_D);
}

/// Where a given refraction has moved the eye, the wavefront of the eye as it was corrected: the difference of the
/// sharpest lenses without and with it is added to the second order; higher orders stay.
void add_given_refraction(const CaseData& data, EyeData& eye) {
  const auto traced = wavefront_of(eye);
  if (!traced || learnt_since_traced(eye) != Learnt::refraction || !judge(data, eye).has_refraction) return;
  const auto before = refraction_in_pupil(eye, *traced, "/calibration/without_it"),
             now = refraction_in_pupil(eye, *traced, "");
  if (!before || !now) return;
  const raytrace::Wavefront moved = raytrace::with_lens(
      *traced, {before->M_D - now->M_D, before->J0_D - now->J0_D, before->J45_D - now->J45_D});
  const raytrace::ImageQuality quality = raytrace::image_quality(moved);
  eye.wavefront.update(
      {{"zernike_um", moved.zernike_um},
       {"strehl", quality.strehl},
       {"vsotf", quality.vsotf},
       {"mtf",
        {{"cpd", quality.cpd}, {"tangential", quality.mtf_tangential}, {"sagittal", quality.mtf_sagittal}}}});
  eye.wavefront.erase("rms_um");  // of rays, which are not at hand
}

CaseData as_corrected(CaseData data) {
  for (EyeData& eye : data.eyes) add_given_refraction(data, eye);
  return data;
}

/// Which eye the wavefront is of, where it is not simply the traced one.
std::string seen_eye(const EyeData& eye) {
  switch (learnt_since_traced(eye)) {
    case Learnt::nothing:
      return {};
    case Learnt::refraction:
      return short_name(eye) +
             ": the wavefront is of the eye after the refraction that was given was taken into account: the second "
             "order has moved by as much as the refraction, higher orders are as traced.";
    case Learnt::readings:
      return short_name(eye) +
             ": the wavefront is of the eye as it was traced, without what other instruments measured, and the lens is "
             "of the eye with it; so nothing is shown with the lens. Readings that are given to emmetrope mesh are in "
             "both.";
  }
  return {};
}

Figure chart_figure(const EyeData& eye, const std::string& name, const std::string& title) {
  Figure figure;
  figure.id = name + "-" + eye.id();
  figure.title = short_name(eye) + ", " + title;
  figure.width_px = 400;
  figure.height_px = 245;
  return figure;
}

/// \param range_um  [low, high] of the ordinate, the same for both eyes
Figure zernike_figure(const EyeData& eye, const raytrace::Wavefront& wavefront,
                      const std::array<double, 2>& range_um) {
  Figure figure = chart_figure(eye, "zernike", "Zernike coefficients");
  figure.alt = "Bars of the Zernike coefficients of second to fifth order";
  const std::size_t end = std::min(wavefront.zernike_um.size(), drawn_terms);
  std::string script = "$bars << EOD\n";
  for (std::size_t i = 3; i < end; ++i) {
    const ZernikeIndex term = zernike_index(static_cast<int>(i));
    script += fmt::format("{} {:.5f} \"{},{}\"\n", i, wavefront.zernike_um[i], term.n, term.m);
  }
  script += fmt::format(
      "EOD\nset style fill solid 0.85\nset boxwidth 0.7\nunset key\nset xzeroaxis lt 1 lc rgb '{0}'\n"
      "set yrange [{2:.3f}:{3:.3f}]\nset ylabel 'Coefficient (\u00b5m)'\nset xlabel 'Zernike term n,m "
      "(OSA/ANSI)' offset 0,-0.5\n"
      "set tics scale 0.4\nset xtics rotate by -70\nplot $bars using 1:2:xtic(3) with boxes lc rgb "
      "'{1}'\n",
      quiet_colour, first_colour, range_um[0], range_um[1]);
  return draw_chart(figure, script) ? figure : Figure();
}

/// From the least to the largest coefficient that is drawn, of both eyes, with some room.
std::array<double, 2> zernike_range_um(const CaseData& data) {
  double low = 0, high = 0;
  for (const auto& eye : data.eyes)
    if (const auto wavefront = wavefront_of(eye))
      for (std::size_t i = 3; i < std::min(wavefront->zernike_um.size(), drawn_terms); ++i) {
        low = std::min(low, wavefront->zernike_um[i]);
        high = std::max(high, wavefront->zernike_um[i]);
      }
  const double room = std::max(0.05 * (high - low), 1e-3);
  return {low - room, high + room};
}

Figure mtf_figure(const EyeData& eye, const raytrace::Wavefront& wavefront,
                  const std::optional<PowerVector>& lens) {
  Figure figure = chart_figure(eye, "mtf", "modulation transfer");
  figure.alt = "Modulation transfer function with diffraction limit and a normal eye";
  const Json mtf = eye.wavefront.value("mtf", Json::object());
  const auto curve = [&](const char* key) { return mtf.value(key, std::vector<double>()); };
  const auto cpd = curve("cpd"), tangential = curve("tangential"), sagittal = curve("sagittal");
  if (cpd.empty() || cpd.size() != tangential.size() || cpd.size() != sagittal.size()) return {};
  std::string script = "$mtf << EOD\n";
  for (std::size_t i = 0; i < cpd.size(); ++i)
    script += fmt::format("{:.4f} {:.5f} {:.5f} {:.5f} {:.5f}\n", cpd[i], tangential[i], sagittal[i],
                          diffraction_mtf(cpd[i], wavefront.pupil_mm, wavefront.wavelength_nm),
                          healthy_mtf(cpd[i], wavefront.pupil_mm));
  script += "EOD\n";
  if (lens) {
    const raytrace::ImageQuality with_lens = raytrace::image_quality(wavefront, *lens);
    script += "$lens << EOD\n";
    for (std::size_t i = 0; i < with_lens.cpd.size(); ++i)
      script += fmt::format("{:.4f} {:.5f}\n", with_lens.cpd[i],
                            (with_lens.mtf_tangential[i] + with_lens.mtf_sagittal[i]) / 2);
    script += "EOD\n";
  }
  script += fmt::format(
      "set xlabel 'Spatial frequency (cycles per degree)'\nset ylabel 'Modulation transfer'\n"
      "set xrange [0:60]\nset yrange [0:1]\nset key above maxrows 3 samplen 2 width -3\n"
      "plot $mtf using 1:4 with lines dt 3 lw 1.5 lc rgb '{2}' title 'diffraction limit', "
      "$mtf using 1:5 with lines lw 1.5 lc rgb '{2}' title 'healthy corrected eyes', "
      "$mtf using 1:2 with lines lw 2 lc rgb '{0}' title 'no lens, tangential', "
      "$mtf using 1:3 with lines lw 2 dt 2 lc rgb '{0}' title 'no lens, sagittal'{1}\n",
      first_colour,
      lens ? fmt::format(", $lens using 1:2 with lines lw 2 lc rgb '{}' title 'with the lens'", second_colour)
           : "",
      quiet_colour);
  return draw_chart(figure, script) ? figure : Figure();
}

std::string arcmin_bar(double arcmin, double arcmin_across, const char* colour) {
  return fmt::format(
      "<path d=\"M10 {0}h{1:.1f}\" stroke=\"{2}\" stroke-width=\"3\"/><text x=\"10\" y=\"{3}\" "
      "font-family=\"DejaVu Sans\" font-size=\"12\" fill=\"{2}\">{4:g} arcmin</text>",
      picture_px - 24, picture_px * arcmin / arcmin_across, colour, picture_px - 8, arcmin);
}

/// \param margin_px  room for labels at the right
Figure picture_figure(const EyeData& eye, const std::string& name, const std::string& title,
                      const std::string& png, const std::string& marks, int margin_px) {
  Figure figure = chart_figure(eye, name, title);
  figure.width_px = picture_px + margin_px;
  figure.height_px = picture_px;
  figure.svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" xmlns:xlink=\"http://www.w3.org/1999/xlink\" viewBox=\"0 0 "
      "{4} {0}\"><image width=\"{0}\" height=\"{0}\" xlink:href=\"{1}\"/><rect x=\"0.5\" y=\"0.5\" "
      "width=\"{2}\" height=\"{2}\" fill=\"none\" stroke=\"#8a8a8a\"/>{3}</svg>",
      picture_px, png_url(png), picture_px - 1, marks, picture_px + margin_px);
  return figure;
}

Figure spread_figure(const EyeData& eye, const raytrace::PointSpread& spread, const std::string& kind,
                     const std::string& title) {
  constexpr double shown_arcmin = 40;
  const float peak = *std::max_element(spread.values.begin(), spread.values.end());
  const Picture picture{spread.size, spread.pitch_arcmin, spread.values};
  Figure figure = picture_figure(eye, "psf-" + kind, "a point, " + title,
                                 grey_png(picture, shown_arcmin, picture_px, peak),
                                 arcmin_bar(5, shown_arcmin, "#fff"), 0);
  figure.alt = "Image of a point of light on the retina, " + title;
  return figure;
}

Figure letters_figure(const EyeData& eye, const raytrace::PointSpread& spread, const std::string& kind,
                      const std::string& title) {
  constexpr double shown_arcmin = 132;
  constexpr int margin_px = 52;
  const auto lines = letter_lines({0.7, 0.5, 0.3, 0.2, 0.1, 0.0}, 0.92 * shown_arcmin);
  std::string marks = arcmin_bar(5, shown_arcmin, "#000");
  for (const auto& line : lines)
    marks += fmt::format(
        "<text x=\"{}\" y=\"{:.1f}\" font-family=\"DejaVu Sans\" font-size=\"13\" "
        "fill=\"currentColor\">20/{}</text>",
        picture_px + 5, picture_px * (0.5 + line.middle_arcmin / shown_arcmin) + 5,
        std::lround(20 * std::pow(10, line.logmar)));
  Figure figure = picture_figure(
      eye, "letters-" + kind, "letters, " + title,
      grey_png(blurred_letters(spread, lines, shown_arcmin), shown_arcmin, picture_px, 1), marks, margin_px);
  figure.alt = "Lines of letters from 20/100 to 20/20 as this eye images them, " + title;
  return figure;
}

const std::vector<EyeRow>& wavefront_rows() {
  static const std::vector<EyeRow> rows{
      {"/pupil_mm", "Entrance pupil", {2, false, "mm"}},
      {"/wavelength_nm", "Wavelength", {1, false, "nm"}},
      {"/rms_um", "Wavefront error, rms", {3, false, "\u00b5m"}},
      {"/higher_order_rms_um", "Higher orders alone, rms", {3, false, "\u00b5m"}},
      {"/strehl", "Strehl ratio", {3, false, ""}},
      {"/vsotf", "Visual Strehl ratio (VSOTF)", {3, false, ""}}};
  return rows;
}

/// The numbers behind the bars, for readers who do not see them.
Table zernike_table(const Eyes& eyes) {
  std::vector<EyeRow> rows;
  std::size_t count = 0;
  for (const auto* eye : eyes) count = std::max(count, eye->wavefront.at("zernike_um").size());
  for (std::size_t i = 0; i < count; ++i) {
    const ZernikeIndex term = zernike_index(static_cast<int>(i));
    rows.push_back(
        {fmt::format("/zernike_um/{}", i), fmt::format("{},{}", term.n, term.m), {4, true, "\u00b5m"}});
  }
  Table table = eye_table("Zernike coefficients n,m (OSA/ANSI)", eyes, &EyeData::wavefront, rows);
  table.folded = true;
  return table;
}

}  // namespace

FigureRow letters_at_the_ends(const CaseData& traced) {
  const CaseData data = as_corrected(traced);
  FigureRow row;
  for (const auto& eye : data.eyes) {
    const auto wavefront = wavefront_of(eye);
    if (!wavefront) continue;
    const Json M = eye.prescription.is_object() ? eye.prescription.value("M_D", Json()) : Json();
    if (!M.is_object() || !M.contains("ci95")) continue;
    const auto measured = M.get<Measured>();
    const double reach_D = (measured.ci95[1] - measured.ci95[0]) / 2;
    if (limits_of("M_half_width_D").normal.contains(reach_D)) continue;
    for (const auto& [off_D, kind] : {std::pair{0.0, "estimate"}, {reach_D, "end"}}) {
      const auto lens = lens_in_pupil(data, eye, *wavefront, off_D);
      if (!lens) continue;
      const std::string title = off_D == 0
                                    ? "with the lens, if it is right"
                                    : "if the eye is at the interval's end, " + fixed(reach_D, 1) + " D off";
      row.figures.push_back(letters_figure(eye, raytrace::point_spread(*wavefront, *lens), kind, title));
    }
  }
  if (!row.figures.empty())
    row.caption =
        "The same letters through the same lens: as sharp as the estimate says, and as blurred as the 95 % interval "
        "leaves open. Computed from the wavefront of " +
        traced_pupil(data) + " in one colour.";
  return row;
}

Section optics_section(const CaseData& traced, Notes& notes, Citations& citations) {
  const CaseData data = as_corrected(traced);
  Section section{"optics", "What the eye does to light", {}};
  Eyes eyes;
  FigureRow zernike, mtf, letters, spreads;
  zernike.caption =
      "2,0 is defocus, 2,\u00b12 astigmatism, 3,\u00b11 coma, 4,0 spherical aberration. Second order is what "
      "a lens corrects; the rest stays.";
  letters.caption =
      "Sloan letters of logMAR 0.7, 0.5, 0.3, 0.2, 0.1 and 0.0, computed from the wavefront of " +
      traced_pupil(data) +
      " in one colour. The smallest line whose letters can be told apart is about the acuity that the optics allow.";
  spreads.caption = "A point of light on the retina; each picture is scaled to its own peak.";
  const std::array<double, 2> range_um = zernike_range_um(data);
  for (const auto& eye : data.eyes) {
    const auto wavefront = wavefront_of(eye);
    if (!wavefront) continue;
    eyes.push_back(&eye);
    const auto lens = lens_in_pupil(data, eye, *wavefront);
    const Figure bars = zernike_figure(eye, *wavefront, range_um), curves = mtf_figure(eye, *wavefront, lens);
    if (!bars.svg.empty()) zernike.figures.push_back(bars);
    if (!curves.svg.empty()) mtf.figures.push_back(curves);
    if (bars.svg.empty() || curves.svg.empty())
      notes.push_back(short_name(eye) +
                      ": charts of the wavefront are missing, because gnuplot is not installed or failed.");
    const auto show = [&](const PowerVector& power, const char* kind, const char* title) {
      const raytrace::PointSpread spread = raytrace::point_spread(*wavefront, power);
      letters.figures.push_back(letters_figure(eye, spread, kind, title));
      spreads.figures.push_back(spread_figure(eye, spread, kind, title));
    };
    show({}, "before", "no lens");
    if (lens) show(*lens, "after", "with the lens");
  }
  if (eyes.empty()) return section;
  if (!mtf.figures.empty())
    mtf.caption = fmt::format(
        "Contrast that reaches the retina, by fineness of detail; letters of 20/20 need about 30 cycles per "
        "degree. Grey: the mean of healthy corrected eyes [{}] and the diffraction limit of this pupil.",
        citations.number_of("Watson 2013"));
  section.blocks.push_back(
      {eye_table("Wavefront of " + traced_pupil(data), eyes, &EyeData::wavefront, wavefront_rows())});
  const bool has_one_index = std::any_of(eyes.begin(), eyes.end(), [](const EyeData* eye) {
    return value_of(eye->traced, "lens_index").has_value();
  });
  if (has_one_index)
    section.blocks.push_back({Paragraph{
        "Higher orders follow mostly from the lens, which is taken to have one refractive index and whose asphericity "
        "images hardly show: a living lens, whose index rises towards its core, has less spherical aberration."}});
  for (const auto* eye : eyes)
    if (const std::string sentence = seen_eye(*eye); !sentence.empty() && judge(data, *eye).has_refraction)
      section.blocks.push_back({Paragraph{sentence}});
  for (const auto& [row, paper] : {std::pair{&zernike, Paper::if_room}, std::pair{&mtf, Paper::always},
                                   std::pair{&letters, Paper::first_if_room}})
    if (!row->figures.empty()) section.blocks.push_back({*row, paper});
  section.blocks.push_back({spreads, Paper::if_room});
  section.blocks.push_back({zernike_table(eyes), Paper::never});
  return section;
}

}  // namespace emmetrope::report
