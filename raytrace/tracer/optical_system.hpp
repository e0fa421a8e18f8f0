#pragma once
#include <array>
#include <map>
#include <string>
#include <vector>

#include "raytrace/eye/eye_model.hpp"
#include "raytrace/tracer/spectrum.hpp"
#include "raytrace/tracer/tracer.hpp"

namespace emmetrope::raytrace {

/// What a ray from the retina meets, in order; the numbers are those of kernels/trace.cl.
enum class Operation : int { sphere = 0, quadric, biconic, patch, stop, rotate, triangles };

/// An eye as the kernels take it.
struct OpticalSystem {
  static constexpr int parameters = 16;  ///< floats an operation

  std::vector<Operation> kinds;
  std::vector<float> operations;            ///< `parameters` each
  std::vector<float> ratios;                ///< index before over index after, `wavelength_count` each
  std::vector<float> records;               ///< 16 floats a patch cell
  std::map<std::string, int> operation_of;  ///< by surface name
  std::vector<std::string> notes;           ///< how far a representation departs from its surface

  bool has(Operation kind) const;
  /// "-DHAS_SPHERE=1 ...": only what occurs is compiled.
  std::string definitions() const;
};

/// \param representation  of surfaces that are formulas; a mesh is smooth or triangles
/// \param vertices        a surface, where a formula is meshed
/// \throw Error (unsupported) for a surface that the device cannot represent
OpticalSystem make_optical_system(const EyeModel& eye,
                                  const std::array<double, wavelength_count>& wavelength_nm,
                                  Representation representation, int vertices);

}  // namespace emmetrope::raytrace
