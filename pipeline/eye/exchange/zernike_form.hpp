#pragma once
#include <vector>

#include "pipeline/eye/surfaces/shape.hpp"

namespace emmetrope {

/// A surface as a conic with Zernike terms upon it, for programs that know neither meshes nor toric bases.
struct ZernikeForm {
  double curvature_per_mm = 0;  ///< of the conic at its vertex, textbook sign
  double q = 0;                 ///< its asphericity
  double norm_radius_mm = 0;
  std::vector<double> coefficients_mm;  ///< of depth; OSA order
  double worst_um = 0;                  ///< the largest departure from the surface within the norm radius
};

/// Least squares over the disc.
/// \param radius_mm  the disc's; it is made smaller where the surface does not reach
/// \throw Error (unsupported) where the surface reaches less than 1 mm
ZernikeForm zernike_form(const Shape& shape, double radius_mm);

/// Noll's (1976) number, from 1, of an OSA term; normalisations agree. Zemax counts so.
int noll_number(int osa_index);
/// The sign that a term takes where x is mirrored.
int sign_mirrored_in_x(int osa_index);

}  // namespace emmetrope
