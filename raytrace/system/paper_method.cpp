#include "raytrace/system/paper_method.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "pipeline/base/error.hpp"
#include "raytrace/system/box_hierarchy.hpp"
#include "raytrace/system/int_bits.hpp"

namespace emmetrope::raytrace {

namespace {

/// The records of kernels/paper.cl, in the order given.
DeviceSurface sheet(const TriangleMesh& mesh, const std::vector<int>& order,
                    const std::vector<Eigen::Vector3d>& normals) {
  DeviceSurface form;
  form.kind = Operation::every_triangle;
  form.columns = static_cast<int>(order.size());
  auto& records = form.records;
  const auto push = [&](const Eigen::Vector3d& v) {
    for (int k = 0; k < 3; ++k) records.push_back(static_cast<float>(v[k]));
  };
  for (const int triangle : order) {
    const auto& t = mesh.triangles[triangle];
    const Eigen::Vector3d a = mesh.vertices[t[0]], u = mesh.vertices[t[1]] - a, v = mesh.vertices[t[2]] - a;
    const Eigen::Vector3d cross = u.cross(v), normal = cross.normalized();
    const Eigen::Vector3d along_u = v.cross(cross) / cross.squaredNorm(),
                          along_v = cross.cross(u) / cross.squaredNorm();
    push(normal);
    records.push_back(static_cast<float>(normal.dot(a)));
    push(along_u);
    records.push_back(static_cast<float>(-along_u.dot(a)));
    push(along_v);
    records.push_back(static_cast<float>(-along_v.dot(a)));
    push(a);
    records.push_back(0);
    for (const int vertex : t) push(normals[vertex]);
    push(u);
    push(v);
    records.push_back(0);
  }
  return form;
}

}  // namespace

DeviceSurface every_triangle(const TriangleMesh& mesh) {
  std::vector<Eigen::Vector3d> normals(mesh.vertices.size(), Eigen::Vector3d::Zero());
  for (const auto& t : mesh.triangles) {
    const Eigen::Vector3d& a = mesh.vertices[t[0]];
    const Eigen::Vector3d normal = (mesh.vertices[t[1]] - a).cross(mesh.vertices[t[2]] - a).normalized();
    for (const int vertex : t) normals[vertex] += normal.z() < 0 ? Eigen::Vector3d(-normal) : normal;
  }
  for (auto& normal : normals) normal.normalize();
  std::vector<int> order(mesh.triangles.size());
  std::iota(order.begin(), order.end(), 0);
  return sheet(mesh, order, normals);
}

DeviceSurface sheet_hierarchy(const TriangleMesh& mesh) {
  std::vector<std::array<Eigen::Vector3d, 3>> corners;
  for (const auto& t : mesh.triangles)
    corners.push_back({mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]});
  const BoxHierarchy hierarchy = make_box_hierarchy(corners);
  DeviceSurface form = sheet(mesh, hierarchy.order, mesh.normals);
  form.parameters = {static_cast<double>(hierarchy.node_count())};
  form.seeds = hierarchy.nodes;
  form.note = "no height field along its axis: its own triangles, found through a hierarchy of boxes";
  return form;
}

std::vector<float> aim_cap(const EyeModel& eye, const std::map<std::string, int>& operation_of) {
  const auto& surfaces = eye.surfaces;
  const auto lens = std::find_if(std::next(surfaces.rbegin()), surfaces.rend(),
                                 [](const auto& surface) { return !surface.is_stop(); });
  const Surface* stop = eye.stop();
  if (stop == nullptr || lens == surfaces.rend())
    throw input_error("eye \"" + eye.name + "\" has no stop, which says how wide the paper's cap is",
                      "add a surface of type stop with diameter_mm");
  if (!lens->tilt_deg.isZero())
    throw unsupported_error("the paper's method: surface \"" + lens->name + "\" is tilted",
                            "use the default method");
  const double mean_curvature_per_mm = lens->shape->vertex_curvature().trace() / 2;
  const double radius_mm = 1 / (std::abs(mean_curvature_per_mm) > 1e-4 ? mean_curvature_per_mm : 1e-4);
  const double reach_mm = std::min(stop->stop_diameter_mm / 2, 0.99 * std::abs(radius_mm));
  const double depth_mm =
      radius_mm - std::copysign(std::sqrt(radius_mm * radius_mm - reach_mm * reach_mm), radius_mm);
  const Eigen::Vector3d vertex = lens->eye_from_surface().translation();
  return {static_cast<float>(vertex.x()), static_cast<float>(vertex.y()),
          static_cast<float>(vertex.z()), static_cast<float>(radius_mm),
          static_cast<float>(depth_mm),   int_bits(operation_of.at(lens->name))};
}

}  // namespace emmetrope::raytrace
