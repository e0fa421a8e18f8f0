#pragma once
#include <optional>
#include <vector>

#include "pipeline/base/laterality.hpp"
#include "pipeline/base/power_vector.hpp"
#include "pipeline/report/document/document.hpp"

/// Refraction over the visual field as a map, relative to its centre.
namespace emmetrope::report {

/// One direction of the field, against the eye's axis, towards the patient's left and up.
struct FieldDirection {
  double horizontal_deg = 0, vertical_deg = 0;
  PowerVector refraction;
};

/// Directions on a square grid about the eye's axis, which is one of them.
struct FieldMap {
  double step_deg = 0;
  int rings = 0;  ///< steps from the centre to the rim: 2 rings + 1 directions across
  PowerVector centre;
  std::vector<FieldDirection> directions;  ///< those that the retina sees

  double reach_deg() const { return rings * step_deg; }
  int unseen() const;
  /// M less that of the centre; nothing in a direction that the retina does not see.
  std::optional<double> relative_sphere_D(double horizontal_deg, double vertical_deg) const;
};

/// Nothing where the directions are no such grid, or their centre is missing.
std::optional<FieldMap> make_field_map(std::vector<FieldDirection> directions);

/// What the maps of both eyes share.
struct FieldScale {
  double relative_M_D = 1;  ///< whole; the colours end here and at minus this
  double line_per_D = 0.5;  ///< of a cylinder's line, in sides of a cell
};
FieldScale common_scale(const std::vector<FieldMap>& maps);

/// As the patient looks out: the patient's left on the left, up at the top. A cell a direction, coloured by its
/// relative M, with the number where it fits; a line along the axis of the minus cylinder, as long as its
/// power. Follows the page's light or dark scheme.
/// \return svg, width_px and height_px
Figure draw_peripheral_map(const std::string& id, const FieldMap& map, const FieldScale& scale,
                           Laterality eye);

}  // namespace emmetrope::report
