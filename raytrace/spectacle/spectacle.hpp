#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <variant>

#include "pipeline/base/power_vector.hpp"
#include "pipeline/eye/model/eye_model.hpp"

namespace emmetrope::raytrace {

/// Prismatic power: light is deviated towards the base by `dioptres` cm a metre, things seem displaced
/// towards the apex. `base_deg` is counter-clockwise from eye +x as the examiner sees it, 0 to 360: 90 is
/// base up; 0 is base out before a left and base in before a right eye.
struct Prism {
  double dioptres = 0;
  double base_deg = 0;
};

/// Puts a thin sphero-cylindrical lens in front of the eye: two real surfaces, "spectacle_front" (plane,
/// without power) and "spectacle_back" (biconic, q = 0), of index 1.5. The back vertex stands
/// `vertex_distance_mm` in front of the corneal apex and has the power `power`; the glass between plane and
/// back vertex (4 mm) keeps plus lenses whole and changes nothing for a distant object. A prism tilts the
/// plane so that a ray along the eye's axis is deviated by exactly its power.
EyeModel with_thin_lens(const EyeModel& eye, const PowerVector& power, double vertex_distance_mm,
                        const Prism& prism = {});

/// The paper's spectacle: plano front "spectacle_front", cylindrical back "spectacle_back" of radius
/// `radius_mm` (textbook sign: +50 mm is -10 D at index 1.5), `axis_deg` its meridian without power, back
/// vertex at `distance_mm` in front of the cornea.
EyeModel with_plano_cylinder(const EyeModel& eye, double radius_mm, double axis_deg, double distance_mm = 10,
                             double index = 1.5, double centre_thickness_mm = 1.0);

/// A spectacle lens as it is ground: spherical front, toric back (the circles of its two meridians joined by
/// a biconic), glass of some thickness between them.
struct Meniscus {
  PowerVector power;  ///< back vertex power at 589.3 nm
  double vertex_distance_mm = 12;
  double base_D = 4;  ///< front surface power (n - 1) / R, in the lens's own index
  /// Default: 2 mm, or what leaves `least_edge_mm` where it is thinnest.
  std::optional<double> centre_thickness_mm;
  double semi_diameter_mm = 30;
  double index = 1.5;          ///< n_d
  std::optional<double> abbe;  ///< none: no dispersion
  Prism prism;                 ///< by a tilt of the front about its vertex
};
inline constexpr double least_edge_mm = 1;

/// Puts it in front of the eye as "spectacle_front" (sphere) and "spectacle_back" (biconic).
/// \throw Error (usage) where a surface does not reach the rim, or front and back cross within it
EyeModel with_meniscus(const EyeModel& eye, const Meniscus& lens);

/// Puts any surfaces in front of or into the eye: spectacle, contact lens, intra-ocular lens
/// (docs/use/trace.md).
/// \throw Error (input_invalid) naming file and key
EyeModel with_surfaces_of(const EyeModel& eye, const std::filesystem::path& file);

/// What with_thin_lens() puts before the eye.
struct ThinLens {
  PowerVector power;
  double vertex_distance_mm = 12;
  Prism prism;
};
/// What with_plano_cylinder() puts 10 mm before the eye.
struct PlanoCylinder {
  double radius_mm = 0, axis_deg = 0;
  /// \throw Error (usage)
  void check() const;
};
/// What with_surfaces_of() reads.
struct SurfacesFile {
  std::filesystem::path file;
};
/// What an eye wears.
using Spectacle = std::variant<ThinLens, Meniscus, PlanoCylinder, SurfacesFile>;

/// As `--spectacle` gives it: a file of surfaces (.json), or "S/CxA@V[,key=value...]", the prescription as
/// parse_refraction() reads it: a thin lens, or with one of the keys base_D, thickness_mm, semi_diameter_mm, index, abbe
/// a meniscus; prism=P@BASE with either.
/// \throw Error (usage) naming what is wrong
Spectacle parse_spectacle(const std::string& text);
/// \throw Error (usage) where the eye wears a lens of that form already
EyeModel with_spectacle(const EyeModel& eye, const Spectacle& spectacle);
Json to_json(const Spectacle& spectacle);

/// The same with the surfaces that the head bears left where they are when the eye turns.
/// \param eye_from_head  rotation about the eye's centre of rotation
/// \throw Error (unsupported) for a mesh
EyeModel fixed_to_head(const EyeModel& eye, const Eigen::Isometry3d& eye_from_head);

}  // namespace emmetrope::raytrace
