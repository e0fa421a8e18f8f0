#pragma once
#include <optional>
#include <string>
#include <vector>

#include "correction/search/search.hpp"
#include "pipeline/base/json.hpp"

/// The prescription as lenses that can be bought: a toric meniscus of some material before the eye, a lens on
/// the cornea, next to the thin lens.
namespace emmetrope::correction {

/// What spectacles are ground from: index and Abbe number at the d line.
struct LensMaterial {
  const char* name;
  double index, abbe;
};
/// By name: cr39, trivex, polycarbonate, 1.60, 1.67, 1.74, crown.
/// \throw Error (usage) listing them
LensMaterial lens_material(const std::string& name);

struct SpectacleSettings {
  LensMaterial material = lens_material("cr39");
  /// Front surface; default: Vogel's rule, M + 6 D for plus, M/2 + 6 D for minus
  std::optional<double> base_D;
  std::optional<double> centre_thickness_mm;  ///< default: 2 mm, or what leaves 1 mm at the rim
  double semi_diameter_mm = 25;
};

/// A lens with the power that makes the image sharpest.
struct RealLens {
  std::string kind;  ///< "thin lens", "toric meniscus", "contact lens"
  double vertex_distance_mm = 0;
  PowerVector power;  ///< back vertex power
  double sharpness = 0;
  std::string reason;  ///< why there is none; else empty
  int images = 0;
  std::optional<double> base_D, centre_thickness_mm;  ///< of a meniscus
};

/// A family of toric menisci that differ in the back surface only, about a power.
/// \throw Error (usage) where no such lens can be ground, or it would stand on the cornea
LensFamily toric_meniscus(const EyeModel& eye, const SpectacleSettings& spectacle, double vertex_distance_mm,
                          const PowerVector& about);

/// Ascends from the thin lens's power on the level that decided about it; for a contact lens in the plane of
/// the cornea.
std::vector<RealLens> sharpest_real_lenses(const raytrace::Tracer& tracer,
                                           const std::shared_ptr<const raytrace::Scene>& scene,
                                           const EyeModel& eye, const ImagingLevel& level,
                                           const SpectacleSettings& spectacle, const PowerVector& thin_lens,
                                           double vertex_distance_mm);

/// "lenses" of prescription.json, the thin lens first.
Json lenses_json(const std::vector<RealLens>& lenses, const SpectacleSettings& spectacle);

/// Sharpness differs by less than this fraction between lenses that do the same: by what magnification alone
/// (up to a tenth) and other rays change of it.
inline constexpr double sharpness_repeatability = 0.005;

/// The kind of the sharpest lens; "equal" where another comes within the repeatability, empty where there is
/// none.
std::string name_sharpest(std::vector<RealLens> lenses);

}  // namespace emmetrope::correction
