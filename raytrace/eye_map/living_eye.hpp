#pragma once
#include <optional>
#include <string>
#include <vector>

#include "pipeline/base/power_vector.hpp"
#include "pipeline/eye/measured/uncertain_optics.hpp"
#include "raytrace/eye_map/eye_map.hpp"

namespace emmetrope::raytrace {

/// One principal direction of what is not known of an eye's refraction: the eyes at the ends of its 95 % interval, each
/// the likeliest that has that refraction.
struct EyeBand {
  PowerVector reach_D;  ///< change of refraction at the upper end; the lower one is its opposite
  /// Changes of EyeMap::rays at rest and the reference wavelength, upper and lower end:
  /// [field term][pupil term][output]
  std::vector<double> upper, lower;
};

/// What of the visual field the retina sees, and how it is refracted there: rings of directions about the eye's axis.
struct RetinaRefraction {
  static constexpr int rings = 8, spokes = 24;
  static constexpr double ring_deg = 7.5;
  struct Place {
    Eigen::Vector3d retina_mm;  ///< eye frame
    double M_D = 0;             ///< as FieldWavefront::wavefront.minimum_rms_spot
  };
  /// The axis, then ring by ring outward, each from +x through +y; nothing where the retina does not see.
  std::vector<std::optional<Place>> places;
};
RetinaRefraction retina_refraction(const EyeModel& eye, int threads);

/// How the refraction of a band is told: as that of the lens beside it.
struct BandRefraction {
  double pupil_mm = 4;  ///< iris aperture
  double vertex_distance_mm = 12;
  std::optional<double> wavelength_nm = std::nullopt;  ///< default: the eye's reference wavelength
};

/// An eye as a page shows it.
struct LivingEye {
  EyeMap map;
  std::vector<EyeBand> bands;              ///< the widest first; none for an eye that is known exactly
  std::vector<std::string> left_out = {};  ///< what could not be mapped, and why
  /// At rest, at half of the map's accommodation and at all of it, to draw how the surfaces change; none for an eye that
  /// does not. For a measured eye these are formulas, of which only the differences are its own.
  std::vector<EyeModel> accommodating = {};
};

/// A schematic eye by name, or one from a file (pipeline/eye/schematic/schematic_eyes.hpp), which does not accommodate.
LivingEye living_schematic_eye(const std::string& name_or_file, const EyeMapSettings& settings);

/// A measured eye. It accommodates from its state in the scanner as lenses of its age do (below) to the average limit
/// of that age; that and the band are those of the eye as formulas, added to the map of its meshes. Without `optics`
/// it has neither.
LivingEye living_measured_eye(const EyeModel& eye, const UncertainOptics* optics, double age_years,
                              const EyeMapSettings& settings, const BandRefraction& refraction = {});

/// The parameters of an eye whose refraction has changed by so much: for each dioptre of stimulus its lens gains 0.0077
/// and 0.0043 /mm of curvature in front and behind, 0.058 - 0.0005 age mm of thickness and 0.0013 of equivalent index,
/// and comes 0.048 - 0.0004 age mm forward (Dubbelman, van der Heijde and Weeber, Vision Research 45, 117, 2005, as in
/// Norrby, Ophthal. Physiol. Opt. 25, 153, 2005); the stimulus is what it takes.
Eigen::VectorXd accommodated(const UncertainOptics& optics, double accommodation_D, double age_years);

}  // namespace emmetrope::raytrace
