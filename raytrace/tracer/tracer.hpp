#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/eye/model/eye_model.hpp"
#include "pipeline/eye/optics/exact_trace.hpp"
#include "raytrace/picture/eye_tangent.hpp"
#include "raytrace/picture/linear_image.hpp"
#include "raytrace/picture/trace_settings.hpp"
#include "raytrace/scene/scene.hpp"

namespace emmetrope::raytrace {

struct TraceResult {
  LinearImage image;
  std::vector<char> unseen;  ///< pixels where the eye sees nothing, row after row; empty where it sees all
  std::vector<LinearImage> derivatives;  ///< one per tangent
  /// With illuminance: solid angle times cosine of the light at the picture's middle pixel (at the nearest that any
  /// reaches), of whose light the picture is a multiple. Times radiance and the square of the vitreous's index it is the irradiance.
  double middle_projected_sr = 0;
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
  /// \param device  index or part of its name; empty: the first; several separated by commas, or "all": they
  ///   share the rows of a picture, which is the same to the bit where they are alike
  /// \param lanes  rays a work-item carries: 16 (CPU) or 1 (GPU); 0: what suits the device
  /// \throw Error (no_device) with the remedy
  explicit Tracer(const std::string& device, int threads = 0, int lanes = 0);
  ~Tracer();
  Tracer(Tracer&&) noexcept;
  Tracer& operator=(Tracer&&) noexcept;

  /// Name and driver version, for provenance.
  std::string device_name() const;

  /// Traces backward from the retina through the pupil of `eye` into `scene`.
  /// \param tangents  derivatives are those of what the same samples see: retina point and place in the pupil
  ///   held
  /// \throw Error (unsupported) where the derivatives' check against exact rays fails (image_change.hpp)
  TraceResult trace(const EyeModel& eye, const Scene& scene, const TraceSettings& settings,
                    const std::vector<EyeTangent>& tangents = {}) const;

  /// The same system without a scene, on single rays that start behind it: spot diagrams, accuracy.
  std::vector<ExitRay> exit_rays(const EyeModel& eye, const std::vector<Ray>& rays_in_eye,
                                 const TraceSettings& settings) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace emmetrope::raytrace
