#pragma once

namespace emmetrope {

/// Share of the light entering the cornea that the ocular media let pass unscattered to the retina.
///
/// van de Kraats and van Norren, "Optical density of the aging human ocular media in the visible and the UV", J. Opt.
/// Soc. Am. A 24, 1842 (2007), eq. 8 for small fields: Rayleigh loss, tryptophan, young and old lens, and a neutral
/// density of 0.111. Reflection is in it.
/// \pre 300 <= wavelength_nm; age_years from 0 to about 100
double ocular_transmittance(double wavelength_nm, double age_years);

}  // namespace emmetrope
