#pragma once
#include <Eigen/Core>
#include <cmath>
#include <vector>

#include "correction/search/optimise.hpp"
#include "correction/sharpness/sharpness.hpp"
#include "pipeline/base/frames.hpp"
#include "raytrace/wavefront/contrast_sensitivity.hpp"

/// Sharpness without any image: from ray slopes in the pupil by the geometric OTF. The independent check of
/// what the traced images say, and cheap enough for exhaustive search.
namespace emmetrope::correction {

struct PupilRay {
  Eigen::Vector2d position_mm;  ///< in the pupil plane where the lens acts
  Eigen::Vector2d slope_mrad;   ///< of the outgoing ray against the chief ray
};

/// Sharpness (mean MTF^2 under the criterion's weight times a chart whose power falls as f^-3) behind a thin
/// lens in the pupil plane; parameters M, J0, J45.
inline SharpnessFunction geometric_sharpness(const std::vector<PupilRay>& rays, SharpnessCriterion criterion,
                                             double blur_arcmin, double finest_cpd = 30) {
  return [=](const Eigen::VectorXd& lens) {
    constexpr int frequencies = 60, directions = 16;
    constexpr double coarsest_cpd = 0.2;
    Eigen::Matrix2d power;
    power << lens[0] + lens[1], lens[2], lens[2], lens[0] - lens[1];
    double sum = 0, energy = 0;
    Eigen::Vector3d slope = Eigen::Vector3d::Zero();
    for (int k = 0; k < frequencies; ++k) {
      const double f_cpd = coarsest_cpd * std::pow(finest_cpd / coarsest_cpd, (k + 0.5) / frequencies);
      const double csf = raytrace::contrast_sensitivity(f_cpd);
      const double w = criterion == SharpnessCriterion::gradient_energy      ? f_cpd * f_cpd
                       : criterion == SharpnessCriterion::laplacian_variance ? std::pow(f_cpd, 4)
                                                                             : std::pow(f_cpd, 3) * csf * csf;
      const double phase = 2 * pi * f_cpd * blur_arcmin / 60;
      // chart f^-3, area f df = f^2 d ln f
      const double weight = w / f_cpd * std::exp(-phase * phase - 2 * std::pow(f_cpd / 30, 4));
      for (int d = 0; d < directions; ++d) {
        const Eigen::Vector2d u(std::cos(pi * d / directions), std::sin(pi * d / directions));
        const double k_per_mrad = 2 * pi * f_cpd / degree * 1e-3;
        double re = 0, im = 0;
        Eigen::Vector3d dre = Eigen::Vector3d::Zero(), dim = Eigen::Vector3d::Zero();
        for (const PupilRay& ray : rays) {
          const Eigen::Vector2d& p = ray.position_mm;
          const double angle = k_per_mrad * u.dot(ray.slope_mrad - power * p);
          const Eigen::Vector3d dangle =
              -k_per_mrad * Eigen::Vector3d(u.dot(p), u[0] * p[0] - u[1] * p[1], u[0] * p[1] + u[1] * p[0]);
          re += std::cos(angle);
          im += std::sin(angle);
          dre -= std::sin(angle) * dangle;
          dim += std::cos(angle) * dangle;
        }
        const double n = static_cast<double>(rays.size());
        sum += weight;
        energy += weight * (re * re + im * im) / (n * n);
        slope += weight * 2 * (re * dre + im * dim) / (n * n);
      }
    }
    return SharpnessValue{energy / sum, slope / sum};
  };
}

/// Rays through a round pupil of an eye with a refraction (what corrects it, in the pupil plane) and primary
/// spherical aberration c40 (um over that pupil).
inline std::vector<PupilRay> aberrated_pupil(double diameter_mm, const Eigen::Vector3d& refraction,
                                             double c40_um, int rings = 12) {
  std::vector<PupilRay> rays;
  const double radius = diameter_mm / 2;
  Eigen::Matrix2d power;
  power << refraction[0] + refraction[1], refraction[2], refraction[2], refraction[0] - refraction[1];
  for (int i = 0; i < rings; ++i) {
    const double rho = std::sqrt((i + 0.5) / rings);
    for (int k = 0; k < 4 * rings; ++k) {
      const double angle = 2 * pi * (k + 0.5 * (i % 2)) / (4 * rings);
      const Eigen::Vector2d p = radius * rho * Eigen::Vector2d(std::cos(angle), std::sin(angle));
      // Z40 = sqrt5 (6 rho^4 - 6 rho^2 + 1): slope along the radius sqrt5 (24 rho^3 - 12 rho) c40 / r; M of
      // it on the axis is + 12 sqrt5 c40 / r^2, the sign of a prescription.
      const double sa = -std::sqrt(5.0) * (24 * rho * rho * rho - 12 * rho) * c40_um / radius;
      rays.push_back({p, power * p + sa * p.normalized()});
    }
  }
  return rays;
}

}  // namespace emmetrope::correction
