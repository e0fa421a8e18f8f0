#include "segmentation/fit/slice_displacement.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <map>

namespace emmetrope::segmentation {
namespace {

using Eigen::Index;
using Eigen::Matrix2Xd;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using RowMatrix = Eigen::SparseMatrix<double, Eigen::RowMajor>;

/// Derivatives of each sample's residual by the eye's place, along the rows and columns of its slice.
Matrix2Xd d_place_in_plane(const EyeFit& fit, const FitProblem& problem, const RowMatrix& d_place) {
  Matrix2Xd in_plane(2, d_place.rows());
  for (Index i = 0; i < in_plane.cols(); ++i) {
    const Stack& stack = *fit.stacks[problem.samples[static_cast<std::size_t>(i)].stack].stack;
    const Vector3d in_lps = Vector3d(d_place.row(i).transpose());
    in_plane.col(i) << in_lps.dot(stack.along_row), in_lps.dot(stack.along_column);
  }
  return in_plane;
}

using Information = std::vector<Eigen::Matrix2d>;

Information information_of(const Matrix2Xd& d_place, const Blocks& slice_of, Index slices) {
  Information information(slices, Eigen::Matrix2d::Zero());
  for (std::size_t i = 0; i < slice_of.size(); ++i) {
    const Vector2d row = d_place.col(static_cast<Index>(i));
    information[slice_of[i]] += row * row.transpose();
  }
  return information;
}

/// Mean square of the displacements that the slices' residuals call for (mm^2), both axes.
double mean_square_displacement(const EyeFit& fit, const FitProblem& problem, const Basis& place,
                                const Blocks& slice_of, Index slices) {
  // Several steps: one reaches no farther than an edge is wide, a third of a millimetre in fine images.
  constexpr int steps = 6;
  constexpr double farthest_step_mm = 0.3;
  FitProblem moved = problem;
  moved.loss_scale = 1e6;  // a large residual is evidence here, not an outlier
  Matrix2Xd displacement_mm = Matrix2Xd::Zero(2, slices);
  Information information;
  for (int step = 0; step < steps; ++step) {
    const LinearRows rows = linearise(moved, fit.parameters, place);
    const Matrix2Xd d_place = d_place_in_plane(fit, problem, rows.jacobian);
    information = information_of(d_place, slice_of, slices);
    Matrix2Xd gradient = Matrix2Xd::Zero(2, slices);
    for (std::size_t i = 0; i < slice_of.size(); ++i) {
      const auto row = static_cast<Index>(i);
      gradient.col(slice_of[i]) += rows.residual[row] * d_place.col(row);
    }
    for (Index s = 0; s < slices; ++s) {
      const Vector2d change = information[s].completeOrthogonalDecomposition().solve(gradient.col(s));
      displacement_mm.col(s) += change * std::min(1.0, farthest_step_mm / std::max(change.norm(), 1e-9));
    }
    for (std::size_t i = 0; i < slice_of.size(); ++i) {
      const Stack& stack = *fit.stacks[problem.samples[i].stack].stack;
      const Vector2d moved_by = displacement_mm.col(slice_of[i]);
      moved.samples[i].position =
          problem.samples[i].position + moved_by.x() * stack.along_row + moved_by.y() * stack.along_column;
    }
  }
  double sum = 0, weights = 0;
  for (Index s = 0; s < slices; ++s) {
    sum += displacement_mm.col(s).dot(information[s] * displacement_mm.col(s));
    weights += information[s].trace() / 2;
  }
  return weights > 0 ? sum / weights : 0;
}

}  // namespace

Blocks slices_of(const EyeFit& fit, const std::vector<Sample>& samples) {
  std::map<std::pair<int, long>, int> number;
  Blocks blocks;
  for (const Sample& sample : samples) {
    const Stack& stack = *fit.stacks[sample.stack].stack;
    const double along = (sample.position - stack.slice_position.front()).dot(stack.normal);
    blocks.push_back(
        number.try_emplace({sample.stack, std::lround(100 * along)}, static_cast<int>(number.size()))
            .first->second);
  }
  return blocks;
}

DisplacedSlices displaced_slices(const EyeFit& fit, const FitProblem& problem, const MatrixXd& covariance) {
  const Blocks slice_of = slices_of(fit, problem.samples);
  const Index slices = 1 + *std::max_element(slice_of.begin(), slice_of.end());
  const Basis place = select_parameters(fit.layout.size(), {apex_x, apex_y, apex_z});
  const double mean_square = mean_square_displacement(fit, problem, place, slice_of, slices);

  const RowMatrix d_place = linearise(problem, fit.parameters, place).jacobian;
  const Matrix2Xd in_plane = d_place_in_plane(fit, problem, d_place);
  const Information information = information_of(in_plane, slice_of, slices);
  const RowMatrix jacobian =
      linearise(problem, fit.parameters, select_parameters(fit.layout.size(), fit.active)).jacobian;
  MatrixXd cross_information = MatrixXd::Zero(covariance.rows(), 2 * slices);  // J'P, in plane
  MatrixXd cross_along_normal = MatrixXd::Zero(covariance.rows(), slices);
  for (std::size_t i = 0; i < slice_of.size(); ++i) {
    const auto row = static_cast<Index>(i);
    const ObservedStack& observed = fit.stacks[problem.samples[i].stack];
    const bool is_encoded = observed.sampling.slice_cutoff_per_mm > 0;  // all slices are acquired at once
    const double along_normal =
        is_encoded ? 0 : Vector3d(d_place.row(row).transpose()).dot(observed.stack->normal);
    for (RowMatrix::InnerIterator entry(jacobian, row); entry; ++entry) {
      cross_information.block<1, 2>(entry.col(), Index{2} * slice_of[i]) +=
          entry.value() * in_plane.col(row).transpose();
      cross_along_normal(entry.col(), slice_of[i]) += entry.value() * along_normal;
    }
  }
  const MatrixXd response = covariance * cross_information;  // of the solution
  const MatrixXd response_along_normal = covariance * cross_along_normal;

  MatrixXd remaining = -cross_information.transpose() * response;  // A
  double seen = 0, all = 0, noise = 0;
  for (Index s = 0; s < slices; ++s) {
    remaining.block<2, 2>(2 * s, 2 * s) += information[s];
    const MatrixXd of_slice = remaining.middleRows<2>(2 * s);
    seen += of_slice.cwiseProduct(information[s].completeOrthogonalDecomposition().solve(of_slice)).sum();
    all += information[s].trace();
    noise +=
        information[s].completeOrthogonalDecomposition().solve(remaining.block<2, 2>(2 * s, 2 * s)).trace();
  }
  DisplacedSlices found;
  if (seen > 0) found.rms_mm = std::sqrt(mean_square * all / seen);
  // Still phantoms are at 0.6 to 1.2 times what noise makes.
  const double beyond_noise =
      seen > 0 ? std::max(0.0, (mean_square - 2 * noise / (all / 2)) * all / seen) : 0;
  found.covariance =
      beyond_noise / 2 *
      (response * response.transpose() + response_along_normal * response_along_normal.transpose());
  return found;
}

}  // namespace emmetrope::segmentation
