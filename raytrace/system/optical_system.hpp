#pragma once
#include <array>
#include <map>
#include <string>
#include <vector>

#include "pipeline/eye/model/eye_model.hpp"
#include "raytrace/picture/spectrum.hpp"
#include "raytrace/picture/trace_settings.hpp"

namespace emmetrope::raytrace {

/// What a ray from the retina meets, in order; the numbers are those of kernels/trace.cl.
enum class Operation : int {
  sphere = 0,
  quadric,
  biconic,
  patch,
  stop,
  rotate,
  triangles,
  gradient,
  every_triangle
};

/// An eye as the kernels take it.
struct OpticalSystem {
  static constexpr int parameters = 16;       ///< floats an operation
  static constexpr int gradient_floats = 48;  ///< floats a gradient medium, as kernels/surfaces.cl says
  static constexpr int gradient_shifts = 16;  ///< the first of them that shifts the index
  static constexpr int gradient_turn = 32;    ///< the first of them that turns into its frame

  std::vector<Operation> kinds;
  std::vector<float> operations;            ///< `parameters` each
  std::vector<float> ratios;                ///< index before over index after, `wavelength_count` each
  std::vector<float> gradients;             ///< `gradient_floats` each
  bool has_body = false;                    ///< a ray may pass beside some surfaces
  std::vector<float> records;               ///< 16 floats a patch cell
  std::map<std::string, int> operation_of;  ///< by surface name
  std::vector<std::string> notes;           ///< how far a representation departs from its surface

  bool has(Operation kind) const;
  /// "-DHAS_SPHERE=1 ...": only what occurs is compiled.
  std::string definitions() const;
  /// " -DOPERATIONS=7 -DKINDS=0x40000UL ...": the sequence itself, for a kernel made for eyes of this form;
  /// empty where it has more than 16 operations or others than formulas, whose code would grow too long.
  std::string sequence_definitions() const;
};

/// How an eye is brought to the device.
struct SystemForm {
  Representation representation =
      Representation::analytic;    ///< a mesh is never analytic: as it says itself then
  std::vector<int> vertices{800};  ///< where a formula is meshed: TraceSettings::vertices
  int threads = 1;                 ///< that prepare surfaces
  bool every_surface = false;      ///< a ray that misses a body is lost, not led past it
};

/// \throw Error (unsupported) for a surface that the device cannot represent
OpticalSystem make_optical_system(const EyeModel& eye,
                                  const std::array<double, wavelength_count>& wavelength_nm,
                                  const SystemForm& form);

}  // namespace emmetrope::raytrace
