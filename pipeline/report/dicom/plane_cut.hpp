#pragma once
#include <Eigen/Core>
#include <vector>

#include "pipeline/eye/meshes/triangle_mesh.hpp"

namespace emmetrope::report {

using Polyline = std::vector<Eigen::Vector3d>;

/// Where a mesh meets the plane through `point` with this normal: one polyline a connected piece; a closed one ends where
/// it begins.
std::vector<Polyline> cut_by_plane(const TriangleMesh& mesh, const Eigen::Vector3d& point,
                                   const Eigen::Vector3d& normal);

/// What closes a body of two open sheets, each with one rim about the same axis: straight from rim to rim. Empty where a
/// sheet has no rim.
TriangleMesh between_rims(const TriangleMesh& one, const TriangleMesh& other);

/// The closed outline of a body whose surface is made of open sheets, from the polylines of all of them in one plane:
/// each is continued by the one whose end is nearest, straight from rim to rim. Without the first point again at its end;
/// empty where there are fewer than three points.
Polyline joined_outline(std::vector<Polyline> pieces);

}  // namespace emmetrope::report
