#include "segmentation/fit/rician.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "pipeline/base/frames.hpp"

namespace emmetrope::segmentation {
namespace {

double exact_mean(double a) {
  // L_1/2(-x) = e^(-x/2) [(1 + x) I0(x/2) + x I1(x/2)], x = a^2 / 2.
  const double half = a * a / 4;
  return std::sqrt(pi / 2) * std::exp(-half) *
         ((1 + 2 * half) * std::cyl_bessel_i(0, half) + 2 * half * std::cyl_bessel_i(1, half));
}

/// d mean / da = sqrt(pi/2) a/2 e^(-x/2) [I0(x/2) + I1(x/2)]
double exact_derivative(double a) {
  const double half = a * a / 4;
  return std::sqrt(pi / 2) * a / 2 * std::exp(-half) *
         (std::cyl_bessel_i(0, half) + std::cyl_bessel_i(1, half));
}

constexpr int per_unit = 64;
constexpr int table_end = 12;

struct Table {
  std::array<double, table_end * per_unit + 2> mean, derivative;
  Table() {
    for (std::size_t i = 0; i < mean.size(); ++i) {
      mean[i] = exact_mean(static_cast<double>(i) / per_unit);
      derivative[i] = exact_derivative(static_cast<double>(i) / per_unit);
    }
  }
};

}  // namespace

RicianMean rician(double a) {
  static const Table table;
  a = std::max(a, 0.0);
  double mean, derivative;
  if (a >= table_end) {
    mean = a + 1 / (2 * a) + 1 / (8 * a * a * a);
    derivative = 1 - 1 / (2 * a * a) - 3 / (8 * a * a * a * a);
  } else {
    const double x = a * per_unit;
    const int i = static_cast<int>(x);
    const double u = x - i;
    mean = table.mean[i] * (1 - u) + table.mean[i + 1] * u;
    derivative = table.derivative[i] * (1 - u) + table.derivative[i + 1] * u;
  }
  return {mean, derivative, std::sqrt(std::max(a * a + 2 - mean * mean, 0.1))};
}

}  // namespace emmetrope::segmentation
