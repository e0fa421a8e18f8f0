#pragma once
#include <optional>

#include "pipeline/eye/optics/retina_point.hpp"

namespace emmetrope::raytrace {

/// Length of the shortest way along the retina between two of its points, mm: a chain of points that is pulled tight along
/// the surface, finer and finer, its chords bent by their normals. Within 1e-4 of itself on ellipsoids.
/// \return nothing where the way leads beyond the retina
std::optional<double> geodesic_mm(const EyeModel& eye, const Eigen::Vector3d& from,
                                  const Eigen::Vector3d& to);

}  // namespace emmetrope::raytrace
