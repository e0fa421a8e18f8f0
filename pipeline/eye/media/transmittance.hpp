#pragma once

namespace emmetrope {

/// What counts as lost of the light that the media scatter a little aside: all of it in small fields (below 3 degrees),
/// what an object's sharp image is without; in large ones (10 degrees and more) as much comes in from beside.
enum class MediaField { small, large };

/// Share of the light entering the cornea that the ocular media let pass unscattered to the retina.
///
/// van de Kraats and van Norren, "Optical density of the aging human ocular media in the visible and the UV", J. Opt.
/// Soc. Am. A 24, 1842 (2007), eq. 8: Rayleigh loss (0.446 for small fields, 0.225 for large ones), tryptophan, young
/// and old lens, and a neutral density of 0.111. Reflection is in it.
/// \pre 300 <= wavelength_nm; age_years from 0 to about 100
double ocular_transmittance(double wavelength_nm, double age_years, MediaField field = MediaField::small);

}  // namespace emmetrope
