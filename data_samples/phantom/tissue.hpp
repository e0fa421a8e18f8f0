#pragma once
#include <array>
#include <cstddef>

namespace emmetrope::phantom {

/// What a point of the head consists of.
enum class Tissue : unsigned char {
  air,
  cornea,
  aqueous,
  iris,
  ciliary_body,
  lens,
  vitreous,
  wall,
  lid,
  fat,
  muscle,
  nerve,
  nerve_sheath,
  skin,
  bone,
  marrow,
  mucosa,
  csf,
  grey_matter,
  white_matter,
  choroid,
  sclera,
  tendon,
  lens_nucleus,
  liquefied_vitreous,
  melanoma,
  silicone_oil,
  silicone_rubber,
  acrylic,
};
inline constexpr std::size_t tissue_count = 29;

enum class Contrast { T1, T2 };
inline const char* to_string(Contrast contrast) { return contrast == Contrast::T1 ? "T1" : "T2"; }

struct TissueProperties {
  const char* name;
  double signal_T1;  ///< relative to fat
  double signal_T2;  ///< relative to the vitreous
  bool is_fat;       ///< its signal is displaced by the chemical shift
};

/// The table in docs/method/phantom.md (turbo spin echo, 3 T, no fat saturation), in the order of Tissue.
const std::array<TissueProperties, tissue_count>& tissue_table();

inline double signal_of(Tissue tissue, Contrast contrast) {
  const TissueProperties& row = tissue_table()[static_cast<std::size_t>(tissue)];
  return contrast == Contrast::T1 ? row.signal_T1 : row.signal_T2;
}

}  // namespace emmetrope::phantom
