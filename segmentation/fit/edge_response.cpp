#include "segmentation/fit/edge_response.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "pipeline/base/frames.hpp"

namespace emmetrope::segmentation {
namespace {

double sinc(double t) {
  const double x = pi * t;
  return std::abs(x) < 1e-8 ? 1.0 : std::sin(x) / x;
}

/// E, EI and E' on a grid. Beyond the table's end the ringing (below 1 / (pi^2 t) = 0.3 %) is left out.
class EdgeTable {
 public:
  static constexpr double end = 32;
  static constexpr int per_unit = 64;

  EdgeTable() {
    const int count = static_cast<int>(2 * end) * per_unit + 1;
    e_.resize(count);
    integral_.resize(count);
    slope_.resize(count);
    const int middle = count / 2;
    e_[middle] = 0.5;
    slope_[middle] = 1;
    const double step = 1.0 / per_unit;
    // Si by Simpson's rule from the middle outwards; E(-t) = 1 - E(t).
    for (int i = middle + 1; i < count; ++i) {
      const double t = (i - middle) * step;
      slope_[i] = sinc(t);
      e_[i] = e_[i - 1] + step / 6 * (sinc(t - step) + 4 * sinc(t - step / 2) + sinc(t));
    }
    for (int i = 0; i < middle; ++i) {
      slope_[i] = slope_[count - 1 - i];
      e_[i] = 1 - e_[count - 1 - i];
    }
    // The antiderivative in closed form: t/2 + (t Si(pi t) + cos(pi t) / pi) / pi.
    for (int i = 0; i < count; ++i) {
      const double t = (i - middle) * step;
      integral_[i] = t * e_[i] + std::cos(pi * t) / (pi * pi);
    }
  }

  double e(double t) const {
    if (t <= -end) return 0;
    if (t >= end) return 1;
    return hermite(e_, slope_, t);
  }
  double integral(double t) const {
    if (t <= -end) return integral_.front();
    if (t >= end) return integral_.back() + (t - end);
    return hermite(integral_, e_, t);
  }

 private:
  static double hermite(const std::vector<double>& f, const std::vector<double>& df, double t) {
    const double x = (t + end) * per_unit;
    const int i = std::min(static_cast<int>(x), static_cast<int>(f.size()) - 2);
    const double u = x - i, v = 1 - u, step = 1.0 / per_unit;
    return f[i] * v * v * (1 + 2 * u) + f[i + 1] * u * u * (1 + 2 * v) +
           step * u * v * (df[i] * v - df[i + 1] * u);
  }

  std::vector<double> e_, integral_, slope_;
};

const EdgeTable& table() {
  static const EdgeTable instance;
  return instance;
}

}  // namespace

double edge_response(double t) { return table().e(t); }

EdgeValue averaged_edge(double t, double h) {
  const EdgeTable& edge = table();
  if (t - h >= EdgeTable::end) return {1, 0, 0};
  if (t + h <= -EdgeTable::end) return {0, 0, 0};
  // Below this the difference of antiderivatives loses digits, and the average differs from E by h^2 E'' / 6
  // < 2e-4.
  constexpr double shortest_stretch = 0.02;
  if (h < shortest_stretch) return {edge.e(t), sinc(t), t * sinc(t)};
  const double ahead = edge.e(t + h), behind = edge.e(t - h);
  const double value = (edge.integral(t + h) - edge.integral(t - h)) / (2 * h);
  const double derivative = (ahead - behind) / (2 * h);
  return {value, derivative, t * derivative + (ahead + behind) / 2 - value};
}

}  // namespace emmetrope::segmentation
