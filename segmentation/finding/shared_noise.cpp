#include "segmentation/finding/shared_noise.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <vector>

#include "segmentation/finding/sampling.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

/// The lens ends about 5 mm in front of the centre.
constexpr double vitreous_reach_mm = 4.5;

struct Values {
  std::vector<Vector3d> places;  ///< from the globe's centre, over the reach
  std::vector<double> of_stack, of_other;
};

Values values_near(const Stack& stack, const Sampler& other, const Vector3d& globe) {
  Values values;
  for_each_voxel_near(stack, globe, vitreous_reach_mm, [&](int c, int r, int s, const Vector3d& x) {
    const auto value = other.interpolate(x);
    if (!value) return;
    values.places.push_back((x - globe) / vitreous_reach_mm);
    values.of_stack.push_back(stack.at(c, r, s));
    values.of_other.push_back(*value);
  });
  return values;
}

MatrixXd quadratic_of(const std::vector<Vector3d>& places) {
  MatrixXd basis(places.size(), 10);
  for (std::size_t i = 0; i < places.size(); ++i) {
    const Vector3d& p = places[i];
    basis.row(static_cast<Eigen::Index>(i)) << 1, p.x(), p.y(), p.z(), p.x() * p.x(), p.y() * p.y(),
        p.z() * p.z(), p.x() * p.y(), p.x() * p.z(), p.y() * p.z();
  }
  return basis;
}

}  // namespace

VitreousNoise compare_noise(const Stack& stack, const Stack& other, const Vector3d& globe) {
  constexpr std::size_t fewest_voxels = 50;
  const Values values = values_near(stack, Sampler(other), globe);
  const std::size_t count = values.places.size();
  if (count < fewest_voxels) return {};
  const MatrixXd basis = quadratic_of(values.places);
  const auto fit = basis.colPivHouseholderQr();
  const auto of = [&](const std::vector<double>& list) -> VectorXd {
    return VectorXd::Map(list.data(), basis.rows());
  };
  const auto residual = [&](const VectorXd& value) -> VectorXd { return value - basis * fit.solve(value); };
  const VectorXd own = residual(of(values.of_stack)), others = residual(of(values.of_other));
  const double mean = of(values.of_stack).mean();
  if (!(own.norm() > 0 && others.norm() > 0 && mean > 0)) return {};
  return {own.norm() / std::sqrt(static_cast<double>(count)) / mean,
          own.dot(others) / (own.norm() * others.norm())};
}

bool is_one_acquisition(const Stack& a, const Stack& b, const Vector3d& globe) {
  // Acquisitions of one textured vitreous at 60 times its noise have 0.77, at 20 times 0.3; copies of real heads smoothed
  // by 0.6 voxels 0.84 to 0.99, cut along other planes 0.88 to 1 (docs/use/reading-dicom.md).
  constexpr double of_copies = 0.85;
  // Below this what the edges about the vitreous leave in it is as large as the noise.
  constexpr double least_noise = 0.01;
  const VitreousNoise at_a = compare_noise(a, b, globe), at_b = compare_noise(b, a, globe);
  return std::min(at_a.relative, at_b.relative) > least_noise &&
         std::max(at_a.correlation, at_b.correlation) > of_copies;
}

}  // namespace emmetrope::segmentation
