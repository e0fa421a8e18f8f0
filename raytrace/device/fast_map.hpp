#pragma once
#include <array>
#include <vector>

#include "pipeline/eye/model/eye_model.hpp"
#include "raytrace/device/opencl.hpp"
#include "raytrace/picture/trace_settings.hpp"
#include "raytrace/retina/pupil_aim.hpp"
#include "raytrace/system/optical_system.hpp"

namespace emmetrope::raytrace {

/// The smooth map from (retina point, point of the unit disc that the aim ellipse is made of) to the ray
/// behind the eye: polynomials of total degree `degree` in the disc, their coefficients tensor products of
/// `nodes` Chebyshev nodes on each of `tiles` x `tiles` parts of the field. Values: x and y on the plane z =
/// plane_z_mm, slopes L/N and M/N, squared radius at the stop over the stop's.
struct FastMap {
  static constexpr int outputs = 5;

  int degree = 5, nodes = 8, tiles = 1;
  double plane_z_mm = 0;
  /// A table a wavelength (one where all are the same): coefficient k of node (i, j) of tile (p, q) at
  /// (((q * tiles + p) * nodes + j) * nodes + i) * outputs * terms() + k, outputs one after the other.
  std::vector<std::vector<double>> tables;
  /// Against exactly traced random rays, within the stop.
  double direction_rms_arcmin = 0, direction_max_arcmin = 0, position_max_um = 0;

  int terms() const { return (degree + 1) * (degree + 2) / 2; }
  /// -DFAST=1 and what else kernels/fast.cl needs.
  std::string definitions() const;
  /// What it is and how far it misses exact rays, in words.
  std::string note() const;
  /// Coefficients along the middle of every pixel row, as kernels/fast.cl takes them.
  /// \param lanes  16: the wavelengths side by side where there are several
  std::vector<float> rows(int height, int lanes) const;
  /// The weights of the nodes for every pixel column.
  std::vector<float> column_weights(int width) const;
};

/// Fits the map to rays traced on the device and checks it against 10 000 exact random ones (float64).
/// \param system  with formulas or smooth patches
/// \throw Error (unsupported) where no map of the sizes that are tried comes within 0.01 arcmin of every ray
FastMap make_fast_map(OpenCl& cl, const EyeModel& eye, const RetinalGrid& grid, const PupilAim& aim,
                      const OpticalSystem& system, const std::array<double, wavelength_count>& wavelength_nm,
                      std::uint64_t seed, int threads);

}  // namespace emmetrope::raytrace
