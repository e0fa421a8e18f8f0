#include "segmentation/fit/both_eyes.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "pipeline/eye/population/population.hpp"
#include "segmentation/fit/conditioning.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Index;
using Eigen::Matrix2d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;

/// A number of each eye, linear in its free parameters, and what is known of the pair besides the images:
/// an information matrix and its product with the mean.
struct Shared {
  std::array<double, 2> value;
  std::array<VectorXd, 2> gradient;  ///< by the free parameters
  double difference_sigma;
  Matrix2d information;
  Vector2d information_mean = Vector2d::Zero();
};

bool is_free(const EyeFit& fit, int parameter) {
  return std::find(fit.active.begin(), fit.active.end(), parameter) != fit.active.end();
}

/// The derivative of a combination of parameters by the free ones.
VectorXd gradient_of(const EyeFit& fit, const std::vector<std::pair<int, double>>& terms) {
  VectorXd gradient = VectorXd::Zero(static_cast<Index>(fit.active.size()));
  for (const auto& [parameter, factor] : terms)
    gradient[std::find(fit.active.begin(), fit.active.end(), parameter) - fit.active.begin()] = factor;
  return gradient;
}

/// Equal but for a normal difference of this standard deviation.
Matrix2d alike(double sigma) {
  Matrix2d information;
  information << 1, -1, -1, 1;
  return information / (sigma * sigma);
}

/// The prior of two strangers replaced by that of two eyes of a person, which differ by `difference_sigma`.
/// \param mean  of each eye's own prior
Shared of_one_person(const std::array<EyeFit*, 2>& eyes, int parameter, const Vector2d& mean,
                     double difference_sigma) {
  Shared shared;
  Vector2d variance;
  for (int e = 0; e < 2; ++e) {
    shared.value[e] = eyes[e]->value(parameter);
    shared.gradient[e] = gradient_of(*eyes[e], {{parameter, 1.0}});
    variance[e] = std::pow(eyes[e]->priors.sigma[parameter], 2);
  }
  // var(a - b) = var a + var b - 2 cov(a, b)
  const double covariance = (variance.sum() - difference_sigma * difference_sigma) / 2;
  Matrix2d together;
  together << variance[0], covariance, covariance, variance[1];
  shared.difference_sigma = difference_sigma;
  shared.information = together.inverse() - Matrix2d(variance.cwiseInverse().asDiagonal());
  shared.information_mean = shared.information * mean;
  return shared;
}

Shared corneal_curvature(const std::array<EyeFit*, 2>& eyes) {
  Vector2d mean;
  for (int e = 0; e < 2; ++e) mean[e] = expected_curvature(eyes[e]->priors, eyes[e]->value(axial_length));
  return of_one_person(eyes, cornea_c, mean, corneal_power_difference_D * per_mm_of_keratometric_D);
}

/// Depths and thicknesses that are alike in the eyes of a person.
std::vector<Shared> alike_lengths(const std::array<EyeFit*, 2>& eyes) {
  std::vector<Shared> list;
  for (const auto& [parameter, sigma] : {std::pair{axial_length, axial_length_difference_mm},
                                         {anterior_chamber_depth, chamber_depth_difference_mm},
                                         {lens_thickness, lens_thickness_difference_mm},
                                         {cornea_thickness, corneal_thickness_difference_mm},
                                         {lid_thickness, lid_thickness_difference_mm}}) {
    if (!is_free(*eyes[0], parameter) || !is_free(*eyes[1], parameter)) continue;
    const Vector2d mean(eyes[0]->priors.mean[parameter], eyes[1]->priors.mean[parameter]);
    list.push_back(of_one_person(eyes, parameter, mean, sigma));
  }
  return list;
}

