#pragma once

namespace emmetrope::raytrace {

/// Contrast sensitivity relative to its peak: Mannos and Sakrison, IEEE Trans. Information Theory
/// 1974;20:525,
///   2.6 (0.0192 + 0.114 f) exp(-(0.114 f)^1.1).
///
/// The neural weights of the VSOTF too: programs that compute it use this formula or Campbell and Green's
/// curve (1965), from which it differs by less than a factor of two up to 60 cycles per degree.
///
/// \param cpd  spatial frequency, cycles per degree
double contrast_sensitivity(double cpd);

}  // namespace emmetrope::raytrace
