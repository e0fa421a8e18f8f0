#include "pipeline/eye/model/mesh_shape.hpp"

#include <Eigen/Geometry>
#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/log.hpp"
#include "pipeline/eye/model/clean_sheet.hpp"

namespace emmetrope {
namespace {

/// The crossings of a sheet with its axis, without doubles where the axis meets an edge.
std::vector<TriangleHierarchy::Hit> axis_crossings(const TriangleHierarchy& hierarchy) {
  const Ray axis{{0, 0, 0}, {0, 0, -1}};
  std::vector<TriangleHierarchy::Hit> crossings;
  for (const TriangleHierarchy::Hit& hit : hierarchy.all(axis))
    if (crossings.empty() || hit.distance_mm - crossings.back().distance_mm > 1e-6) crossings.push_back(hit);
  return crossings;
}

/// Optical surfaces, spectacles included, are some millimetres to some centimetres wide.
void check_unit(const TriangleMesh& mesh) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& vertex : mesh.vertices) box.extend(vertex);
  const double width_mm = box.isEmpty() ? 0 : box.diagonal().maxCoeff();
  if (!(width_mm >= 1 && width_mm <= 300))
    throw input_error("the mesh is " + std::to_string(width_mm) + " mm wide, no optical surface's size",
                      width_mm < 1 ? "lengths are mm; are they metres or centimetres?"
                                   : "lengths are mm; are they micrometres?");
}

double axis_depth_mm(const TriangleMesh& mesh) {
  const auto crossings = axis_crossings(TriangleHierarchy(mesh));
  if (crossings.size() != 1)
    throw input_error("the mesh crosses the axis of its surface " + std::to_string(crossings.size()) +
                          " times; an optical surface is an open sheet that crosses it once",
                      "check the mesh's frame (SPACE=LPS and lps_from_eye) and cut closed meshes open");
  return crossings.front().distance_mm;
}

Eigen::Vector3d interpolated_normal(const TriangleMesh& mesh, const TriangleHierarchy::Hit& hit) {
  const auto& corners = mesh.triangles[hit.triangle];
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  for (int k = 0; k < 3; ++k) normal += hit.weights[k] * mesh.normals[corners[k]];
  return normal.normalized();
}

}  // namespace

const char* to_string(MeshInterpolation interpolation) {
  return interpolation == MeshInterpolation::smooth ? "smooth" : "triangles";
}

void estimate_normals(TriangleMesh& mesh) {
  mesh.normals.assign(mesh.vertices.size(), Eigen::Vector3d::Zero());
  for (const auto& t : mesh.triangles)
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d& corner = mesh.vertices[t[k]];
      const Eigen::Vector3d a = mesh.vertices[t[(k + 1) % 3]] - corner,
                            b = mesh.vertices[t[(k + 2) % 3]] - corner;
      // |a x b| = l1 l2 sin(angle), so that the weight times the unit normal is a x b / (l1 l2)^2.
      const double lengths = a.squaredNorm() * b.squaredNorm();
      if (lengths > 0) mesh.normals[t[k]] += a.cross(b) / lengths;
    }
  for (Eigen::Vector3d& normal : mesh.normals)
    normal = normal.squaredNorm() > 0 ? normal.normalized() : Eigen::Vector3d(0, 0, 1);
}

TriangleMesh transformed(const Eigen::Isometry3d& target_from_source, const TriangleMesh& mesh) {
  TriangleMesh result = mesh;
  for (Eigen::Vector3d& vertex : result.vertices) vertex = target_from_source * vertex;
  for (Eigen::Vector3d& normal : result.normals) normal = target_from_source.linear() * normal;
  return result;
}

MeshShape::MeshShape(TriangleMesh mesh_in_shape, MeshInterpolation interpolation, MeshSource source)
    : mesh_(std::move(mesh_in_shape)),
      interpolation_(interpolation),
      source_(std::move(source)),
      hierarchy_(mesh_) {
  // A facet lies behind the smooth surface through its corners, at the vertex too.
  constexpr double largest_sagitta_mm = 1;
  if (std::abs(axis_depth_mm(mesh_)) > largest_sagitta_mm)
    throw input_error("the mesh does not cross the axis at its surface's vertex");
  if (mesh_.normals.empty()) estimate_normals(mesh_);
  if (interpolated_normal(mesh_, axis_crossings(hierarchy_).front()).z() < 0) {
    for (Eigen::Vector3d& normal : mesh_.normals) normal = -normal;
    for (auto& triangle : mesh_.triangles) std::swap(triangle[1], triangle[2]);
    hierarchy_ = TriangleHierarchy(mesh_);
  }
  patch_ = HeightField::fit(mesh_);
}

std::optional<ShapeHit> MeshShape::intersect_triangles(const Ray& ray) const {
  const std::optional<TriangleHierarchy::Hit> hit = hierarchy_.nearest(ray);
  if (!hit) return std::nullopt;
  return ShapeHit{hit->distance_mm, ray.origin + hit->distance_mm * ray.direction,
                  interpolated_normal(mesh_, *hit)};
}

