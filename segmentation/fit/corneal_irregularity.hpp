#pragma once
#include <vector>

#include "segmentation/fit/least_squares.hpp"

namespace emmetrope::segmentation {

/// Whether the images ask for more than a biconic: Rao's score test of the cornea's free form at a fit
/// without it, all other free parameters and their priors accounted for. Tested are the terms of orders 3 to
/// 5: of finer ones a single image tells too little.
struct CornealIrregularity {
  static constexpr int tested_terms = 15;
  double chi2 = 0;  ///< of tested_terms degrees of freedom if the cornea is regular
  bool found() const;
  static constexpr double chi2_limit = 44.3;  ///< exceeded by one regular cornea in 10000
  /// Slices further beside their places (rms) make regular corneas look irregular: in coil images whose slices were moved
  /// singly 16 of 40 did (scores of 44 to 79), of 100 eyes in still ones, at 0.022 mm at most, none.
  static constexpr double most_displaced_mm = 0.035;
  /// Coarser pixels than a cornea is thick show no form of it: what they ask for is a lid's or an artefact's.
  static constexpr double coarsest_pixel_mm = 0.6001;  ///< headers and single precision round
};
/// \param problem  with weights that know the misfit, solved at `parameters` for those that are `active`
CornealIrregularity corneal_irregularity(const FitProblem& problem, const Eigen::VectorXd& parameters,
                                         const std::vector<int>& active);

/// The vector of a regular cornea with the free form, which is 0.
/// \param irregular  the layout with it
Eigen::VectorXd with_free_form(const Eigen::VectorXd& parameters, const ParameterLayout& irregular);

}  // namespace emmetrope::segmentation
