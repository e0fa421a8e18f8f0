#pragma once

namespace emmetrope::raytrace {

/// The ten Sloan letters, drawn on their 5 x 5 grid with strokes one unit wide (Sloan 1959; NAS-NRC 1980).
inline constexpr const char* sloan_letters = "CDHKNORSVZ";

/// Whether (x, y) is ink; the letter fills 0 to 5, x to the right and y up.
bool sloan_ink(char letter, double x, double y);

/// Landolt ring of outer diameter 5, stroke and gap 1 (ISO 8596), centred at the origin; gap at `gap_deg`
/// from the right, counter-clockwise.
bool landolt_ink(double x, double y, double gap_deg);

/// Tumbling E of 5 x 5 units centred at the origin, its open side at `open_deg` from the right,
/// counter-clockwise.
bool tumbling_e_ink(double x, double y, double open_deg);

}  // namespace emmetrope::raytrace
