#include <fmt/format.h>

#include <array>
#include <cctype>

#include "pipeline/base/notation.hpp"
#include "pipeline/report/content/content.hpp"
#include "pipeline/report/content/content_tables.hpp"
#include "pipeline/report/content/first_page.hpp"
#include "pipeline/report/content/judgement.hpp"

namespace emmetrope::report {
namespace {

const NumberStyle dioptres{2, true, "D"}, millimetres{1, false, "mm"};

/// The lens of a kind among those that correction searched; null where there is none.
Json lens_of(const EyeData& eye, const std::string& kind) {
  for (const auto& lens : eye.prescription.value("lenses", Json::array()))
    if (lens.value("kind", std::string()) == kind) return lens;
  return {};
}

std::vector<std::string> kinds_of(const Eyes& eyes) {
  std::vector<std::string> kinds;
  for (const auto* eye : eyes)
    for (const auto& lens : eye->prescription.value("lenses", Json::array())) {
      const std::string kind = lens.value("kind", std::string());
      if (!kind.empty() && std::find(kinds.begin(), kinds.end(), kind) == kinds.end()) kinds.push_back(kind);
    }
  return kinds;
}

/// "Contact lens at 0 mm"; both distances where the eyes differ.
std::string name_of(std::string kind, const Eyes& eyes) {
  std::vector<std::string> distances;
  for (const auto* eye : eyes)
    if (const auto vertex_mm = value_of(lens_of(*eye, kind), "vertex_distance_mm"))
      if (const std::string text = fmt::format("{:g}", *vertex_mm);
          distances.empty() || distances.back() != text)
        distances.push_back(text);
  kind[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(kind[0])));
  return fmt::format("{} at {} mm", kind, fmt::join(distances, " / "));
}

bool has_refraction_axis(const EyeData& eye) {
  return has_axis(eye.prescription.value("cylinder_D", Json()));
}

/// A lens of the eye, whose axis is told where the eye's refraction has one.
std::string told_of(const EyeData& eye, const std::string& lens) {
  return has_refraction_axis(eye) ? lens : without_axis(lens);
}

/// Each lens that was searched for its own sharpest image, and the conversion to the corneal plane.
Table lens_table(const Eyes& eyes) {
  Table table{"Best lens of each kind, before and after rounding", {"Lens"}, {}};
  for (const auto* eye : eyes)
    for (const char* column : {"", " rounded", " sharpness"})
      table.header.push_back(short_name(*eye) + column);
  for (const auto& kind : kinds_of(eyes)) {
    std::vector<std::string> row{name_of(kind, eyes)};
    for (const auto* eye : eyes) {
      const Json lens = lens_of(*eye, kind);
      const auto sharpness = value_of(lens, "sharpness");
      const std::string rounded =
          lens.is_object() ? lens.value("rounded_text", std::string()) : std::string();
      row.insert(row.end(),
                 {told_of(*eye, refraction_of(lens)), rounded.empty() ? "\u2013" : told_of(*eye, rounded),
                  sharpness ? fixed(*sharpness, 4) : "\u2013"});
    }
    table.rows.push_back(row);
  }
  std::vector<std::string> converted{"Prescription converted to the cornea"};
  for (const auto* eye : eyes) {
    const Json lens = eye->prescription.value("contact_lens", Json());
    const Json rounded = lens.is_object() ? lens.value("rounded", Json()) : Json();
    converted.insert(converted.end(),
                     {told_of(*eye, refraction_of(lens)), told_of(*eye, refraction_of(rounded)), "\u2013"});
  }
  if (std::any_of(converted.begin() + 1, converted.end(),
                  [](const std::string& cell) { return cell != "\u2013"; }))
    table.rows.push_back(converted);
  return table;
}

Table meniscus_table(const Eyes& eyes) {
  Table table{"Toric meniscus", {"Quantity"}, {}};
  std::vector<std::string> material{"Material"};
  bool any = false;
  for (const auto* eye : eyes) {
    table.header.push_back(short_name(*eye));
    const Json lens = lens_of(*eye, "toric meniscus");
    const std::string name = lens.is_object() ? lens.value("material", std::string()) : std::string();
    any = any || !name.empty();
    material.push_back(name.empty() ? "\u2013" : name);
  }
  if (any) table.rows.push_back(material);
  for (const EyeRow& row : {EyeRow{"index", "Refractive index", {3, false, ""}},
                            {"abbe", "Abbe number", {1, false, ""}},
                            {"base_D", "Base curve (front)", dioptres},
                            {"centre_thickness_mm", "Centre thickness", millimetres}}) {
    std::vector<std::string> cells{row.name};
    bool is_known = false;
    for (const auto* eye : eyes) {
      const auto value = value_of(lens_of(*eye, "toric meniscus"), row.pointer);
      is_known = is_known || value.has_value();
      cells.push_back(value ? format(*value, row.style) : "\u2013");
    }
    if (is_known) table.rows.push_back(cells);
  }
  return table;
}

const std::vector<EyeRow>& cylinder_rows() {
  static const std::vector<EyeRow> rows{
      {"/plano_cylinder/radius_mm", "Radius of the back surface", {1, true, "mm"}},
      {"/plano_cylinder/power_D", "Power", dioptres},
      {"/plano_cylinder/axis_deg", "Axis (meridian without power)", {0, false, "axis"}, has_refraction_axis},
      {"/plano_cylinder/index", "Refractive index", {3, false, ""}},
      {"/plano_cylinder/vertex_distance_mm", "In front of the cornea", {1, false, "mm"}},
      {"/plano_cylinder/sharpness", "Sharpness reached", {4, false, ""}}};
  return rows;
}

const std::vector<EyeRow>& implant_rows() {
  static const std::vector<EyeRow> rows{
      {"/what_if/intra_ocular_lens/ray_traced_D", "By ray tracing", dioptres},
      {"/what_if/intra_ocular_lens/srkt_D", "SRK/T", dioptres},
      {"/what_if/intra_ocular_lens/holladay_1_D", "Holladay 1", dioptres},
      {"/what_if/intra_ocular_lens/hoffer_q_D", "Hoffer Q", dioptres},
      {"/what_if/intra_ocular_lens/haigis_D", "Haigis", dioptres},
      {"/what_if/intra_ocular_lens/target_M_D", "Target spherical equivalent", dioptres},
      {"/what_if/intra_ocular_lens/target_vertex_distance_mm", "Target's vertex distance", {1, false, "mm"}},
      {"/what_if/intra_ocular_lens/a_constant", "A constant", {1, false, ""}},
      // With a refraction that was given these are not the biometry's: it has moved the eye.
      {"/what_if/intra_ocular_lens/keratometry_D", "Mean K that the formulas took", {2, false, "D"}},
      {"/what_if/intra_ocular_lens/axial_length_mm", "Axial length that they took", {2, false, "mm"}},
      {"/what_if/intra_ocular_lens/anterior_chamber_depth_mm",
       "Chamber depth that they took",
       {2, false, "mm"}},
      {"/what_if/intra_ocular_lens/position_mm", "Lens plane behind the cornea", {2, false, "mm"}}};
  return rows;
}

/// The powers with the intervals that stand beside them: "srkt_D" and "srkt_ci95_D".
Table implant_table(const Eyes& eyes) {
  Table table{
      "Intraocular lens for a target refraction, for information, no plan for surgery", {"Quantity"}, {}};
  for (const auto* eye : eyes)
    for (const char* column : {"", " 95 % interval"}) table.header.push_back(short_name(*eye) + column);
  for (const EyeRow& row : implant_rows()) {
    const Json::json_pointer interval_at(row.pointer.substr(0, row.pointer.rfind('_')) + "_ci95_D");
    std::vector<std::string> cells{row.name};
    bool is_known = false;
    for (const auto* eye : eyes) {
      const auto value = value_at(eye->prescription, row.pointer);
      is_known = is_known || value.has_value();
      const Json interval = eye->prescription.value(interval_at, Json());
      cells.push_back(value ? format(*value, row.style) : "\u2013");
      cells.push_back(value && interval.is_array()
                          ? format_interval({*value, interval.get<std::array<double, 2>>(), ""}, row.style)
                          : "");
    }
    if (is_known) table.rows.push_back(cells);
  }
  return table;
}

const std::vector<EyeRow>& ablation_rows() {
  static const std::vector<EyeRow> rows{
      {"/what_if/ablation/optical_zone_mm", "Optical zone", millimetres},
      {"/what_if/ablation/central_depth_um", "Depth at the centre", {1, false, "\u00b5m"}},
      {"/what_if/ablation/deepest_um", "Deepest", {1, false, "\u00b5m"}},
      {"/what_if/ablation/residual/M_D", "Left over (least spot), M", dioptres},
      {"/what_if/ablation/residual/J0_D", "Left over (least spot), J0", dioptres},
      {"/what_if/ablation/residual/J45_D", "Left over (least spot), J45", dioptres}};
  return rows;
}

const std::vector<EyeRow>& accommodation_rows() {
  static const std::vector<EyeRow> rows{
      {"/what_if/accommodation/age_years", "Age", {0, false, "years"}},
      {"/what_if/accommodation/amplitude_D", "Amplitude, mean for the age", {2, false, "D"}},
      {"/what_if/accommodation/minimum_amplitude_D", "Amplitude, least for the age", {2, false, "D"}},
      {"/what_if/accommodation/far_point_mm", "Far point without a lens, from the cornea", {0, false, "mm"}},
      {"/what_if/accommodation/near_point_mm",
       "Near point without a lens, from the cornea",
       {0, false, "mm"}},
      {"/what_if/accommodation/near_point_with_lens_mm",
       "Near point with the lens, from the cornea",
       {0, false, "mm"}}};
  return rows;
}

Table pupil_table(const Eyes& eyes) {
  PowerTable table("The refraction of least spot at other pupils (iris apertures)", "Pupil", eyes, dioptres);
  std::map<double, std::vector<Json>> by_pupil;
  for (std::size_t i = 0; i < eyes.size(); ++i) {
    const Json::json_pointer pointer("/what_if/pupil");
    if (!eyes[i]->prescription.contains(pointer)) continue;
    for (const auto& line : eyes[i]->prescription.at(pointer)) {
      auto& powers = by_pupil[value_of(line, "pupil_mm").value_or(0)];
      powers.resize(eyes.size());
      powers[i] = line;
    }
  }
  for (const auto& [pupil_mm, powers] : by_pupil) table.add(format(pupil_mm, millimetres), powers);
  return table.table();
}

}  // namespace

