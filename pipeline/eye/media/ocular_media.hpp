#pragma once
#include <map>
#include <string>

#include "pipeline/eye/media/medium.hpp"

/// The media of human eyes: Gullstrand's indices at 589.3 nm, with Le Grand's (1956) Cornu dispersion
/// n = n_inf + K / (nm - 130), of which only differences from the reference wavelength are used.
namespace emmetrope {

inline constexpr double sodium_nm = 589.3;
inline constexpr double cornea_index = 1.376, aqueous_index = 1.336, vitreous_index = 1.336;
inline constexpr double lens_cortex_index = 1.386, lens_core_index = 1.406;

Medium cornea_medium(double index = cornea_index);
Medium aqueous_medium(double index = aqueous_index);
Medium lens_medium(double index);
Medium vitreous_medium(double index = vitreous_index);

/// "cornea", "aqueous", "lens" (homogeneous, of this equivalent index), "vitreous".
std::map<std::string, Medium> ocular_media(double lens_index);

}  // namespace emmetrope
