#include "pipeline/eye/media/ocular_media.hpp"

namespace emmetrope {
namespace {

Medium le_grand_medium(double index, double n_infinite, double k_nm) {
  return {index, {Dispersion::Formula::cornu, {n_infinite, k_nm, 130}}, {}};
}

}  // namespace

Medium cornea_medium(double index) { return le_grand_medium(index, 1.3610, 7.4147); }
Medium aqueous_medium(double index) { return le_grand_medium(index, 1.3221, 7.0096); }
Medium lens_medium(double index) { return le_grand_medium(index, 1.3999, 9.2492); }
Medium vitreous_medium(double index) { return le_grand_medium(index, 1.3208, 6.9806); }

std::map<std::string, Medium> ocular_media(double lens_index) {
  return {{"cornea", cornea_medium()},
          {"aqueous", aqueous_medium()},
          {"lens", lens_medium(lens_index)},
          {"vitreous", vitreous_medium()}};
}

}  // namespace emmetrope
