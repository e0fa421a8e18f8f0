#pragma once
#include <complex>
#include <vector>

#include "raytrace/wavefront/wavefront.hpp"

namespace emmetrope::raytrace {

/// The wavefront on a square grid over the entrance pupil, ready for Fourier transforms: one sample is
/// 1/`per_cpd` cycle a degree of the OTF's argument. The lens in the pupil can be changed without another
/// evaluation of the terms.
class PupilFunction {
 public:
  /// \param samples_across  at least so many over the pupil's diameter
  /// \param padding  side of the transform over the pupil's diameter, at least 2 for an OTF without wrap
  /// \param up  the grid's y as a unit vector of the wavefront's axes
  PupilFunction(const Wavefront& wavefront, int samples_across, double padding,
                const Eigen::Vector2d& up = {0, 1});

  int size() const { return size_; }        ///< side of the transforms
  int per_cpd() const { return per_cpd_; }  ///< grid steps in a cycle a degree
  double pitch_arcmin() const;              ///< of the point spread function's grid

  /// |FFT|^2 of the pupil function, row by row, zero angle at index 0; sums to 1 but for
  /// the edge's squares (0.3 %). Column index grows with the angle towards the grid's x, row index towards y.
  std::vector<double> point_spread(const PowerVector& lens) const;
  /// The same for the perfect pupil.
  std::vector<double> perfect_point_spread() const;
  /// The Strehl ratio: the largest value of a point spread function over that of the perfect pupil. It lies
  /// between the grid's angles, so that Newton's method climbs from the largest of `point_spread(lens)`.
  double strehl(const PowerVector& lens, const std::vector<double>& point_spread) const;
  /// OTF of a point spread function, 1 at index 0.
  std::vector<std::complex<double>> otf(const std::vector<double>& point_spread) const;

 private:
  struct Point {
    int index;  ///< in the padded grid
    double
        amplitude;  ///< share of the grid's square inside the pupil, dimmed as the receptors' direction asks
    double wavefront_um, defocus, straight, oblique;  ///< W without piston and tilt; Z4, Z5, Z3
  };
  /// Takes the best planes out of the wavefront and of what a lens adds, so that the spread stands in the middle.
  void level();
  int signed_place(int place) const { return 2 * place > size_ ? place - size_ : place; }
  std::vector<std::complex<double>> amplitudes(const PowerVector& lens) const;  ///< of `points_`
  std::vector<double> transform(const std::vector<std::complex<double>>& field) const;

  std::vector<Point> points_;
  double light_ = 0;  ///< through all points
  int size_ = 0, per_cpd_ = 1;
  double step_mm_ = 0, wavelength_um_ = 0, radius_mm_ = 0;
};

}  // namespace emmetrope::raytrace
