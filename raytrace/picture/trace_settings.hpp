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

/// The image plane: pixels equidistant in eye x and y on the retina, centred on the pole.
struct RetinalGrid {
  int width = 500, height = 500;
  double field_x_mm = 6, field_y_mm = 6;
  Eigen::Vector2d centre_mm{0, 0};  ///< from the pole, eye x and y

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
  bool achromatic = false;              ///< colours, all bent as the eye's reference wavelength is
  EyePose pose;                         ///< where the eye stands and looks
  bool illuminance = false;             ///< weight by relative retinal illuminance
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
