#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <functional>
#include <vector>

namespace emmetrope::correction {

struct NelderMeadResult {
  Eigen::VectorXd position;
  int evaluations = 0;
};

/// Minimises without derivatives (Nelder and Mead 1965, standard coefficients) until the simplex is smaller
/// than `tolerance`: what the derivative-based search is compared with.
inline NelderMeadResult nelder_mead(const std::function<double(const Eigen::VectorXd&)>& cost,
                                    const Eigen::VectorXd& start, double size, double tolerance) {
  struct Vertex {
    Eigen::VectorXd at;
    double cost;
  };
  NelderMeadResult result;
  const auto vertex = [&](const Eigen::VectorXd& at) {
    ++result.evaluations;
    return Vertex{at, cost(at)};
  };
  const Eigen::Index n = start.size();
  std::vector<Vertex> simplex{vertex(start)};
  for (Eigen::Index i = 0; i < n; ++i) simplex.push_back(vertex(start + size * Eigen::VectorXd::Unit(n, i)));
  const auto by_cost = [](const Vertex& a, const Vertex& b) { return a.cost < b.cost; };
  for (int iteration = 0; iteration < 1000; ++iteration) {
    std::sort(simplex.begin(), simplex.end(), by_cost);
    double extent = 0;
    for (const Vertex& v : simplex) extent = std::max(extent, (v.at - simplex.front().at).norm());
    if (extent < tolerance) break;
    Eigen::VectorXd centre = Eigen::VectorXd::Zero(n);
    for (Eigen::Index i = 0; i < n; ++i) centre += simplex[i].at / static_cast<double>(n);
    Vertex& worst = simplex.back();
    const Vertex reflected = vertex(2 * centre - worst.at);
    if (reflected.cost < simplex.front().cost) {
      const Vertex expanded = vertex(3 * centre - 2 * worst.at);
      worst = expanded.cost < reflected.cost ? expanded : reflected;
    } else if (reflected.cost < simplex[n - 1].cost) {
      worst = reflected;
    } else {
      const Vertex contracted =
          vertex(reflected.cost < worst.cost ? (centre + reflected.at) / 2 : (centre + worst.at) / 2);
      if (contracted.cost < std::min(reflected.cost, worst.cost))
        worst = contracted;
      else
        for (std::size_t i = 1; i < simplex.size(); ++i)
          simplex[i] = vertex((simplex.front().at + simplex[i].at) / 2);
    }
  }
  result.position = std::min_element(simplex.begin(), simplex.end(), by_cost)->at;
  return result;
}

}  // namespace emmetrope::correction
