#include "pipeline/follow/growth.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>

#include "pipeline/base/error.hpp"

namespace emmetrope::follow {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// A fit's parameters in a common order, each in units of what it may change.
struct Fit {
  VectorXd value;
  MatrixXd covariance;
};

/// New at every visit: what is known of it does not help.
bool is_of_the_visit(const std::string& parameter) {
  for (const char* beginning : {"apex_", "gaze_", "iris_"})
    if (parameter.rfind(beginning, 0) == 0) return true;
  return false;
}

std::vector<std::string> common_parameters(const std::vector<EyeAtVisit>& visits) {
  std::vector<std::string> common;
  for (const std::string& name : visits.front().eye.eye().parameter_names)
    if (!is_of_the_visit(name) && std::all_of(visits.begin(), visits.end(), [&](const EyeAtVisit& visit) {
          const auto& names = visit.eye.eye().parameter_names;
          return std::find(names.begin(), names.end(), name) != names.end();
        }))
      common.push_back(name);
  for (const char* needed : {"axial_length_mm", "globe_semi_axis_z_mm", "anterior_chamber_depth_mm"})
    if (std::find(common.begin(), common.end(), needed) == common.end())
      throw input_error(std::string("the fits of the visits have no ") + needed + " in common",
                        "make the cases with this version of emmetrope segment");
  return common;
}

/// Without the negative eigenvalues of rounding.
MatrixXd positive(const MatrixXd& matrix) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen((matrix + matrix.transpose()) / 2);
  return eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0).asDiagonal() *
         eigen.eigenvectors().transpose();
}

/// The fit with the scanner's scale at its visit.
Fit fit_of(const EyeAtVisit& visit, const std::vector<std::string>& parameters, double scale_sigma) {
  UncertainEye eye = visit.eye;
  eye.add_scale_prior(scale_sigma);
  const auto count = static_cast<Index>(parameters.size());
  std::vector<Index> places;
  for (const std::string& name : parameters) places.push_back(eye.index_of(name));
  const NormalDistribution all = eye.parameters();
  Fit fit{VectorXd(count), MatrixXd(count, count)};
  for (Index i = 0; i < count; ++i) {
    const double unit = change_sigma(parameters[static_cast<std::size_t>(i)]);
    fit.value[i] = all.mean[places[i]] / unit;
    for (Index j = 0; j < count; ++j)
      fit.covariance(i, j) = all.covariance(places[i], places[j]) /
                             (unit * change_sigma(parameters[static_cast<std::size_t>(j)]));
  }
  return fit;
}

}  // namespace

namespace {

struct Spread {
  const char* beginning;  ///< of a parameter's name
  double prior, plausible;
};

/// Corneas of schoolchildren and adults stay within 0.25 D, lenses within 0.05 mm a year (Mutti 2012). The globe grows,
/// mostly along its axis (Atchison 2004), an infant's by 4 mm in a year (Larsen 1971): what is expected of it must not draw
/// what was measured over months towards none, while a child's who is old enough to lie still in a scanner grows by less
/// than a millimetre.
const Spread& spread_of(const std::string& parameter) {
  static constexpr std::array<Spread, 14> spreads{
      {{"axial_length", 5, 1},
       {"globe_semi_axis", 2.5, 0.5},
       {"displacement_", 0.03, 0.03},
       {"cornea_c_", 0.25 * per_mm_of_keratometric_D, 0.25 * per_mm_of_keratometric_D},
       {"cornea_j", 0.25 * per_mm_of_keratometric_D, 0.25 * per_mm_of_keratometric_D},
       {"cornea_zernike", 1, 1},
       {"anterior_chamber", 0.1, 0.1},
       {"lens_thickness", 0.1, 0.1},
       {"lens_anterior_radius", 0.3, 0.3},
       {"lens_posterior_radius", 0.3, 0.3},
       {"lens_tilt", 1, 1},
       {"lens_", 0.1, 0.1},
       {"cornea_", 0.02, 0.02},
       {"", 0.1, 0.1}}};
  return *std::find_if(spreads.begin(), spreads.end(),
                       [&](const Spread& spread) { return parameter.rfind(spread.beginning, 0) == 0; });
}

}  // namespace

double change_sigma(const std::string& parameter) { return spread_of(parameter).prior; }
double plausible_change_sigma(const std::string& parameter) { return spread_of(parameter).plausible; }

Growth growth_of(const std::vector<EyeAtVisit>& visits, double scale_sigma) {
  const std::vector<std::string> parameters = common_parameters(visits);
  const auto count = static_cast<Index>(parameters.size()), later = static_cast<Index>(visits.size()) - 1;
  const Fit first = fit_of(visits.front(), parameters, scale_sigma);
  VectorXd change(later * count), mean = first.value;
  MatrixXd model(later * count, count), noise(later * count, later * count);
  for (Index k = 0; k < later; ++k) {
    const EyeAtVisit& visit = visits[static_cast<std::size_t>(k + 1)];
    const Fit fit = fit_of(visit, parameters, scale_sigma);
    mean += fit.value;
    change.segment(k * count, count) = fit.value - first.value;
    model.middleRows(k * count, count) = visit.years * MatrixXd::Identity(count, count);
    for (Index other = 0; other < later; ++other)
      noise.block(k * count, other * count, count, count) = first.covariance;
    noise.block(k * count, k * count, count, count) += fit.covariance;
  }
  const MatrixXd expected = model * model.transpose() + noise;  // what changes has a spread of 1
  const MatrixXd gain = expected.ldlt().solve(model).transpose();
  VectorXd unit(count);
  VectorXd plausible(count);
  for (Index i = 0; i < count; ++i) {
    unit[i] = change_sigma(parameters[static_cast<std::size_t>(i)]);
    plausible[i] = plausible_change_sigma(parameters[static_cast<std::size_t>(i)]);
  }
  Growth growth;
  growth.parameters = parameters;
  growth.per_year.mean = unit.asDiagonal() * (gain * change);
  growth.per_year.covariance =
      unit.asDiagonal() * positive(MatrixXd::Identity(count, count) - gain * model) * unit.asDiagonal();
  for (Index k = 0; k < later; ++k) {
    MatrixXd covariance =
        unit.asDiagonal() * positive(noise.block(k * count, k * count, count, count)) * unit.asDiagonal();
    covariance.diagonal() += (visits[static_cast<std::size_t>(k + 1)].years * plausible).cwiseAbs2();
    growth.differences.push_back({unit.asDiagonal() * change.segment(k * count, count), covariance});
  }
  growth.eye = visits.front().eye.eye();
  mean /= static_cast<double>(later + 1);
  for (Index i = 0; i < count; ++i)
    growth.eye.set(parameters[static_cast<std::size_t>(i)], unit[i] * mean[i]);
  return growth;
}

}  // namespace emmetrope::follow
