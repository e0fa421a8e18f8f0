#pragma once
#include <string>
#include <vector>

#include "pipeline/base/power_vector.hpp"

/// What a wavefront does to a point and to letters: Fourier optics on the Zernike coefficients of
/// wavefront.json.
namespace emmetrope::report {

/// A square picture of linear intensities.
struct Picture {
  int side = 0;
  double arcmin_per_pixel = 0;
  std::vector<float> values;  ///< row after row, row 0 at the top, as the patient perceives it
};

/// The wavefront over the entrance pupil, OSA/ANSI single-index order from 0, micrometres.
struct PupilWavefront {
  double pupil_mm = 0;
  double wavelength_nm = 0;
  std::vector<double> zernike_um;
};

/// The wavefront with a thin lens of this refraction at the pupil: removes M, J0, J45 from second order.
PupilWavefront corrected_by(PupilWavefront wavefront, const PowerVector& refraction_at_pupil);

/// Value of the OSA/ANSI Zernike polynomial `index` at normalised radius rho <= 1 and angle theta.
double zernike_value(int index, double rho, double theta);

/// Squared modulus of the pupil function's Fourier transform, sum 1.
Picture point_spread(const PupilWavefront& wavefront);

/// Lines of up to five letters at these acuities, as many as fit into a field of `width_arcmin`, blurred by
/// the point spread: 1 is white.
Picture blurred_letters(const Picture& point_spread, const std::vector<double>& logmar, double width_arcmin);

/// Modulation transfer along x and y of the pupil function at these frequencies (cycles per degree).
struct Modulation {
  std::vector<double> horizontal, vertical;
};
Modulation modulation_transfer(const Picture& point_spread, const std::vector<double>& cpd);

/// The MTF of a diffraction-limited eye of this pupil.
double diffraction_mtf(double cpd, double pupil_mm, double wavelength_nm);
/// The mean radial MTF of healthy, best corrected eyes in white light (Watson 2013, eq. 5 and table 2).
double healthy_mtf(double cpd, double pupil_mm);

/// 8-bit grey PNG, linear intensities encoded as sRGB, 1 is white; `gamma` < 1 brightens faint parts.
std::string grey_png(const Picture& picture, int crop_side, int out_side, double white);

}  // namespace emmetrope::report