/// What two eyes in the same images have in common.
std::vector<Shared> same_images(const std::array<EyeFit*, 2>& eyes) {
  std::vector<Shared> list;
  const EyeFit &od = *eyes[0], &os = *eyes[1];
  const bool same = od.weighting == os.weighting && od.stacks.size() == os.stacks.size() &&
                    std::equal(od.stacks.begin(), od.stacks.end(), os.stacks.begin(),
                               [](const auto& a, const auto& b) { return a.stack == b.stack; });
  if (!same || od.evidence == Evidence::labels || os.evidence == Evidence::labels) return list;
  for (const auto& [tissue, sigma] : {std::pair{cornea, tissue_intensity_difference},
                                      {wall, tissue_intensity_difference},
                                      {lens, tissue_intensity_difference},
                                      {iris, tissue_intensity_difference},
                                      {vitreous, tissue_intensity_difference},
                                      {lid, lid_intensity_difference}}) {
    const int parameter = tissue;
    const bool seen = std::all_of(eyes.begin(), eyes.end(), [&](const EyeFit* eye) {
      return is_free(*eye, parameter) && is_free(*eye, aqueous) && eye->value(parameter) > 0 &&
             eye->value(aqueous) > 0;
    });
    if (!seen) continue;
    Shared brightness;
    brightness.difference_sigma = sigma;
    brightness.information = alike(sigma);
    for (int e = 0; e < 2; ++e) {
      const double of_tissue = eyes[e]->value(tissue), of_aqueous = eyes[e]->value(aqueous);
      brightness.value[e] = std::log(of_tissue / of_aqueous);
      brightness.gradient[e] = gradient_of(*eyes[e], {{tissue, 1 / of_tissue}, {aqueous, -1 / of_aqueous}});
    }
    list.push_back(brightness);
  }
  for (int s = 0; s < od.layout.stacks; ++s)
    for (const auto& [of_stack, sigma] : {std::pair{log_sharpness, sharpness_difference},
                                          {log_sharpness_ratio, sharpness_difference},
                                          {log_sharpness_through, sharpness_difference},
                                          {k_space_filter, sharpness_difference},
                                          {fat_shift_first, fat_shift_difference_mm},
                                          {StackParameter(fat_shift_first + 1), fat_shift_difference_mm}}) {
      const int at = od.layout.stack(s) + of_stack;
      if (!is_free(od, at) || !is_free(os, at)) continue;
      Shared image;
      image.difference_sigma = sigma;
      image.information = alike(sigma);
      for (int e = 0; e < 2; ++e) {
        image.value[e] = eyes[e]->value(at);
        image.gradient[e] = gradient_of(*eyes[e], {{at, 1.0}});
      }
      list.push_back(image);
    }
  return list;
}

/// Whether the eyes differ by no more than three standard deviations of what is allowed.
bool agree(const Shared& shared, const std::array<EyeFit*, 2>& eyes) {
  double variance = shared.difference_sigma * shared.difference_sigma;
  for (int e = 0; e < 2; ++e) variance += shared.gradient[e].dot(eyes[e]->covariance * shared.gradient[e]);
  return std::pow(shared.value[0] - shared.value[1], 2) <= 9 * variance;
}

bool err_alike(const EyeFit& a, const EyeFit& b) {
  return a.weighting == b.weighting && a.shared_covariance.size() > 0 && b.shared_covariance.size() > 0;
}

}  // namespace

bool couple_eyes(EyeFit& od, EyeFit& os) {
  // Ectasia is rarely alike in both eyes, and the prior that is replaced here is a regular cornea's.
  if (od.layout.irregular_cornea || os.layout.irregular_cornea) return false;
  const std::array<EyeFit*, 2> eyes{&od, &os};
  const WithoutSharedError compared(
      od, os, err_alike(od, os) ? &EyeFit::shared_covariance : &EyeFit::common_covariance);
  std::vector<Shared> shared{corneal_curvature(eyes)};
  if (!agree(shared[0], eyes)) return false;
  for (const auto& others : {alike_lengths(eyes), same_images(eyes)})
    for (const Shared& other : others)
      if (agree(other, eyes)) shared.push_back(other);

  const auto count = static_cast<Index>(shared.size());
  std::array<MatrixXd, 2> jacobian, own;  // of what is shared, in one eye: derivatives and covariance
  MatrixXd information = MatrixXd::Zero(2 * count, 2 * count);
  VectorXd information_mean = VectorXd::Zero(2 * count), before(2 * count);
  for (int e = 0; e < 2; ++e) {
    jacobian[e].resize(count, static_cast<Index>(eyes[e]->active.size()));
    for (Index i = 0; i < count; ++i) {
      jacobian[e].row(i) = shared[i].gradient[e];
      before[e * count + i] = shared[i].value[e];
    }
    own[e] = jacobian[e] * eyes[e]->covariance * jacobian[e].transpose();
    information.block(e * count, e * count, count, count) = own[e].inverse();
  }
  information_mean = information * before;
  for (Index i = 0; i < count; ++i)
    for (int e = 0; e < 2; ++e) {
      information_mean[e * count + i] += shared[i].information_mean[e];
      for (int f = 0; f < 2; ++f) information(e * count + i, f * count + i) += shared[i].information(e, f);
    }
  const MatrixXd posterior = information.inverse();
  const VectorXd step = posterior * information_mean - before;

  for (int e = 0; e < 2; ++e)
    condition(*eyes[e], jacobian[e], step.segment(e * count, count),
              posterior.block(e * count, e * count, count, count));
  // What each then has of the other's error is in no other images.
  if (!err_alike(od, os)) od.shared_covariance = os.shared_covariance = {};
  return true;
}

}  // namespace emmetrope::segmentation
