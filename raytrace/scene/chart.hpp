#pragma once
#include <string>
#include <vector>

#include "raytrace/scene/scene_model.hpp"

namespace emmetrope::raytrace {

/// What is looked at is not nearer to the eye than this.
inline constexpr double least_distance_mm = 20;

/// A chart as it is asked for: "letters:logmar=0.3,distance_mm=6000".
struct ChartSpec {
  std::string name = "letters";
  double distance_mm = 6000;  ///< from the corneal apex; infinity allowed
  double logmar = 0;          ///< log10 of the detail (stroke, gap, bar) in minutes of arc
  bool logmar_given = false;  ///< without it letters, landolt and tumbling-e have rows of falling size
  double extent_deg = 21;     ///< width and height of the chart
  double contrast = 1;        ///< of the ink: (white - ink) / white
  double spokes = 36;         ///< of the siemens star: dark sectors
};

/// \throw Error (usage) for an unknown name, key or value
ChartSpec parse_chart(const std::string& text);
std::vector<std::string> chart_names();

/// Of the rows of optotypes, from the top; one where all have one size; none on a chart without optotypes.
std::vector<double> logmar_of_rows(const ChartSpec& spec);

/// Draws the chart from its definition: the share of ink in every texel, from the exact outlines.
/// \param shown  the middle part of its width and height that is drawn, above 0 to 1
Scene draw_chart(const ChartSpec& spec, const Eigen::Vector2d& shown = {1, 1});

}  // namespace emmetrope::raytrace
