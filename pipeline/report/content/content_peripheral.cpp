#include <fmt/format.h>

#include <cmath>

#include "pipeline/report/content/content.hpp"
#include "pipeline/report/content/content_tables.hpp"
#include "pipeline/report/content/judgement.hpp"
#include "pipeline/report/figures/peripheral_map.hpp"

namespace emmetrope::report {
namespace {

std::vector<FieldDirection> directions_of(const EyeData& eye) {
  std::vector<FieldDirection> directions;
  for (const auto& point : eye.prescription.value("peripheral", Json::array())) {
    const auto horizontal_deg = value_of(point, "horizontal_deg"),
               vertical_deg = value_of(point, "vertical_deg"), M_D = value_of(point, "M_D"),
               J0_D = value_of(point, "J0_D"), J45_D = value_of(point, "J45_D");
    if (horizontal_deg && vertical_deg && M_D && J0_D && J45_D)
      directions.push_back({*horizontal_deg, *vertical_deg, {*M_D, *J0_D, *J45_D}});
  }
  return directions;
}

/// "temporal +0.31 D, nasal +0.12 D, ...", at the rim, in the words of the field.
std::string at_the_rim(const FieldMap& map, Laterality eye) {
  const double temporal_deg = map.reach_deg() * (eye == Laterality::od ? -1 : 1);
  std::string text;
  for (const auto& [name, horizontal_deg, vertical_deg] :
       {std::tuple{"temporal", temporal_deg, 0.0}, std::tuple{"nasal", -temporal_deg, 0.0},
        std::tuple{"superior", 0.0, map.reach_deg()}, std::tuple{"inferior", 0.0, -map.reach_deg()}}) {
    const auto relative_D = map.relative_sphere_D(horizontal_deg, vertical_deg);
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", name,
                        relative_D ? format(*relative_D, {2, true, "D"}) : "not seen");
  }
  return text;
}

Figure map_figure(const EyeData& eye, const FieldMap& map, const FieldScale& scale) {
  Figure figure = draw_peripheral_map("peripheral-" + eye.id(), map, scale, eye.laterality);
  figure.title = short_name(eye) + ", relative peripheral refraction";
  figure.caption =
      "M at the centre " + format(map.centre.M_D, {2, true, "D"}) + ", in the plane of the entrance pupil.";
  if (const int unseen = map.unseen(); unseen > 0)
    figure.caption += fmt::format(
        " Blank: {} of {} directions, which the retina behind its equator does not see or of whose light too "
        "little comes through.",
        unseen, unseen + static_cast<int>(map.directions.size()));
  figure.alt = fmt::format(
      "Map of the refraction of {} over the visual field relative to its centre, with the astigmatism; at "
      "{:g} degrees in the field {}",
      clinical_name(eye.laterality), map.reach_deg(), at_the_rim(map, eye.laterality));
  return figure;
}

/// ", iris 3.0 mm, 555.0 nm"
std::string conditions_of(const EyeData& eye) {
  std::string text;
  if (const auto pupil_mm = value_of(eye.prescription, "pupil_mm"))
    text += ", iris aperture " + format(*pupil_mm, {1, false, "mm"});
  if (const auto wavelength_nm = value_of(eye.prescription, "wavelength_nm"))
    text += ", " + format(*wavelength_nm, {1, false, "nm"});
  return text;
}

FigureRow maps_of(const Eyes& eyes) {
  Eyes mapped;
  std::vector<FieldMap> maps;
  for (const auto* eye : eyes)
    if (auto map = make_field_map(directions_of(*eye))) {
      mapped.push_back(eye);
      maps.push_back(std::move(*map));
    }
  FigureRow row;
  const FieldScale scale = common_scale(maps);
  for (std::size_t i = 0; i < maps.size(); ++i) row.figures.push_back(map_figure(*mapped[i], maps[i], scale));
  if (maps.empty()) return row;
  row.caption =
      "M of each direction less M of the centre, both of the least spot. It is of the shape of the retina "
      "that MRI shows, through the modelled optics, for the eye as it was imaged (no lens" +
      conditions_of(*mapped.front()) +
      "). + (red) is relatively hyperopic: with the centre corrected, the image there lies behind the retina; "
      "- (blue) is relatively myopic. Lines that circle the centre and grow outwards are oblique astigmatism, "
      "lines all of one direction that of the centre. The field is as the patient looks out, the patient's "
      "left on the left, in degrees from the eye's axis; axes are mirrored with it (45\u00b0 falls to the "
      "right). A tenth of a millimetre of the retina's place is about 0.26 D.";
  return row;
}

/// "30.0 deg nasal, 10.0 deg superior": a sign would be the patient's left, which is nasal of one eye and temporal of the
/// other.
std::string direction_of(const Json& point, Laterality eye) {
  const double leftwards_deg = value_of(point, "horizontal_deg").value_or(0),
               up_deg = value_of(point, "vertical_deg").value_or(0);
  const bool is_nasal = (leftwards_deg > 0) == (eye == Laterality::od);
  std::string text;
  for (const auto& [angle_deg, side] : {std::pair{leftwards_deg, is_nasal ? "nasal" : "temporal"},
                                        {up_deg, up_deg > 0 ? "superior" : "inferior"}})
    if (angle_deg != 0)
      text += fmt::format("{}{} {}", text.empty() ? "" : ", ", format(std::abs(angle_deg), {1, false, "deg"}),
                          side);
  return text.empty() ? "on the axis" : text;
}

/// The numbers behind the colours.
Table peripheral_table(const EyeData& eye) {
  Table table{std::string("Refraction of least spot away from the axis, ") + clinical_name(eye.laterality) +
                  ", in the plane of the entrance pupil",
              {"In the visual field", "M", "J0", "J45"},
              {},
              true};
  for (const auto& point : eye.prescription.value("peripheral", Json::array())) {
    std::vector<std::string> row{direction_of(point, eye.laterality)};
    for (const char* key : {"M_D", "J0_D", "J45_D"}) {
      const auto value = value_of(point, key);
      row.push_back(value ? format(*value, {2, true, "D"}) : "\u2013");
    }
    table.rows.push_back(row);
  }
  return table;
}

}  // namespace

Section peripheral_section(const CaseData& data) {
  Section section{"peripheral", "Refraction across the visual field", {}};
  Eyes eyes;
  for (const auto& eye : data.eyes)
    if (judge(data, eye).has_refraction) eyes.push_back(&eye);
  if (FigureRow maps = maps_of(eyes); !maps.figures.empty())
    section.blocks.push_back({std::move(maps), Paper::first_if_room});
  for (const auto* eye : eyes)
    if (Table table = peripheral_table(*eye); !table.rows.empty())
      section.blocks.push_back({std::move(table), Paper::never});
  return section;
}

}  // namespace emmetrope::report