std::optional<ShapeHit> MeshShape::intersect(const Ray& ray) const {
  if (interpolation_ == MeshInterpolation::smooth && patch_)
    if (std::optional<ShapeHit> hit = patch_->intersect(ray)) return hit;
  return intersect_triangles(ray);
}

/// The sheet at (x, y) that looks out of the eye, first from the front: a globe's sheet may fold back beyond
/// its equator.
std::optional<ShapeHit> MeshShape::facing(double x_mm, double y_mm) const {
  const Ray ray{{x_mm, y_mm, 0}, {0, 0, -1}};
  for (const TriangleHierarchy::Hit& hit : hierarchy_.all(ray)) {
    const Eigen::Vector3d n = interpolated_normal(mesh_, hit);
    if (n.z() > 0) return ShapeHit{hit.distance_mm, ray.origin + hit.distance_mm * ray.direction, n};
  }
  return std::nullopt;
}

std::optional<double> MeshShape::depth_mm(double x_mm, double y_mm) const {
  if (interpolation_ == MeshInterpolation::smooth && patch_ && patch_->covers(x_mm, y_mm))
    return patch_->at(x_mm, y_mm).depth_mm;
  const std::optional<ShapeHit> hit = facing(x_mm, y_mm);
  if (!hit) return std::nullopt;
  return -hit->position.z();
}

std::optional<Eigen::Vector3d> MeshShape::normal(double x_mm, double y_mm) const {
  if (interpolation_ == MeshInterpolation::smooth && patch_ && patch_->covers(x_mm, y_mm)) {
    const Eigen::Vector2d slope = patch_->at(x_mm, y_mm).gradient;
    return Eigen::Vector3d(slope.x(), slope.y(), 1).normalized();
  }
  const std::optional<ShapeHit> hit = facing(x_mm, y_mm);
  if (!hit) return std::nullopt;
  return hit->normal;
}

Eigen::Matrix2d MeshShape::vertex_curvature() const {
  if (patch_) return patch_->at(0, 0).hessian_per_mm;
  // No patch: the change of the interpolated normals over a millimetre.
  constexpr double h = 0.5;
  Eigen::Matrix2d curvature = Eigen::Matrix2d::Zero();
  for (int k = 0; k < 2; ++k) {
    const Eigen::Vector2d step = h * Eigen::Vector2d::Unit(k);
    const std::optional<Eigen::Vector3d> ahead = normal(step.x(), step.y()),
                                         behind = normal(-step.x(), -step.y());
    if (!ahead || !behind) return Eigen::Matrix2d::Zero();
    curvature.col(k) = (ahead->head<2>() / ahead->z() - behind->head<2>() / behind->z()) / (2 * h);
  }
  return (curvature + curvature.transpose()) / 2;
}

Json MeshShape::to_json() const {
  Json json{{"type", type()}, {"file", source_.file.string()}};
  if (!source_.sha256.empty()) json["sha256"] = source_.sha256;
  if (interpolation_ != MeshInterpolation::smooth) json["interpolation"] = to_string(interpolation_);
  return json;
}

Surface make_mesh_surface(const std::string& name, const TriangleMesh& mesh_in_eye,
                          const std::string& medium_after, MeshInterpolation interpolation,
                          const MeshSource& source) {
  check_unit(mesh_in_eye);
  const auto shape_at = [&](double depth_mm) {
    Eigen::Isometry3d surface_from_eye = Eigen::Isometry3d::Identity();
    surface_from_eye.translation().z() = depth_mm;
    return std::make_shared<MeshShape>(transformed(surface_from_eye, mesh_in_eye), interpolation, source);
  };
  Surface surface;
  surface.name = name;
  surface.position_mm = axis_depth_mm(mesh_in_eye);
  surface.medium_after = medium_after;
  auto shape = shape_at(surface.position_mm);
  // The vertex is where rays meet the surface, not where the axis meets a facet.
  if (const double sagitta_mm = shape->depth_mm(0, 0).value_or(0); sagitta_mm != 0) {
    surface.position_mm += sagitta_mm;
    shape = shape_at(surface.position_mm);
  }
  surface.shape = shape;
  return surface;
}

Surface read_mesh_surface(const std::string& name, const std::filesystem::path& file,
                          const std::optional<Eigen::Isometry3d>& lps_from_eye,
                          const std::string& medium_after, MeshInterpolation interpolation) {
  MeshFile read = read_mesh(file);
  if (read.says_ras)
    throw input_error(
        file.string() + ": the mesh says SPACE=RAS, which is not read",
        "save it in LPS (3D Slicer: coordinate system of the file), with lps_from_eye in the eye");
  if (read.says_lps) {
    if (!lps_from_eye)
      throw input_error(file.string() + ": the mesh says SPACE=LPS, but the eye has no lps_from_eye",
                        "add lps_from_eye to the eye");
    read.mesh = transformed(lps_from_eye->inverse(), read.mesh);
  }
  try {
    for (const std::string& not_used : clean_sheet(read)) spdlog::warn("{}: {}", file.string(), not_used);
    return make_mesh_surface(name, read.mesh, medium_after, interpolation, {file, sha256_of_file(file)});
  } catch (const Error& error) {
    throw Error(error.status(), file.string() + ": " + error.what(), error.remedy());
  }
}

}  // namespace emmetrope
