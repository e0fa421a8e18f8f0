#include "segmentation/fit/edge_response.hpp"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <utility>

#include "pipeline/base/frames.hpp"
#include "segmentation/fit/rician.hpp"

namespace emmetrope::segmentation {
namespace {

/// 1/2 + Si(pi t) / pi by Simpson's rule on a fine grid.
double edge_by_quadrature(double t) {
  const int steps = 20000;
  const double h = t / steps;
  const auto sinc = [](double x) { return std::abs(x) < 1e-12 ? 1 : std::sin(pi * x) / (pi * x); };
  double sum = sinc(0) + sinc(t);
  for (int i = 1; i < steps; ++i) sum += (i % 2 ? 4 : 2) * sinc(i * h);
  return 0.5 + sum * h / 3;
}

TEST(EdgeResponse, IsTheSineIntegral) {
  for (const double t : {-7.3, -1.0, -0.21, 0.0, 0.4, 1.0, 2.77, 11.1}) {
    EXPECT_NEAR(edge_response(t), edge_by_quadrature(t), 1e-8) << t;
  }
  EXPECT_NEAR(edge_response(1), 1.0895, 1e-4);  // Wilbraham and Gibbs
}

TEST(EdgeResponse, AverageEqualsTheMeanOfManyThinSlices) {
  for (const double t : {-3.0, -0.3, 0.1, 1.7}) {
    for (const double h : {0.01, 0.3, 2.5, 40.0}) {
      double mean = 0;
      const int n = 4000;
      for (int i = 0; i < n; ++i) mean += edge_response(t + h * ((2.0 * i + 1) / n - 1)) / n;
      EXPECT_NEAR(averaged_edge(t, h, 0).value, mean, 2e-4) << t << ' ' << h;
    }
  }
}

TEST(EdgeResponse, DerivativesMatchDifferences) {
  const double step = 1e-4, wider = 1 + step, narrower = 1 - step;
  for (const double t : {-3.0, -0.3, 0.1, 1.7})
    for (const double h : {0.001, 0.3, 2.5})
      for (const double filter : {-0.4, 0.0, 0.7}) {
        const auto at = [](double edge, double stretch, double f) {
          return averaged_edge(edge, stretch, f).value;
        };
        const EdgeValue e = averaged_edge(t, h, filter);
        EXPECT_NEAR(e.derivative, (at(t + step, h, filter) - at(t - step, h, filter)) / (2 * step), 1e-4);
        EXPECT_NEAR(e.scale_derivative,
                    (at(t * wider, h * wider, filter) - at(t * narrower, h * narrower, filter)) / (2 * step),
                    1e-4);
        EXPECT_NEAR(e.filter_derivative, at(t, h, filter + 0.5) - at(t, h, filter - 0.5), 1e-9);
      }
}

TEST(EdgeResponse, DerivativesOfAnEdgeAskewMatchDifferences) {
  const double step = 1e-4, wider = 1 + step, narrower = 1 - step;
  for (const double t : {-3.0, -0.3, 0.1, 1.7})
    for (const double h : {0.001, 0.3})
      for (const auto& [askew, f] : {std::pair{0.2, 0.7}, {1.3, 0.7}, {1.3, 0.0}, {0.5, -0.4}}) {
        const auto at = [](double edge, double stretch, double f, double askew_squared) {
          return averaged_edge(edge, stretch, f, askew_squared).value;
        };
        const EdgeValue e = averaged_edge(t, h, f, askew);
        EXPECT_NEAR(e.derivative, (at(t + step, h, f, askew) - at(t - step, h, f, askew)) / (2 * step), 1e-4);
        EXPECT_NEAR(
            e.scale_derivative,
            (at(t * wider, h * wider, f, askew) - at(t * narrower, h * narrower, f, askew)) / (2 * step),
            1e-4);
        EXPECT_NEAR(e.filter_derivative, (at(t, h, f + step, askew) - at(t, h, f - step, askew)) / (2 * step),
                    1e-6);
        EXPECT_NEAR(e.askew_derivative, (at(t, h, f, askew + step) - at(t, h, f, askew - step)) / (2 * step),
                    1e-4);
      }
}

/// An edge whose frequencies up to the cut-off are damped: 1/2 + the sum of W(k) sin(pi k t) / (pi k).
double damped_edge(double t, double (*window)(double)) {
  const int steps = 20000;
  double sum = 0;
  for (int i = 0; i < steps; ++i) {
    const double k = (i + 0.5) / steps;
    sum += window(k) * std::sin(pi * k * t) / (pi * k) / steps;
  }
  return 0.5 + sum;
}

TEST(EdgeResponse, OfAFilterOfOneIsThatOfAHannWindow) {
  for (const double t : {-3.3, -1.0, -0.2, 0.0, 0.6, 1.9, 5.0})
    EXPECT_NEAR(averaged_edge(t, 0, 1).value,
                damped_edge(t, [](double k) { return 0.5 + 0.5 * std::cos(pi * k); }), 1e-6)
        << t;
}

/// A plane edge askew to three axes that are each cut off at 1/mm and filtered by f: 1/2 + the integral of the product of the
/// windows, each at k n_i, times sin(2 pi k s) / (pi k), up to where the first of them ends.
double filtered_along_each_axis(double within_mm, const Eigen::Vector3d& normal, double f) {
  const double cutoff = 1 / normal.maxCoeff();
  const int steps = 4000;
  double sum = 0;
  for (int i = 0; i < steps; ++i) {
    const double k = cutoff * (i + 0.5) / steps;
    double window = 1;
    for (const double n : normal) window *= 1 - f / 2 + f / 2 * std::cos(pi * k * n);
    sum += window * std::sin(2 * pi * k * within_mm) / (pi * k) * cutoff / steps;
  }
  return 0.5 + sum;
}

TEST(EdgeResponse, AskewToTheAxesIsFilteredByAllOfThem) {
  for (const Eigen::Vector3d& direction :
       {Eigen::Vector3d(1, 0, 0), {1, 1, 0}, {3, 2, 0}, {1, 1, 1}, {3, 2, 1}, {1, 0.2, 0.1}})
    for (const double f : {0.25, 0.6, 1.0}) {
      const Eigen::Vector3d n = direction.normalized();
      const double cutoff = 1 / n.maxCoeff(), askew_squared = cutoff * cutoff - 1;
      double largest = 0, of_one_axis = 0;
      for (double s = -1.5; s <= 1.5; s += 0.05) {
        const double filtered = filtered_along_each_axis(s, n, f), t = 2 * cutoff * s;
        largest = std::max(largest, std::abs(averaged_edge(t, 0, f, askew_squared).value - filtered));
        of_one_axis = std::max(of_one_axis, std::abs(averaged_edge(t, 0, f).value - filtered));
      }
      // Two filters beside the first move the image by several distances, one by one.
      EXPECT_LT(largest, direction.minCoeff() > 0.5 ? 0.025 : 0.01) << direction.transpose() << ", f " << f;
      if (askew_squared > 0.9) {
        EXPECT_GT(of_one_axis, 3 * largest) << direction.transpose() << ", f " << f;
      }
    }
}

// The signal's decay along an echo train to exp(-1) has a cusp in the middle, which no window of this form has.
TEST(EdgeResponse, ComesNearToTheDecayAlongAnEchoTrain) {
  constexpr double filter = 0.65, reach = 1.04;
  double largest = 0, of_unfiltered = 0;
  for (double t = -4; t <= 4; t += 0.05) {
    const double decayed = damped_edge(t, [](double k) { return std::exp(-k); });
    largest = std::max(largest, std::abs(averaged_edge(reach * t, 0, filter).value - decayed));
    of_unfiltered = std::max(of_unfiltered, std::abs(averaged_edge(reach * t, 0, 0).value - decayed));
  }
  EXPECT_LT(largest, 0.06);
  EXPECT_GT(of_unfiltered, 2 * largest);
}

TEST(Rician, MomentsMatchQuadrature) {
  for (const double nu : {0.0, 0.5, 2.0, 5.0, 11.9, 20.0}) {
    double norm = 0, mean = 0, square = 0;
    const double step = 1e-3;
    for (double m = step / 2; m < nu + 12; m += step) {
      // exp(-(m - nu)^2 / 2) times the scaled Bessel function keeps the product finite.
      const double x = m * nu;
      const double scaled = x < 600 ? std::cyl_bessel_i(0, x) * std::exp(-x) : 1 / std::sqrt(2 * pi * x);
      const double p = m * std::exp(-(m - nu) * (m - nu) / 2) * scaled;
      norm += p * step;
      mean += p * m * step;
      square += p * m * m * step;
    }
    EXPECT_NEAR(norm, 1, 1e-3);
    const RicianMean r = rician(nu);
    EXPECT_NEAR(r.mean, mean / norm, 1e-3) << nu;
    EXPECT_NEAR(r.deviation, std::sqrt(square / norm - mean * mean / norm / norm), 2e-3) << nu;
    EXPECT_NEAR(r.derivative,
                (rician(nu + 0.05).mean - rician(std::max(nu - 0.05, 0.0)).mean) / (nu < 0.05 ? 0.05 : 0.1),
                0.02);
  }
}

}  // namespace
}  // namespace emmetrope::segmentation
