#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "pipeline/eye/model/eye_model.hpp"

namespace emmetrope::raytrace {

/// An eye in every state that an EyeMap holds.
struct EyeStates {
  std::function<EyeModel(double accommodation_D)> at;
  double largest_accommodation_D = 0;
};

struct EyeMapSettings {
  double field_mm = 6;  ///< width and height on the retina, about its pole
  double pupil_mm = 6;  ///< the widest iris aperture
  double shortest_nm = 390, longest_nm = 700;
  double reference_nm = 555;
  std::uint64_t seed = 1;  ///< of the rays that check it
  int threads = 1;
};

/// An eye as polynomials: from a point of the retina and a point of the stop, at any wavelength and accommodation, to
/// the ray before the cornea, and the ray's hits inside. Small enough for a page, whose shaders evaluate it.
///
/// Coordinates, all -1 to 1 but the last:
///   u, v  on the retina, eye x and y over half the field;
///   p     place in the stop over the radius of the widest aperture, in the stop's frame (|p| <= 1; a smaller pupil is
///         a part of it);
///   w     of 1/wavelength^2 between longest_nm and shortest_nm;
///   a     of accommodation between 0 and its largest.
/// A value is the sum over terms of T_l(a) T_k(w) T_i(u) T_j(v) p_x^m p_y^n with Chebyshev polynomials T; (i, j) with
/// i + j <= degree, i rising, for j = 0 ... degree; (m, n) likewise.
struct EyeMap {
  /// The ray in air: x and y (mm) on the plane of the corneal apex, slopes L/N and M/N.
  static constexpr int outputs = 4;
  static constexpr int pupil_degree = 7, field_degree = 7;
  /// Share of light of a part of the stop against the mean, as rays spread evenly over the pupil that the retina sees.
  static constexpr int weight_pupil_degree = 2, weight_field_degree = 2;
  static constexpr int path_degree = 3;  ///< of the hits inside, in the pupil and over the field
  static int terms(int degree) { return (degree + 1) * (degree + 2) / 2; }

  double field_mm = 0, pupil_mm = 0, shortest_nm = 0, longest_nm = 0, reference_nm = 0;
  double largest_accommodation_D = 0;
  int waves = 1, accommodations = 1;  ///< numbers of Chebyshev terms
  int state_degree = 0;               ///< of accommodation and wavelength together: terms beyond are 0
  /// [accommodation][wave][field term][pupil term][output]
  std::vector<double> rays;
  /// At the reference wavelength: [accommodation][field term][pupil term]
  std::vector<double> weights;
  /// Where rays meet the refracting surfaces, the retina's side first, and the stop among them, eye frame, mm, at the
  /// reference wavelength: [accommodation][surface][field term][pupil term][x, y, z]
  std::vector<std::string> surfaces;
  std::vector<double> paths;
  /// Against exactly traced rays at random in all coordinates, and how many of them.
  double direction_rms_arcmin = 0, direction_max_arcmin = 0, position_max_um = 0;
  int checked_rays = 0;

  /// In words, for who reads the page.
  std::string note() const;
};

/// \throw Error (unsupported) where rays from the field to the stop are lost, or no map comes within 0.1 arcmin and 3
///   um of every ray that checks it (0.02 arcmin rms); (input_invalid) for an eye without a stop
EyeMap make_eye_map(const EyeStates& states, const EyeMapSettings& settings);

/// The part `rays` of a map that holds one eye at rest at the reference wavelength alone.
std::vector<double> rays_at_rest(const EyeModel& eye, const EyeMapSettings& settings);

/// The widest of some pupils down to 4 mm for which there is a map.
EyeMap widest_eye_map(const EyeStates& states, const EyeMapSettings& settings);

/// What `changed` differs from itself at rest, added to `eye`: the accommodation of formulas for meshes.
/// \pre the same settings; one accommodation in `eye`
EyeMap with_accommodation_of(const EyeMap& eye, const EyeMap& changed);

}  // namespace emmetrope::raytrace
