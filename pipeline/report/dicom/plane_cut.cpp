#include "pipeline/report/dicom/plane_cut.hpp"

#include <vtkCellArray.h>
#include <vtkCutter.h>
#include <vtkNew.h>
#include <vtkPlane.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkStripper.h>

#include <algorithm>
#include <tuple>

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

}  // namespace

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
  if (outline.size() > 1 && (outline.front() - outline.back()).norm() < 1e-6) outline.pop_back();
  if (outline.size() < 3) outline.clear();
  return outline;
}

}  // namespace emmetrope::report
