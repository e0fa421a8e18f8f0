#include "data_samples/phantom/tissue.hpp"

namespace emmetrope::phantom {

const std::array<TissueProperties, tissue_count>& tissue_table() {
  static constexpr std::array<TissueProperties, tissue_count> table{{
      {"air", 0.00, 0.00, false},
      {"cornea", 0.36, 0.25, false},
      {"aqueous", 0.20, 0.98, false},
      {"iris", 0.55, 0.35, false},
      {"ciliary_body", 0.58, 0.38, false},
      {"lens", 0.42, 0.16, false},
      {"vitreous", 0.22, 1.00, false},
      {"wall", 0.38, 0.18, false},
      {"lid", 0.48, 0.38, false},
      {"fat", 1.00, 0.60, true},
      {"muscle", 0.42, 0.20, false},
      {"nerve", 0.46, 0.40, false},
      {"nerve_sheath", 0.24, 0.85, false},
      {"skin", 0.55, 0.40, false},
      {"bone", 0.03, 0.03, false},
      {"marrow", 0.80, 0.45, true},
      {"mucosa", 0.40, 0.80, false},
      {"csf", 0.16, 1.02, false},
      {"grey_matter", 0.42, 0.55, false},
      {"white_matter", 0.58, 0.42, false},
      {"choroid", 0.60, 0.50, false},
      {"sclera", 0.18, 0.10, false},
      {"tendon", 0.12, 0.06, false},
      {"lens_nucleus", 0.50, 0.08, false},
      {"liquefied_vitreous", 0.17, 1.06, false},
      {"melanoma", 0.80, 0.30, false},
      {"silicone_oil", 0.55, 0.40, true},
      {"silicone_rubber", 0.02, 0.02, false},
      {"acrylic", 0.02, 0.02, false},
  }};
  return table;
}

}  // namespace emmetrope::phantom
