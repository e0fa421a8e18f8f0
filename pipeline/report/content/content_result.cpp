#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "pipeline/base/notation.hpp"
#include "pipeline/report/content/biometry_rows.hpp"
#include "pipeline/report/content/content.hpp"
#include "pipeline/report/content/content_tables.hpp"
#include "pipeline/report/content/first_page.hpp"
#include "pipeline/report/content/judgement.hpp"
#include "pipeline/report/content/learnt.hpp"
#include "pipeline/report/document/numbers.hpp"
#include "pipeline/report/figures/encoding.hpp"

namespace emmetrope::report {
namespace {

std::string rounded_prescription(const Json& prescription) {
  const std::string rounded = refraction_of(prescription.value("rounded", Json::object()), "");
  return has_axis(prescription.value("cylinder_D", Json())) ? rounded : without_axis(rounded);
}

/// "name, value, 95 % interval, source" of a key that may be missing.
void add_measured(Table& table, const Json& json, const std::string& key, const std::string& name,
                  const NumberStyle& style) {
  if (!json.is_object() || !json.contains(key) || json[key].is_null()) return;
  const Json& found = json[key];
  if (found.is_number()) {
    table.rows.push_back({name, format(found.get<double>(), style), "exact"});
    return;
  }
  const auto measured = found.get<Measured>();
  table.rows.push_back({name, format(measured.value, style), format_interval(measured, style)});
}

/// An axis only where there is a cylinder.
void add_axis(Table& table, const Json& prescription) {
  const NumberStyle degrees{0, false, "axis"};
  if (has_axis(prescription.value("cylinder_D", Json())))
    add_measured(table, prescription, "axis_deg", "Axis", degrees);
  else
    table.rows.push_back({"Axis", "not determined", "any"});
}

/// Side by side what was given, what it is combined with, and what has come of them.
/// \param with  combined_with()
void add_calibration(EyeCard& card, const Json& prescription, const std::string& with) {
  const Json calibration = prescription.value("calibration", Json());
  if (!calibration.is_object()) return;
  const NumberStyle dioptres{2, true, "D"};
  const Json given = calibration.value("given", Json()), alone = calibration.value("without_it", Json());
  const double half_width_D =
      Measured::from_sigma(0, value_of(calibration, "sigma_D").value_or(0), "").ci95[1];
  card.note += ". Combined from the refraction that was given, " + refraction_of(given) +
               light_of(prescription, sodium_light()) + ", and what " + with + " say, " +
               refraction_of(alone) + light_of(prescription, " (of {:g} nm)") +
               ", each by its accuracy: no independent measurement";
  card.details.rows.push_back(
      {"Given", refraction_of(given), "\u00b1" + fixed(half_width_D, 2) + " D in M, J0 and J45"});
  card.details.rows.push_back({"By " + with, refraction_of(alone), ""});
  add_measured(card.details, alone, "M_D", "M by " + with, dioptres);
}

/// Before rounding, to the last decimal; of an eye without a prescription nothing that has the form of one.
Table details_of(const Json& prescription, const Judgement& judgement, const std::string& eye) {
  Table details{
      (judgement.has_prescription ? "Best lens before rounding, " : "Estimate, for information only, ") + eye,
      {"", "Value", "95 % interval"},
      {}};
  const NumberStyle dioptres{2, true, "D"};
  if (judgement.has_prescription) {
    details.rows.push_back({"Rounded", rounded_prescription(prescription), ""});
    add_measured(details, prescription, "sphere_D", "Sphere", dioptres);
    add_measured(details, prescription, "cylinder_D", "Cylinder", dioptres);
    add_axis(details, prescription);
  }
  add_measured(details, prescription, "M_D", "M", dioptres);
  add_measured(details, prescription, "J0_D", "J0", dioptres);
  add_measured(details, prescription, "J45_D", "J45", dioptres);
  return details;
}

EyeCard card_of(const CaseData& data, const EyeData& eye) {
  const Judgement judgement = judge(data, eye);
  EyeCard card;
  card.eye = clinical_name(eye.laterality);
  card.id = eye.id();
  card.light = judgement.light;
  card.verdict = judgement.verdict;
  card.reasons = judgement.reasons;
  card.headline = headline_of(eye, judgement);
  card.facts = facts_of(eye, judgement);
  card.next = next_step(eye, judgement);
  if (!judgement.has_refraction) return card;

  const Json& prescription = eye.prescription;
  if (judgement.has_prescription) card.prescription = rounded_prescription(prescription);
  const double vertex_distance_mm = value_of(prescription, "vertex_distance_mm").value_or(12);
  card.note = fmt::format(
      "{}, {}for distance{}",
      vertex_distance_mm == 0 ? "contact lens" : fmt::format("vertex distance {:g} mm", vertex_distance_mm),
      card.headline.find(" x ") != std::string::npos ? "minus cylinder, " : "",
      light_of(prescription, ", in light of {:g} nm"));
  card.details = details_of(prescription, judgement, card.eye);
  add_calibration(card, prescription, combined_with(data, eye));
  // Letters that are sharp would sell a lens that nobody is to wear.
  if (!judgement.has_prescription) return card;
  card.before_png = page_png(eye.uncorrected_png);
  card.after_png = page_png(eye.corrected_png);
  const std::string before_is_of =
      learnt_since_traced(eye) == Learnt::nothing
          ? ""
          : ", the eye as " + meshed_from(data, eye) + " show it, without what was given to the correction";
  card.picture_caption =
      "The same chart on the retina of this eye, through " + traced_pupil(data) +
      ", upright as the patient perceives it: before, with no lens" + before_is_of +
      "; after, with the best lens as if that were exact. Look at the smallest row that can be read, and at the "
      "direction of the blur." +
      chart_rows(data);
  return card;
}

std::string normal_range(const BiometryRow& row, std::optional<double> age_years, Citations& citations) {
  const Normal normal = row.normal(age_years);
  if (!normal.range.is_limited()) return "\u2013";
  return fmt::format("{} [{}]", format_range(normal.range, row.style.decimals),
                     citations.number_of(normal.reference));
}

struct Cells {
  std::string value, interval, source;
  std::optional<double> image_share = {};
};

Cells cells_of(const CaseData& data, const EyeData& eye, const BiometryRow& row) {
  const Json::json_pointer pointer("/" + row.key);
  if (!eye.biometry.is_object() || !eye.biometry.contains(pointer) || eye.biometry.at(pointer).is_null())
    return {"\u2013", "", ""};
  const Json& found = eye.biometry.at(pointer);
  if (is_withheld(found)) return {"withheld", "", ""};
  if (found.is_number()) return {format(found.get<double>(), row.style), "", "exact"};
  const auto measured = found.get<Measured>();
  const bool is_unusual = data.has_normal_ranges && !row.is_normal(measured.value, data.age_years());
  return {format(measured.value, row.style) + (is_unusual ? " (!)" : ""),
          format_interval(measured, row.style),
          source_name(measured.source) + (measured.method == "edges" ? ", edges" : ""), measured.image_share};
}

/// "MRI (97 / 95 %)": where the numbers of the eyes come from, and how much of it the images gave.
std::string source_of(const std::vector<Cells>& eyes) {
  std::vector<std::string> names, shares;
  for (const Cells& eye : eyes) {
    if (eye.source.empty()) continue;
    if (names.empty() || names.back() != eye.source) names.push_back(eye.source);
    if (eye.image_share) shares.push_back(fixed(100 * *eye.image_share, 0));
  }
  std::string text = fmt::format("{}", fmt::join(names, " / "));
  return shares.empty() ? text : fmt::format("{} ({} %)", text, fmt::join(shares, " / "));
}

const Json::json_pointer cylinder_at("/keratometry/cylinder_D");

/// "OD (right): K1 42.39 D @ 2 deg, K2 45.06 D @ 92 deg, dK 2.67 D, with-the-rule", as keratometers print it.
BulletList keratometer_lines(const CaseData& data) {
  BulletList lines;
  for (const auto& eye : data.eyes) {
    const auto number = [&](const std::string& pointer, const NumberStyle& style) {
      const auto value = value_at(eye.biometry, pointer);
      return value ? format(*value, style) : std::string("\u2013");
    };
    const NumberStyle power{2, false, "D"}, axis{0, false, "axis"};
    if (!value_at(eye.biometry, "/keratometry/flat/power_D")) continue;
    const bool is_toric = has_axis(eye.biometry.value(cylinder_at, Json()));
    const auto meridian = [&](const std::string& pointer) {
      return number(pointer + "/power_D", power) +
             (is_toric ? " @ " + number(pointer + "/axis_deg", axis) : std::string());
    };
    std::string line = fmt::format("{}: K1 {}, K2 {}, \u0394K {}", clinical_name(eye.laterality),
                                   meridian("/keratometry/flat"), meridian("/keratometry/steep"),
                                   number("/keratometry/cylinder_D", power));
    const Json astigmatism = eye.biometry.value("astigmatism", Json::object());
    if (!is_toric)
      line += ", axis not determined";
    else if (astigmatism.is_object() && astigmatism.contains("type") && astigmatism["type"].is_string())
      line += ", " + astigmatism["type"].get<std::string>();
    lines.items.push_back(line);
  }
  return lines;
}

/// What is not told of each eye, and why.
BulletList withheld_lines(const CaseData& data) {
  BulletList lines;
  for (const auto& eye : data.eyes)
    for (const auto& [reason, list] : withheld_quantities(eye.biometry))
      lines.items.push_back(
          fmt::format("{}: withheld, since {}: {}.", clinical_name(eye.laterality), reason, list));
  return lines;
}

/// What a table tells: what the images or instruments gave of any eye, or what nothing but the population tells.
enum class Told { measured, assumed };

/// The length that images show beside the one that biometers measure.
std::string inner_lengths(const CaseData& data) {
  std::vector<std::string> lengths;
  const NumberStyle style{2, false, "mm"};
  for (const auto& eye : data.eyes) {
    const Json found = eye.biometry.is_object() ? eye.biometry.value(inner_axial_length_key, Json()) : Json();
    if (!found.is_object() || !found.contains("ci95")) continue;
    const auto measured = found.get<Measured>();
    lengths.push_back(
        fmt::format("{} in {}", format(measured.value, style) + " (" + format_interval(measured, style) + ")",
                    short_name(eye)));
  }
  if (lengths.empty()) return {};
  return fmt::format(
      "The optical axial length ends at the photoreceptors, as biometers measure it; to the inner surface of the "
      "retina, which MR images show, it is {}. ",
      fmt::join(lengths, " and "));
}

Table measured_table(const CaseData& data, const std::vector<BiometryRow>& rows, const std::string& caption,
                     Citations& citations, Told told = Told::measured) {
  Table table;
  table.caption = caption;
  table.header = {"Quantity"};
  for (const auto& eye : data.eyes)
    for (const char* column : {"", " 95 % interval"})
      table.header.push_back((eye.laterality == Laterality::od ? "OD" : "OS") + std::string(column));
  const std::optional<double> age_years = data.age_years();
  const bool is_of_child = is_child(age_years);
  table.header.emplace_back("Source (images' share)");
  if (data.has_normal_ranges)
    table.header.push_back(is_of_child ? "Normal at " + age_text(*age_years) : "Normal adult");
  for (const auto& row : rows) {
    if (row.key == inner_axial_length_key) continue;
    std::vector<std::string> cells{row.name};
    std::vector<Cells> found_of_eyes;
    for (const auto& eye : data.eyes) {
      Cells found = cells_of(data, eye, row);
      if (!found.source.empty() && !row.is_determined(eye.biometry)) {
        found.value = "not determined";
        found.interval = "any";
      }
      cells.insert(cells.end(), {found.value, found.interval});
      found_of_eyes.push_back(found);
    }
    const std::string source = source_of(found_of_eyes);
    const bool is_assumed = std::all_of(found_of_eyes.begin(), found_of_eyes.end(), [](const Cells& found) {
      return found.source.empty() || found.source == source_name("prior");
    });
    if (source.empty() || is_assumed != (told == Told::assumed)) continue;
    cells.push_back(source);
    if (data.has_normal_ranges) cells.push_back(normal_range(row, age_years, citations));
    table.rows.push_back(cells);
  }
  return table;
}

}  // namespace

Section result_section(const CaseData& data) {
  Section section{"result", "Result", {}};
  EyeCards cards;
  bool any = false;
  for (const auto& eye : data.eyes) {
    cards.cards.push_back(card_of(data, eye));
    any = any || !cards.cards.back().details.rows.empty();
  }
  section.blocks.push_back({cards});
  if (data.eyes.size() == 1) {
    const bool is_right = data.eyes.front().laterality == Laterality::od;
    section.blocks.push_back({Paragraph{fmt::format("{}: not asked for (--laterality {}).",
                                                    clinical_name(is_right ? Laterality::os : Laterality::od),
                                                    data.eyes.front().id())}});
  }
  if (FigureRow ends = letters_at_the_ends(data); !ends.figures.empty())
    section.blocks.push_back({std::move(ends), Paper::first_if_room});
  if (const BulletList explained{what_explains(data)}; !explained.items.empty())
    section.blocks.push_back({explained});
  if (any)
    section.blocks.push_back({Paragraph{
        "SE is the spherical equivalent, \u00b1 and \"to\" its 95 % interval. The refraction holds for the "
        "state of accommodation that the eyes had in the scanner, " +
        refracted_point(data) + ". The fovea is not visible in MRI."}});
  return section;
}

Section measured_section(const CaseData& data, Citations& citations) {
  Section section{"measured", "What was measured", {}};
  const Table biometry = measured_table(data, biometry_rows(), "Biometry", citations);
  const Table keratometry =
      measured_table(data, keratometry_rows(), "Keratometry and corneal astigmatism", citations);
  const Table retina = measured_table(data, retina_rows(), "Shape of the back of the eye", citations);
  std::vector<BiometryRow> all;
  for (const auto* rows : measured_rows()) all.insert(all.end(), rows->begin(), rows->end());
  Table assumed =
      measured_table(data, all, "Not measured here: what the population tells", citations, Told::assumed);
  assumed.folded = true;
  const std::initializer_list<const Table*> tables{&biometry, &keratometry, &retina, &assumed};
  if (std::all_of(tables.begin(), tables.end(), [](const Table* table) { return table->rows.empty(); }))
    return section;
  for (const Table* table : tables)
    if (!table->rows.empty())
      section.blocks.push_back({*table, table->folded ? Paper::if_room : Paper::always});
  if (const BulletList lines = withheld_lines(data); !lines.items.empty()) section.blocks.push_back({lines});
  if (const BulletList lines = keratometer_lines(data); !lines.items.empty())
    section.blocks.push_back({lines});
  const std::string of_marks =
      !data.has_normal_ranges
          ? ""
          : std::string(
                "(!) marks a value outside the normal range of the numbered source, in most rows mean "
                "\u00b1 2 standard deviations") +
                (is_child(data.age_years())
                     ? ", at this age; without one a child's values are not judged, as ranges of adults are not a "
                       "child's. "
                     : ". ");
  section.blocks.push_back({Paragraph{
      inner_lengths(data) + of_marks +
      "A prior is the population's knowledge and no measurement of this patient: its "
      "interval is that of the population. Keratometric powers are 337.5 / R, 1.5 mm from the apex; axes are "
      "counter-clockwise from the examiner's right (TABO), the same for both eyes. Radii and Q of the retina are those "
      "of the best ellipsoid over so wide a cap as seen from the globe's centre; Q is above 0 where it is wider than "
      "deep. Eyes with a posterior staphyloma have an index above 40."}});
  return section;
}

}  // namespace emmetrope::report
