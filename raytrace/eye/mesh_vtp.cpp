#include <vtkCallbackCommand.h>
#include <vtkCellArray.h>
#include <vtkDataArray.h>
#include <vtkDoubleArray.h>
#include <vtkFieldData.h>
#include <vtkIdList.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkStringArray.h>
#include <vtkXMLPolyDataReader.h>
#include <vtkXMLPolyDataWriter.h>

#include "pipeline/base/error.hpp"
#include "raytrace/eye/mesh_formats.hpp"

namespace emmetrope {
namespace {

/// VTK reports faults as events, not by return values.
struct FaultListener {
  std::string fault;
  vtkNew<vtkCallbackCommand> command;
  FaultListener() {
    command->SetClientData(this);
    command->SetCallback([](vtkObject*, unsigned long, void* self, void* text) {
      static_cast<FaultListener*>(self)->fault = text ? static_cast<const char*>(text) : "unknown fault";
    });
  }
};

}  // namespace

MeshFile parse_vtp(const std::string& bytes) {
  vtkNew<vtkXMLPolyDataReader> reader;
  FaultListener listener;
  reader->AddObserver("ErrorEvent", listener.command);
  reader->AddObserver("WarningEvent", listener.command);
  reader->ReadFromInputStringOn();
  reader->SetInputString(bytes);
  reader->Update();
  vtkPolyData* data = reader->GetOutput();
  if (!listener.fault.empty() || reader->GetErrorCode() != 0 || data == nullptr ||
      data->GetNumberOfPoints() == 0)
    throw input_error("no readable VTP mesh, or it is cut short");

  MeshFile result;
  for (vtkIdType i = 0; i < data->GetNumberOfPoints(); ++i) {
    double p[3];
    data->GetPoint(i, p);
    result.mesh.vertices.emplace_back(p[0], p[1], p[2]);
  }
  vtkDataArray* normals = data->GetPointData()->GetNormals();
  if (normals != nullptr && normals->GetNumberOfComponents() == 3)
    for (vtkIdType i = 0; i < normals->GetNumberOfTuples(); ++i) {
      double n[3];
      normals->GetTuple(i, n);
      result.mesh.normals.emplace_back(n[0], n[1], n[2]);
    }
  vtkNew<vtkIdList> cell;
  std::vector<int> corners;
  vtkCellArray* polygons = data->GetPolys();
  for (polygons->InitTraversal(); polygons->GetNextCell(cell) != 0;) {
    corners.clear();
    for (vtkIdType k = 0; k < cell->GetNumberOfIds(); ++k)
      corners.push_back(static_cast<int>(cell->GetId(k)));
    add_polygon(result.mesh, corners);
  }
  auto* space = vtkStringArray::SafeDownCast(data->GetFieldData()->GetAbstractArray("SPACE"));
  result.says_lps = space != nullptr && space->GetNumberOfValues() > 0 && space->GetValue(0) == "LPS";
  return result;
}

std::string format_vtp(const TriangleMesh& mesh, bool says_lps) {
  vtkNew<vtkPoints> points;
  points->SetDataTypeToDouble();
  for (const Eigen::Vector3d& v : mesh.vertices) points->InsertNextPoint(v.data());
  vtkNew<vtkCellArray> polygons;
  for (const auto& t : mesh.triangles) {
    const vtkIdType corners[3] = {t[0], t[1], t[2]};
    polygons->InsertNextCell(3, corners);
  }
  vtkNew<vtkPolyData> data;
  data->SetPoints(points);
  data->SetPolys(polygons);
  if (!mesh.normals.empty()) {
    vtkNew<vtkDoubleArray> normals;
    normals->SetName("Normals");
    normals->SetNumberOfComponents(3);
    for (const Eigen::Vector3d& n : mesh.normals) normals->InsertNextTuple(n.data());
    data->GetPointData()->SetNormals(normals);
  }
  if (says_lps) {
    vtkNew<vtkStringArray> space;
    space->SetName("SPACE");
    space->InsertNextValue("LPS");
    data->GetFieldData()->AddArray(space);
  }
  vtkNew<vtkXMLPolyDataWriter> writer;
  writer->SetInputData(data);
  writer->WriteToOutputStringOn();
  writer->SetDataModeToAppended();
  if (writer->Write() != 1 || writer->GetErrorCode() != 0)
    throw output_error("the VTP mesh could not be written");
  return writer->GetOutputString();
}

}  // namespace emmetrope
