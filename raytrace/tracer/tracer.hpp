#pragma once
#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/base/progress.hpp"
#include "raytrace/eye/exact_trace.hpp"
#include "raytrace/eye/eye_model.hpp"
#include "raytrace/scene/scene.hpp"
#include "raytrace/tracer/gaze.hpp"

namespace emmetrope::raytrace {

/// How the eye's surfaces are represented on the device.
/// every_triangle: the paper's, each triangle tested for each ray, plain means of face normals.
enum class Representation { analytic, triangles, smooth, fast, every_triangle };

/// How rays are sent from a retinal point: `pupil`, spread evenly over the stop as the retina sees it;
/// `paper`, as in Wei, Patkar and Pai (2014): to the nearest surface points of random points on a cap over
/// the posterior lens, as wide as the stop, which itself stops nothing; triangles are then every_triangle.
enum class Method { pupil, paper };

/// The image plane: pixels equidistant in eye x and y on the retina, centred on the pole.
struct RetinalGrid {
  int width = 500, height = 500;
  double field_x_mm = 6, field_y_mm = 6;
  Eigen::Vector2d centre_mm{0, 0};  ///< from the pole, eye x and y
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
};

/// Linear-light image, row after row from the top as the patient perceives it, channels interleaved.
struct LinearImage {
  int width = 0, height = 0, channels = 3;
  std::vector<float> values;
  float at(int column, int row, int channel) const {
    return values[(static_cast<std::size_t>(row) * width + column) * channels + channel];
  }
};

/// A parameter by which the image is differentiated: the eye with the parameter a little above and a little
/// below where the image is wanted. Any parameter will do, of the spectacle, the eye's surfaces on either
/// side of the stop, its media or its retina, as long as rays move smoothly with it.
struct EyeTangent {
  EyeModel ahead, behind;
  double step = 1;  ///< the parameter's difference between the two
};

struct TraceResult {
  LinearImage image;
  std::vector<LinearImage> derivatives;  ///< one per tangent
  std::map<RayState, std::uint64_t> states;
  std::uint64_t rays = 0;
  int samples = 0;  ///< rays a pixel
  /// With a target_error: standard error of the picture, rms over pixels and channels, in levels of linear
  /// light (white is 255): half the difference of two halves of the samples with noise of their own.
  std::optional<double> error;
  double wall_s = 0;               ///< scene included
  double prepare_s = 0;            ///< of it before the first ray: surfaces, aim, pixels, scene, kernels
  std::uint64_t device_bytes = 0;  ///< of meshes, pixels, textures and results on the device
  std::string device;
  std::vector<std::string> notes;  ///< how far a representation departs from its surface
  double rays_per_s() const { return wall_s > 0 ? static_cast<double>(rays) / wall_s : 0; }
};

/// A ray after it has left the eye (and the spectacle), eye frame.
struct ExitRay {
  Eigen::Vector3d position_mm, direction;
  RayState state = RayState::reached;
};

/// OpenCL devices with their programs; keeps compiled kernels between calls.
class Tracer {
 public:
  /// \param device  index or part of its name; empty: the first; several separated by commas, or "all":
  ///                they share the rows of a picture, which is the same to the bit where they are alike
  /// \param lanes   rays a work-item carries: 16 (CPU) or 1 (GPU); 0: what suits the device
  /// \throw Error (no_device) with the remedy
  explicit Tracer(const std::string& device, int threads = 0, int lanes = 0);
  ~Tracer();
  Tracer(Tracer&&) noexcept;
  Tracer& operator=(Tracer&&) noexcept;

  /// Name and driver version, for provenance.
  std::string device_name() const;

  /// Traces backward from the retina through the pupil of `eye` into `scene`.
  /// \param tangents  derivatives are those of what the same samples see: retina point and place in the pupil
  /// held \throw Error (unsupported) where the derivatives' check against exact rays fails (image_change.hpp)
  TraceResult trace(const EyeModel& eye, const Scene& scene, const TraceSettings& settings,
                    const std::vector<EyeTangent>& tangents = {}) const;

  /// The same system without a scene, on single rays that start behind it: spot diagrams, accuracy.
  std::vector<ExitRay> exit_rays(const EyeModel& eye, const std::vector<Ray>& rays_in_eye,
                                 const TraceSettings& settings) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Writes sRGB-encoded PNG from linear light; whole or not at all.
void write_png(const std::filesystem::path& file, const LinearImage& image);
/// Writes float TIFF of the linear values.
void write_tiff(const std::filesystem::path& file, const LinearImage& image);
/// Writes float OpenEXR of the linear values.
void write_exr(const std::filesystem::path& file, const LinearImage& image);

}  // namespace emmetrope::raytrace
