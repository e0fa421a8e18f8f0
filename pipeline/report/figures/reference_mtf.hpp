#pragma once

namespace emmetrope::report {

/// Modulation transfer of a perfect pupil at a frequency in cycles a degree.
double diffraction_mtf(double cpd, double pupil_mm, double wavelength_nm);

/// The mean radial modulation transfer of healthy, best corrected eyes in white light (Watson 2013, equations
/// 4 and 5: wavefronts of 200 eyes, pupils of 2 to 6 mm).
double healthy_mtf(double cpd, double pupil_mm);

}  // namespace emmetrope::report
