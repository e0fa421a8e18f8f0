#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "pipeline/base/progress.hpp"
#include "raytrace/picture/gaze.hpp"

namespace emmetrope::raytrace {

/// How the eye's surfaces are represented on the device.
/// every_triangle: the paper's, each triangle tested for each ray, plain means of face normals.
enum class Representation { analytic, triangles, smooth, fast, every_triangle };

const char* to_string(Representation representation);

/// How rays are sent from a retinal point: `pupil`, spread evenly over the stop as the retina sees it;
/// `paper`, as in Wei, Patkar and Pai (2014): to the nearest surface points of random points on a cap over
/// the posterior lens, as wide as the stop, which itself stops nothing; triangles are then every_triangle.
enum class Method { pupil, paper };
const char* to_string(Method method);

/// In what the picture's pixels are equidistant.
/// retina_plane: eye x and y on the retina, behind its equator.
/// retina_arc: azimuthal equidistant, distance along the retina from its pole.
/// visual_angle: azimuthal equidistant, visual angle from the line of sight of the picture's centre.
/// perspective: tangents of these angles, as a flat picture that is looked at.
enum class Projection { retina_plane, retina_arc, visual_angle, perspective };
const char* to_string(Projection projection);

/// The pixels' places on the retina; those of retina_plane fill it, the others end where the eye sees no further.
struct RetinalGrid {
  int width = 500, height = 500;
  double field_x_mm = 6, field_y_mm = 6;  ///< width and height of retina_plane and retina_arc
  Eigen::Vector2d centre_mm{0, 0};        ///< from the pole, eye x and y, in every projection
  Projection projection = Projection::retina_plane;
  Eigen::Vector2d field_deg{0, 0};  ///< width and height of visual_angle and perspective

  bool is_angular() const {
    return projection == Projection::visual_angle || projection == Projection::perspective;
  }
  /// \throw Error (usage)
  void check() const;
};

struct TraceSettings {
  std::optional<Representation> representation;  ///< default: analytic for formulas, smooth for meshes
  RetinalGrid grid;
  int samples = 128;  ///< rays a pixel; the most of them where there is a target_error
  /// Samples are added until the picture's standard error (TraceResult::error) is no larger.
  std::optional<double> target_error;
  std::uint64_t seed = 1;               ///< common random numbers: same seed, same rays
  std::optional<double> wavelength_nm;  ///< monochromatic; spectral by default
  /// Of the chief rays by which pixels of angular projections find their place on the retina; the picture's own, or
  /// the eye's reference, where none is given.
  std::optional<double> place_wavelength_nm;
  bool achromatic = false;   ///< colours, all bent as the eye's reference wavelength is
  EyePose pose;              ///< where the eye stands and looks
  bool illuminance = false;  ///< weight by relative retinal illuminance
  /// Stiles-Crawford effect: light weighs 10^(-this r^2), r mm from the entrance pupil's centre; 0: none
  double stiles_crawford_per_mm2 = 0;
  bool diffraction = false;  ///< rays are bent at random as the entrance pupil diffracts them
  Method method = Method::pupil;
  /// Where a schematic eye is meshed: of every surface, or one for each from the retina's side outward; with
  /// one more than there are refracting surfaces the first is the retina's, which is then a mesh as well.
  std::vector<int> vertices{800};
  Verbosity verbosity;

  /// \throw Error (usage) naming the option, for one that is out of range or does not go with another
  void check() const;
};

}  // namespace emmetrope::raytrace
