#pragma once

namespace emmetrope::segmentation {

/// A straight edge seen through a scanner that cuts k-space off at a rectangle, averaged along a stretch on
/// which the distance to the edge grows linearly (the thickness of a slice).
///
/// The edge response is E(t) = 1/2 + Si(pi t) / pi with t = 2 k_c s, s the signed distance in the image plane
/// (positive inside) and k_c the cut-off along the edge's normal (1/mm): ringing included, nothing filtered.
/// The average over [t - h, t + h] is (EI(t + h) - EI(t - h)) / 2h with EI the antiderivative of E: exact for
/// a plane surface at any inclination to the slice, so that a thick slice needs few sub-slices.
struct EdgeValue {
  double value;             ///< 0 far outside, 1 far inside
  double derivative;        ///< d value / dt at fixed h
  double scale_derivative;  ///< d value / d log k_c, that is t d/dt + h d/dh
};

/// \param t  edge distance in units of 1 / (2 k_c)
/// \param h  half the stretch, in the same units; >= 0
EdgeValue averaged_edge(double t, double h);

/// E(t) itself, from its series and asymptotic expansion; for tests and tables.
double edge_response(double t);

}  // namespace emmetrope::segmentation
