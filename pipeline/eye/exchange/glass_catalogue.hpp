#pragma once
#include <filesystem>
#include <map>
#include <string>

#include "pipeline/eye/media/medium.hpp"

/// Glass catalogues of Zemax (.agf): media by formula, wavelengths in micrometres.
namespace emmetrope {

/// Schott's formula, Sellmeier's of three terms and Conrady's are read; media of another formula are left out and a
/// lens that names one of them is refused there.
/// \return media by name in capitals, index at the reference wavelength
/// \throw Error (input_invalid) naming file and line
std::map<std::string, Medium> read_glass_catalogue(const std::filesystem::path& file,
                                                   double reference_wavelength_nm);

/// A medium as a catalogue's entry.
struct CatalogueGlass {
  std::string text;  ///< its lines
  double worst_index =
      0;  ///< the largest departure, 380 to 1000 nm; at the reference wavelength there is none
};
/// Exact where the formula is Conrady's, or Schott's or Sellmeier's with their own index; else Schott's formula, by
/// least squares.
CatalogueGlass catalogue_glass(const std::string& name, const Medium& medium, double reference_wavelength_nm);

}  // namespace emmetrope