Section lenses_section(const CaseData& data) {
  Section section{"lenses", "The same correction in other forms", {}};
  Eyes prescribed, refracted;
  for (const auto& eye : data.eyes) {
    const Judgement judgement = judge(data, eye);
    if (judgement.has_prescription) prescribed.push_back(&eye);
    if (judgement.has_refraction) refracted.push_back(&eye);
  }
  const auto add = [&](Table table, Paper paper) {
    if (!table.rows.empty()) section.blocks.push_back({std::move(table), paper});
  };
  const auto rows = [&](const char* caption, const Eyes& eyes, const std::vector<EyeRow>& of) {
    return eye_table(caption, eyes, &EyeData::prescription, of);
  };
  // What has the form of a prescription is for eyes that have one.
  add(lens_table(prescribed), Paper::if_room);
  add(meniscus_table(prescribed), Paper::never);
  add(rows("Best plano-cylinder", prescribed, cylinder_rows()), Paper::never);
  add(implant_table(prescribed), Paper::if_room);
  add(rows("Laser ablation for this refraction, for information, no plan for surgery", prescribed,
           ablation_rows()),
      Paper::never);
  add(pupil_table(refracted), Paper::never);
  add(rows("Accommodation", refracted, accommodation_rows()), Paper::never);
  // Before the numbers, so that none is read without it.
  if (!section.blocks.empty())
    section.blocks.insert(
        section.blocks.begin(),
        SectionBlock{
            Paragraph{
                "Nothing here is a plan for surgery: formulas want optical biometry and the surgeon's own constants. "
                "Where the result above is an estimate, nothing here is to be ordered. Each form shares the interval of the spherical equivalent above, but for the intraocular lens: it takes "
                "the place of the eye's own, and its power is as uncertain as length and cornea make it; how well a "
                "formula tells where it comes to stand is not in that. Amplitudes are Hofstetter's (1950)."},
            Paper::never});
  return section;
}

}  // namespace emmetrope::report
