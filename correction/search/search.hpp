#pragma once
#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "correction/search/retinal_sharpness.hpp"

namespace emmetrope::correction {

/// Coarse to fine: the first level's picture is large-scale and cheap, and its pupil may be small, so that
/// sharpness rises towards focus from far away; the last level decides.
std::vector<ImagingLevel> imaging_levels(SharpnessCriterion criterion, double pupil_mm, double wavelength_nm,
                                         const Eigen::Vector2d& centre_mm, std::uint64_t seed);

/// A lens to start from.
struct Start {
  LensFamily family;
  Eigen::VectorXd lens;
};

/// The sharpest lens that was found.
struct SearchResult {
  LensFamily family;                 ///< of the best lens
  Optimum best;                      ///< on the last level
  Eigen::MatrixXd curvature;         ///< of ln(sharpness) there, 1/D^2; negative definite at an optimum
  Eigen::VectorXd sampling_sigma_D;  ///< how far another set of rays would move the optimum
  /// distinct optima of that family that were reached, the sharpest first
  std::vector<Eigen::VectorXd> optima;
  int images = 0;         ///< retinal images traced, all levels and starts
  bool accepted = false;  ///< converged, a maximum, and the next Newton step accepted
  std::string reason;     ///< why not
};

/// The longest next Newton step of a search that has ended: 0.02 D. Through a wide pupil the summit may be so flat
/// that the rays' own noise moves it farther; that noise is part of the interval, and a step within it the end.
double accepted_step_D(double sampling_sigma_D);

/// Ascends from every start on the coarse level and from the distinct ends of that on the next.
/// \param starts  at least one, inside the bounds of their families
SearchResult find_sharpest(const raytrace::Tracer& tracer,
                           const std::shared_ptr<const raytrace::Scene>& scene, const EyeModel& eye,
                           const std::vector<ImagingLevel>& levels, const std::vector<Start>& starts);

}  // namespace emmetrope::correction
