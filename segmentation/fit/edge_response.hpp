#pragma once

namespace emmetrope::segmentation {

/// A straight edge seen through a scanner that cuts k-space off at a rectangle, averaged along a stretch on
/// which the distance to the edge grows linearly (the thickness of a slice).
///
/// The edge response is E(t) = 1/2 + Si(pi t) / pi with t = 2 k_c s, s the signed distance in the image plane
/// (positive inside) and k_c the cut-off along the edge's normal (1/mm): ringing included.
///
/// A scanner's filter damps the outer frequencies by 1 - f/2 + f/2 cos(pi k / k_c): f = 1 is a Hann window, f < 0
/// enhances edges; an edge whose frequencies decay to exp(-1) along an echo train is within 0.06 of that of f = 0.65
/// with a k_c 4 % farther out. A factor cos(pi k / k_c) moves the image by one unit of t either way, so that E becomes
/// E(t) + f F(t), F(t) = (E(t - 1) + E(t + 1)) / 4 - E(t) / 2.
///
/// Rows, columns and encoded slices are filtered each, and an edge askew to them by all: k n_i / k_i is what each sees of
/// a frequency k along the normal n. The axis along which k_c is reached first moves the image by one unit, the others
/// together as one filter of the same curvature would, by s units, s^2 + 1 the sum of (k_c n_i / k_i)^2: within 0.01 of the
/// product of three windows for f from 0.25 to 1, towards the box's corner 0.023 (by one axis alone: 0.08 to 0.13 there).
///
/// The average over [t - h, t + h] is (EI(t + h) - EI(t - h)) / 2h with EI the antiderivative of E: exact for
/// a plane surface at any inclination to the slice, so that a thick slice needs few sub-slices.
struct EdgeValue {
  double value;             ///< 0 far outside, 1 far inside
  double derivative;        ///< d value / dt at fixed h
  double scale_derivative;  ///< d value / d log k_c, that is t d/dt + h d/dh
  double filter_derivative;
  double askew_derivative;  ///< d value / d s^2
};

/// \param t  edge distance in units of 1 / (2 k_c)
/// \param h  half the stretch, in the same units; >= 0
/// \param filter  f
/// \param askew_squared  s^2; >= 0
EdgeValue averaged_edge(double t, double h, double filter, double askew_squared = 0);

/// E(t) itself, unfiltered; for tests.
double edge_response(double t);

}  // namespace emmetrope::segmentation
