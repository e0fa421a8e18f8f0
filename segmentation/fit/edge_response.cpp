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

/// sinc(t) + filter ((sinc(t - 1) + sinc(t + 1)) / 4 - sinc(t) / 2), by one sine.
double filtered_sinc(double t, double filter) {
  const double sine = std::sin(pi * t) / pi;
  const auto over = [](double numerator, double x) { return std::abs(x) < 1e-6 ? 1.0 : numerator / x; };
  const double middle = over(sine, t);
  return middle + filter * ((over(-sine, t - 1) + over(-sine, t + 1)) / 4 - middle / 2);
}

/// The edge and what a filter adds to it, each with its antiderivative.
struct EdgeTerms {
  double edge = 0, integral = 0, filtered = 0, filtered_integral = 0;
};

/// E, F and their antiderivatives, by Hermite's cubic between the points of a grid. Beyond the table's end the ringing
/// (below 1 / (pi^2 t) = 0.3 %) is left out.
class EdgeTable {
 public:
  static constexpr double end = 32;

  EdgeTable() {
    std::vector<EdgeTerms> wider;  // a unit more at either end
    std::vector<double> slope;
    const int middle = static_cast<int>(end + 1) * per_unit, count = 2 * middle + 1;
    wider.resize(static_cast<std::size_t>(count));
    slope.resize(static_cast<std::size_t>(count));
    const auto at = [](auto& of, int i) -> auto& { return of[static_cast<std::size_t>(i)]; };
    at(wider, middle).edge = 0.5;
    // Si by Simpson's rule from the middle outwards; E(-t) = 1 - E(t).
    for (int i = middle; i < count; ++i) {
      const double t = (i - middle) * step;
      at(slope, i) = at(slope, 2 * middle - i) = sinc(t);
      if (i > middle)
        at(wider, i).edge =
            at(wider, i - 1).edge + step / 6 * (sinc(t - step) + 4 * sinc(t - step / 2) + sinc(t));
      at(wider, 2 * middle - i).edge = 1 - at(wider, i).edge;
    }
    // The antiderivative in closed form: t/2 + (t Si(pi t) + cos(pi t) / pi) / pi.
    for (int i = 0; i < count; ++i) {
      const double t = (i - middle) * step;
      at(wider, i).integral = t * at(wider, i).edge + std::cos(pi * t) / (pi * pi);
    }
    const auto filtered = [&](int i, auto value) {
      return (value(i - per_unit) + value(i + per_unit)) / 4 - value(i) / 2;
    };
    for (int i = per_unit; i < count - per_unit; ++i) {
      Point& point = points_.emplace_back();
      point.value = at(wider, i);
      point.value.filtered = filtered(i, [&](int k) { return at(wider, k).edge; });
      point.value.filtered_integral = filtered(i, [&](int k) { return at(wider, k).integral; });
      point.slope = {at(slope, i), point.value.edge, filtered(i, [&](int k) { return at(slope, k); }),
                     point.value.filtered};
    }
  }

  EdgeTerms operator()(double t) const {
    if (t <= -end) return {0, points_.front().value.integral, 0, 0};
    if (t >= end) return {1, points_.back().value.integral + (t - end), 0, 0};
    const double x = (t + end) * per_unit;
    const std::size_t i = std::min(static_cast<std::size_t>(x), points_.size() - 2);
    const Point &a = points_[i], &b = points_[i + 1];
    const double u = x - static_cast<double>(i), v = 1 - u;
    const double of_a = v * v * (1 + 2 * u), of_b = u * u * (1 + 2 * v), of_slope_a = step * u * v * v,
                 of_slope_b = -step * u * u * v;
    const auto between = [&](double EdgeTerms::*term) {
      return of_a * a.value.*term + of_b * b.value.*term + of_slope_a * a.slope.*term +
             of_slope_b * b.slope.*term;
    };
    return {between(&EdgeTerms::edge), between(&EdgeTerms::integral), between(&EdgeTerms::filtered),
            between(&EdgeTerms::filtered_integral)};
  }

 private:
  static constexpr int per_unit = 64;
  static constexpr double step = 1.0 / per_unit;

  struct Point {
    EdgeTerms value, slope;
  };
  std::vector<Point> points_;
};

const EdgeTable& table() {
  static const EdgeTable instance;
  return instance;
}

/// Along one axis.
EdgeValue straight_edge(double t, double h, double filter) {
  if (t - h >= EdgeTable::end) return {1, 0, 0, 0, 0};
  if (t + h <= -EdgeTable::end) return {0, 0, 0, 0, 0};
  // Below this the difference of antiderivatives loses digits, and the average differs from E by h^2 E'' / 6
  // < 2e-4.
  constexpr double shortest_stretch = 0.02;
  if (h < shortest_stretch) {
    const EdgeTerms at = table()(t);
    const double slope = filtered_sinc(t, filter);
    return {at.edge + filter * at.filtered, slope, t * slope, at.filtered, 0};
  }
  const EdgeTerms ahead = table()(t + h), behind = table()(t - h);
  const double edge_ahead = ahead.edge + filter * ahead.filtered,
               edge_behind = behind.edge + filter * behind.filtered;
  const double of_filter = (ahead.filtered_integral - behind.filtered_integral) / (2 * h);
  const double value = (ahead.integral - behind.integral) / (2 * h) + filter * of_filter;
  const double derivative = (edge_ahead - edge_behind) / (2 * h);
  return {value, derivative, t * derivative + (edge_ahead + edge_behind) / 2 - value, of_filter, 0};
}

}  // namespace

double edge_response(double t) { return table()(t).edge; }

EdgeValue averaged_edge(double t, double h, double filter, double askew_squared) {
  const EdgeValue middle = straight_edge(t, h, filter);
  constexpr double least_squared = 1e-3;  // moves no value by more than that
  if (askew_squared < least_squared) return middle;
  const double s = std::sqrt(askew_squared), aside = filter / 4, along = 1 - filter / 2;
  const EdgeValue ahead = straight_edge(t + s, h, filter), behind = straight_edge(t - s, h, filter);
  const auto sum = [&](double EdgeValue::*of) {
    return along * middle.*of + aside * (ahead.*of + behind.*of);
  };
  const double across = ahead.derivative - behind.derivative;
  return {sum(&EdgeValue::value), sum(&EdgeValue::derivative),
          sum(&EdgeValue::scale_derivative) - aside * s * across,
          sum(&EdgeValue::filter_derivative) + (ahead.value + behind.value) / 4 - middle.value / 2,
          aside / (2 * s) * across};
}

}  // namespace emmetrope::segmentation
