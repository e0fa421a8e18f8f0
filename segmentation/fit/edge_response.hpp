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
/// E(t) + f F(t), F(t) = (E(t - 1) + E(t + 1)) / 4 - E(t) / 2. Along the edge's normal, as of a window that is round in
/// the plane: one that is a product of rows' and columns' makes edges at 45 degrees flatter by up to a sixth.
///
/// The average over [t - h, t + h] is (EI(t + h) - EI(t - h)) / 2h with EI the antiderivative of E: exact for
/// a plane surface at any inclination to the slice, so that a thick slice needs few sub-slices.
struct EdgeValue {
  double value;             ///< 0 far outside, 1 far inside
  double derivative;        ///< d value / dt at fixed h
  double scale_derivative;  ///< d value / d log k_c, that is t d/dt + h d/dh
  double filter_derivative;
};

/// \param t  edge distance in units of 1 / (2 k_c)
/// \param h  half the stretch, in the same units; >= 0
/// \param filter  f
EdgeValue averaged_edge(double t, double h, double filter);

/// E(t) itself, unfiltered; for tests.
double edge_response(double t);

}  // namespace emmetrope::segmentation
