#pragma once

namespace emmetrope::segmentation {

/// Mean of a Rician magnitude of a signal nu with channel noise sigma, in units of sigma, and its derivative
/// by nu / sigma.
struct RicianMean {
  double mean;        ///< E[M] / sigma
  double derivative;  ///< d(E[M]) / d nu
  double deviation;   ///< standard deviation of M / sigma
};

/// Closed form of Rice (1944): E[M] = sigma sqrt(pi/2) L_1/2(-nu^2 / 2 sigma^2), E[M^2] = nu^2 + 2 sigma^2.
/// \param signal_to_noise  nu / sigma, >= 0
RicianMean rician(double signal_to_noise);

}  // namespace emmetrope::segmentation
