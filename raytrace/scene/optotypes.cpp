#include "raytrace/scene/optotypes.hpp"

#include <cmath>

#include "pipeline/base/frames.hpp"

namespace emmetrope::raytrace {
namespace {

bool within(double value, double low, double high) { return value >= low && value <= high; }

/// Ring of stroke 1 along the inside of a disc.
bool ring(double x, double y, double outer) {
  const double r = std::hypot(x, y);
  return r <= outer && r >= outer - 1;
}

/// Stroke one unit wide (measured across) whose centre line runs from (x0, y0) to (x1, y1), without ends.
bool stroke(double x, double y, double x0, double y0, double x1, double y1) {
  const double length = std::hypot(x1 - x0, y1 - y0);
  return std::abs((x - x0) * (y1 - y0) - (y - y0) * (x1 - x0)) <= 0.5 * length;
}

/// Ring of stroke 1 along the inside of a stadium 5 wide and 3 high whose lower side is at y = base.
bool stadium(double x, double y, double base) {
  const double dx = std::max(0.0, std::abs(x - 2.5) - 1);
  return ring(dx, y - base - 1.5, 1.5);
}

}  // namespace

bool sloan_ink(char letter, double x, double y) {
  if (!within(x, 0, 5) || !within(y, 0, 5)) return false;
  const bool left = x <= 1, right = x >= 4;
  switch (letter) {
    case 'C':
      return landolt_ink(x - 2.5, y - 2.5, 0);
    case 'O':
      return ring(x - 2.5, y - 2.5, 2.5);
    case 'D':
      return left || (x <= 2.5 ? (y <= 1 || y >= 4) : ring(x - 2.5, y - 2.5, 2.5));
    case 'H':
      return left || right || within(y, 2, 3);
    case 'K':
      return left || stroke(x, y, 1, 1.8, 4.6, 5.4) || (stroke(x, y, 1.9, 2.9, 4.5, 0) && x >= 2 && y <= 3.3);
    case 'N':
      return left || right || stroke(x, y, 0.6, 5, 4.4, 0);
    case 'R': {
      const bool bowl = x >= 3.5 ? ring(x - 3.5, y - 3.5, 1.5) : (within(y, 2, 3) || y >= 4);
      return left || bowl || (stroke(x, y, 2.2, 2.4, 4.4, 0) && y <= 2.5 && x >= 2);
    }
    case 'S':
      return (stadium(x, y, 2) && !(x > 2.5 && y < 3.5 && y > 3) && !(x > 3.5 && y < 3.5)) ||
             (stadium(x, y, 0) && !(x < 2.5 && y > 1.5 && y < 2) && !(x < 1.5 && y > 1.5));
    case 'V':
      return y >= 0 && (x <= 2.5 ? stroke(x, y, 0.54, 5, 2.5, 0.1) : stroke(x, y, 4.46, 5, 2.5, 0.1));
    case 'Z':
      return y <= 1 || y >= 4 || stroke(x, y, 0.64, 0.4, 4.36, 4.6);
    default:
      return false;
  }
}

bool landolt_ink(double x, double y, double gap_deg) {
  const double c = std::cos(gap_deg * degree), s = std::sin(gap_deg * degree);
  const bool gap = c * x + s * y > 0 && std::abs(c * y - s * x) < 0.5;
  return ring(x, y, 2.5) && !gap;
}

bool tumbling_e_ink(double x, double y, double open_deg) {
  const double c = std::cos(open_deg * degree), s = std::sin(open_deg * degree);
  const double u = c * x + s * y, v = std::abs(c * y - s * x);
  return std::abs(u) <= 2.5 && v <= 2.5 && (u <= -1.5 || v <= 0.5 || v >= 1.5);
}

}  // namespace emmetrope::raytrace
