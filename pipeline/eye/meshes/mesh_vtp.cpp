#include <vtkCellArray.h>
#include <vtkDataArray.h>
#include <vtkDoubleArray.h>
#include <vtkFieldData.h>
#include <vtkIdList.h>
#include <vtkLogger.h>
#include <vtkNew.h>
#include <vtkObjectFactory.h>
#include <vtkOutputWindow.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkSmartPointer.h>
#include <vtkStringArray.h>
#include <vtkXMLPolyDataReader.h>
#include <vtkXMLPolyDataWriter.h>

#include "pipeline/base/error.hpp"
#include "pipeline/eye/meshes/mesh_formats.hpp"

namespace emmetrope {
namespace {

/// VTK reports faults by its output window and not by return values: caught here while the object lives.
class FaultWindow : public vtkOutputWindow {
 public:
  static FaultWindow* New();  // NOLINT(readability-identifier-naming): VTK's factory
  vtkTypeMacro(FaultWindow, vtkOutputWindow) void DisplayText(const char* text) override { fault_ = text; }
  const std::string& fault() const { return fault_; }

 private:
  std::string fault_;
};
vtkStandardNewMacro(FaultWindow)

    class FaultListener {
 public:
  FaultListener()
      : before_(vtkOutputWindow::GetInstance()), log_level_(vtkLogger::GetCurrentVerbosityCutoff()) {
    vtkOutputWindow::SetInstance(window_);
    vtkLogger::SetStderrVerbosity(vtkLogger::VERBOSITY_OFF);
  }
  ~FaultListener() {
    vtkOutputWindow::SetInstance(before_);
    vtkLogger::SetStderrVerbosity(log_level_);
  }
  FaultListener(const FaultListener&) = delete;
  FaultListener& operator=(const FaultListener&) = delete;
  bool heard_nothing() const { return window_->fault().empty(); }

 private:
  vtkNew<FaultWindow> window_;
  vtkSmartPointer<vtkOutputWindow> before_;
  vtkLogger::Verbosity log_level_;
};

}  // namespace

MeshFile parse_vtp(const std::string& bytes) {
  const FaultListener listener;
  vtkNew<vtkXMLPolyDataReader> reader;
  reader->ReadFromInputStringOn();
  reader->SetInputString(bytes);
  reader->Update();
  vtkPolyData* data = reader->GetOutput();
  if (!listener.heard_nothing() || reader->GetErrorCode() != 0 || data == nullptr ||
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
