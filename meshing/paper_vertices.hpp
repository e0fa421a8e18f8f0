#pragma once

/// How many vertices each surface has where the user says nothing: as many as Wei, Patkar and Pai (2014) gave it.
namespace emmetrope::meshing::paper_vertices {

inline constexpr int cornea_anterior = 613, cornea_posterior = 723;
inline constexpr int lens_anterior = 565, lens_posterior = 1516;
inline constexpr int retina = 973;

}  // namespace emmetrope::meshing::paper_vertices
