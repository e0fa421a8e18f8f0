#pragma once

namespace emmetrope {

/// Beyond this astigmatic axes, which are given against the scanner, are not the patient's own.
inline constexpr double largest_head_roll_deg = 3;

}  // namespace emmetrope
