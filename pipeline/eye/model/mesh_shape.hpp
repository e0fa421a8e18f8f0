#pragma once
#include <filesystem>
#include <optional>

#include "pipeline/eye/meshes/triangle_mesh.hpp"
#include "pipeline/eye/model/eye_model.hpp"
#include "pipeline/eye/surfaces/height_field.hpp"
#include "pipeline/eye/surfaces/triangle_hierarchy.hpp"

namespace emmetrope {

/// How rays meet a mesh: `smooth`, a C2 patch through it; `triangles`, its own triangles with interpolated
/// vertex normals.
enum class MeshInterpolation { smooth, triangles };
const char* to_string(MeshInterpolation interpolation);

/// The file that a mesh was read from, and its SHA-256 then; nothing for a mesh that is not on disk.
struct MeshSource {
  std::filesystem::path file;
  std::string sha256;
};

/// An open triangle sheet as an optical surface, in its own frame: rays along the axis meet it at the origin, by its
/// patch where it is smooth, else by its triangles.
class MeshShape : public Shape {
 public:
  /// \param mesh_in_shape  normals are estimated (Max 1999) where there are none, and turned to positive z at
  ///   the vertex
  /// \param source  what eye.json names
  /// \throw Error (input_invalid) when the sheet does not cross the axis
  MeshShape(TriangleMesh mesh_in_shape, MeshInterpolation interpolation, MeshSource source = {});

  std::string type() const override { return "mesh"; }
  std::optional<double> depth_mm(double x_mm, double y_mm) const override;
  std::optional<Eigen::Vector3d> normal(double x_mm, double y_mm) const override;
  /// Smooth: the patch inside its outline, the triangles elsewhere. Triangles: the nearest triangle ahead.
  std::optional<ShapeHit> intersect(const Ray& ray_in_shape) const override;
  Eigen::Matrix2d vertex_curvature() const override;
  Json to_json() const override;

  /// The nearest triangle ahead, with interpolated vertex normal, by a bounding volume hierarchy.
  std::optional<ShapeHit> intersect_triangles(const Ray& ray_in_shape) const;

  const TriangleMesh& mesh() const { return mesh_; }
  /// Null where the mesh is no height field: rays then meet the triangles.
  const HeightField* patch() const { return patch_ ? &*patch_ : nullptr; }
  MeshInterpolation interpolation() const { return interpolation_; }

 private:
  std::optional<ShapeHit> facing(double x_mm, double y_mm) const;

  TriangleMesh mesh_;
  MeshInterpolation interpolation_;
  MeshSource source_;
  TriangleHierarchy hierarchy_;
  std::optional<HeightField> patch_;
};

/// The mesh that a surface is; null where it is a formula, or a stop.
inline const MeshShape* mesh_of(const Surface& surface) {
  return dynamic_cast<const MeshShape*>(surface.shape.get());
}

/// An optical surface from a mesh in the eye's frame: position_mm is where rays along the
/// eye's axis meet it.
Surface make_mesh_surface(const std::string& name, const TriangleMesh& mesh_in_eye,
                          const std::string& medium_after,
                          MeshInterpolation interpolation = MeshInterpolation::smooth,
                          const MeshSource& source = {});

/// The same from a file: SPACE=LPS meshes are brought into the eye's frame by `lps_from_eye`.
/// \throw Error (input_invalid) when the file says LPS and there is no lps_from_eye, or the sheet misses the
///   axis
Surface read_mesh_surface(const std::string& name, const std::filesystem::path& file,
                          const std::optional<Eigen::Isometry3d>& lps_from_eye,
                          const std::string& medium_after,
                          MeshInterpolation interpolation = MeshInterpolation::smooth);

/// The vertices moved by a rigid transform, normals turned with them.
TriangleMesh transformed(const Eigen::Isometry3d& target_from_source, const TriangleMesh& mesh);

/// Vertex normals from the triangles alone, weighted by sin(angle)/(l1 l2): Max, "Weights for computing
/// vertex normals from facet normals", J. Graphics Tools 4 (1999); exact on spheres. Replaces those that are
/// there.
void estimate_normals(TriangleMesh& mesh);

}  // namespace emmetrope
