#pragma once
#include <optional>
#include <string>
#include <vector>

#include "pipeline/base/json.hpp"
#include "pipeline/base/power_vector.hpp"
#include "raytrace/eye_map/living_eye.hpp"

/// What the page knows of an eye that looks out of it (living/web/*.js read it).
namespace emmetrope::report {

/// A lens that has a button.
struct NamedLens {
  std::string name;  ///< "best", "rounded", "known"
  SpheroCylinder power;
  double vertex_distance_mm = 12;
};

/// One eye of the page.
struct LivingSubject {
  std::string id;    ///< "od", "os", or a schematic eye's
  std::string name;  ///< "OD (right)"
  EyeModel eye;      ///< at rest
  raytrace::LivingEye living;
  std::vector<NamedLens> lenses;
  std::string withheld;  ///< why there is no prescription; empty where there is one or none was sought
  bool has_prescription = true;  ///< a lens that is found in the page may have the form of one
  double half_width_D = 0;       ///< of the 95 % interval of the spherical equivalent
  double pupil_mm = 4;           ///< iris that the page opens with: the prescription's
};

/// The eye's numbers: its map as base64 of little-endian float32, the outlines of its surfaces, the refraction of its
/// retina at rest through that pupil, its lenses.
Json living_json(const LivingSubject& subject, int threads);

/// What all eyes look at and by what light: charts as PNG, the display's wavelengths, the Airy disc.
Json living_world_json();

}  // namespace emmetrope::report
