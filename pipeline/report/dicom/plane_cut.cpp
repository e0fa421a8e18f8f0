#include "pipeline/report/dicom/plane_cut.hpp"

#include <vtkCellArray.h>
#include <vtkCutter.h>
#include <vtkNew.h>
#include <vtkPlane.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkStripper.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <tuple>

#include "pipeline/base/frames.hpp"

namespace emmetrope::report {
namespace {

vtkNew<vtkPolyData> to_vtk(const TriangleMesh& mesh) {
  vtkNew<vtkPoints> points;
  points->SetDataTypeToDouble();
  for (const Eigen::Vector3d& vertex : mesh.vertices) points->InsertNextPoint(vertex.data());
  vtkNew<vtkCellArray> triangles;
  for (const auto& triangle : mesh.triangles) {
    const std::array<vtkIdType, 3> corners{triangle[0], triangle[1], triangle[2]};
    triangles->InsertNextCell(3, corners.data());
  }
  vtkNew<vtkPolyData> data;
  data->SetPoints(points);
  data->SetPolys(triangles);
  return data;
}

double length_of(const Polyline& loop) {
  double length = 0;
  for (std::size_t i = 0; i < loop.size(); ++i) length += (loop[(i + 1) % loop.size()] - loop[i]).norm();
  return length;
}

/// The longest loop of edges that one triangle alone has.
Polyline rim_of(const TriangleMesh& mesh) {
  std::set<std::pair<int, int>> edges;
  for (const auto& triangle : mesh.triangles)
    for (std::size_t i = 0; i < 3; ++i) edges.emplace(triangle[i], triangle[(i + 1) % 3]);
  std::map<int, int> next;
  for (const auto& [from, to] : edges)
    if (edges.count({to, from}) == 0) next.emplace(from, to);
  Polyline longest;
  while (!next.empty()) {
    Polyline loop;
    for (auto at = next.begin(); at != next.end();) {
      loop.push_back(mesh.vertices[static_cast<std::size_t>(at->first)]);
      const int to = at->second;
      next.erase(at);
      at = next.find(to);
    }
    if (length_of(loop) > length_of(longest)) longest = std::move(loop);
  }
  return longest;
}

}  // namespace

TriangleMesh between_rims(const TriangleMesh& one, const TriangleMesh& other) {
  const Polyline rims[] = {rim_of(one), rim_of(other)};
  if (rims[0].size() < 3 || rims[1].size() < 3) return {};
  Eigen::Vector3d centre = Eigen::Vector3d::Zero(), axis = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : rims[0]) centre += point / static_cast<double>(rims[0].size());
  for (std::size_t i = 0; i < rims[0].size(); ++i)
    axis += (rims[0][i] - centre).cross(rims[0][(i + 1) % rims[0].size()] - centre);
  if (!(axis.norm() > 0)) return {};
  const Eigen::Vector3d x = axis.unitOrthogonal(), y = axis.normalized().cross(x);
  struct AtAngle {
    double angle_rad;
    int vertex;
  };
  TriangleMesh strip;
  std::array<std::vector<AtAngle>, 2> around;
  for (std::size_t i = 0; i < 2; ++i) {
    for (const Eigen::Vector3d& point : rims[i]) {
      around[i].push_back({std::atan2(y.dot(point - centre), x.dot(point - centre)),
                           static_cast<int>(strip.vertices.size())});
      strip.vertices.push_back(point);
    }
    std::sort(around[i].begin(), around[i].end(),
              [](const AtAngle& a, const AtAngle& b) { return a.angle_rad < b.angle_rad; });
    around[i].push_back({around[i].front().angle_rad + 2 * pi, around[i].front().vertex});
  }
  // Once around, each time along the rim whose next vertex comes first; of two at one angle the first rim's, wherever the
  // rims lie.
  constexpr double tie_rad = 1e-9;
  for (std::size_t i = 0, j = 0; i + 1 < around[0].size() || j + 1 < around[1].size();) {
    const bool along_first =
        j + 1 == around[1].size() ||
        (i + 1 < around[0].size() && around[0][i + 1].angle_rad < around[1][j + 1].angle_rad + tie_rad);
    const int a = around[0][i].vertex, b = around[1][j].vertex;
    strip.triangles.push_back({a, b, along_first ? around[0][++i].vertex : around[1][++j].vertex});
  }
  return strip;
}

std::vector<Polyline> cut_by_plane(const TriangleMesh& mesh, const Eigen::Vector3d& point,
                                   const Eigen::Vector3d& normal) {
  vtkNew<vtkPlane> plane;
  plane->SetOrigin(point.x(), point.y(), point.z());
  plane->SetNormal(normal.x(), normal.y(), normal.z());
  vtkNew<vtkCutter> cutter;
  cutter->SetInputData(to_vtk(mesh));
  cutter->SetCutFunction(plane);
  vtkNew<vtkStripper> stripper;
  stripper->SetInputConnection(cutter->GetOutputPort());
  stripper->JoinContiguousSegmentsOn();
  stripper->Update();
  vtkPolyData* cut = stripper->GetOutput();
  std::vector<Polyline> pieces;
  vtkNew<vtkIdList> places;
  vtkCellArray* lines = cut->GetLines();
  for (lines->InitTraversal(); lines->GetNextCell(places) != 0;) {
    Polyline& piece = pieces.emplace_back();
    for (vtkIdType i = 0; i < places->GetNumberOfIds(); ++i) {
      Eigen::Vector3d at;
      cut->GetPoint(places->GetId(i), at.data());
      piece.push_back(at);
    }
  }
  return pieces;
}

Polyline joined_outline(std::vector<Polyline> pieces) {
  Polyline outline;
  if (pieces.empty()) return outline;
  // The longest piece first, so that a crumb at a rim does not lead.
  std::sort(pieces.begin(), pieces.end(),
            [](const Polyline& a, const Polyline& b) { return a.size() > b.size(); });
  outline = std::move(pieces.front());
  pieces.erase(pieces.begin());
  while (!pieces.empty()) {
    const Eigen::Vector3d& end = outline.back();
    std::size_t nearest = 0;
    bool is_turned = false;
    double least = (pieces[0].front() - end).squaredNorm();
    for (std::size_t i = 0; i < pieces.size(); ++i)
      for (const bool turned : {false, true}) {
        const double distance = ((turned ? pieces[i].back() : pieces[i].front()) - end).squaredNorm();
        if (distance < least) std::tie(least, nearest, is_turned) = std::tuple(distance, i, turned);
      }
    Polyline next = std::move(pieces[nearest]);
    pieces.erase(pieces.begin() + static_cast<std::ptrdiff_t>(nearest));
    if (is_turned) std::reverse(next.begin(), next.end());
    outline.insert(outline.end(), next.begin(), next.end());
  }
  // Where two pieces meet both have the point.
  const auto is_same = [](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
    return (a - b).norm() < 1e-6;
  };
  outline.erase(std::unique(outline.begin(), outline.end(), is_same), outline.end());
  if (outline.size() > 1 && is_same(outline.front(), outline.back())) outline.pop_back();
  if (outline.size() < 3) outline.clear();
  return outline;
}

}  // namespace emmetrope::report
