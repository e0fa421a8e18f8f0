#pragma once
#include <optional>
#include <vector>

#include "pipeline/base/json.hpp"
#include "pipeline/report/document/document.hpp"

/// The back of the eye as a map of heights over its best-fit sphere (docs/method/retinal-shape.md).
namespace emmetrope::report {

/// Heights at rings of equal eccentricity and meridians of equal distance; the first ring is the pole alone.
struct RetinaMap {
  double ring_step_deg = 0, meridian_step_deg = 0;
  std::vector<std::vector<double>> height_mm, half_ci95_mm;  ///< by ring, then meridian

  double reach_deg() const { return ring_step_deg * static_cast<double>(height_mm.size() - 1); }
  double largest_height_mm() const;
  /// Smooth (Catmull-Rom) through the heights, or through the halves of their intervals.
  double at(const std::vector<std::vector<double>>& rings, double eccentricity_deg,
            double meridian_deg) const;
};

/// `retina.map` of biometry.json; nothing where it is withheld or is no such map.
std::optional<RetinaMap> read_retina_map(const Json& retina);

/// As the examiner sees it, the patient's left on the right; grey where a height is within its own interval.
/// \param range_mm  the colours end here and at minus this
/// \return false where gnuplot is missing
bool draw_retina_map(Figure& figure, const RetinaMap& map, double range_mm, bool is_right_eye);

}  // namespace emmetrope::report
