#include <fmt/format.h>
#include <vtkCellArray.h>
#include <vtkDoubleArray.h>
#include <vtkFieldData.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkStringArray.h>
#include <vtkXMLPolyDataWriter.h>

#include "pipeline/base/error.hpp"
#include "pipeline/eye/meshes/mesh_formats.hpp"
#include "pipeline/eye/meshes/vtk_xml.hpp"

namespace emmetrope {
namespace {

pugi::xml_node named(pugi::xml_node parent, const char* name) {
  for (const pugi::xml_node array : parent.children())
    if (array.attribute("Name").value() == std::string(name)) return array;
  return {};
}

std::vector<Eigen::Vector3d> vectors(const VtkXml& file, pugi::xml_node array) {
  const std::vector<double> numbers = file.numbers(array);
  if (array && (array.attribute("NumberOfComponents").as_int() != 3 || numbers.size() % 3 != 0))
    throw input_error("points and normals of a VTP mesh have three coordinates");
  std::vector<Eigen::Vector3d> result;
  for (std::size_t k = 0; k < numbers.size(); k += 3)
    result.emplace_back(numbers[k], numbers[k + 1], numbers[k + 2]);
  return result;
}

void expect_count(std::size_t found, pugi::xml_node piece, const char* promise) {
  if (const auto promised = piece.attribute(promise).as_ullong(); found != promised)
    throw input_error(fmt::format("the VTP mesh has {} where it says {}=\"{}\"", found, promise, promised));
}

void add_polygons(const VtkXml& file, pugi::xml_node piece, TriangleMesh& mesh, std::size_t first_vertex) {
  const pugi::xml_node polygons = piece.child("Polys");
  const std::vector<int> connectivity = file.indices(named(polygons, "connectivity")),
                         ends = file.indices(named(polygons, "offsets"));
  expect_count(ends.size(), piece, "NumberOfPolys");
  std::size_t at = 0;
  std::vector<int> corners;
  for (const int end : ends) {
    if (static_cast<std::size_t>(end) < at || static_cast<std::size_t>(end) > connectivity.size())
      throw input_error("offsets of the VTP mesh's polygons are out of order");
    corners.clear();
    for (; at < static_cast<std::size_t>(end); ++at) {
      if (static_cast<std::size_t>(connectivity[at]) >= mesh.vertices.size() - first_vertex)
        throw input_error(fmt::format("a polygon of the VTP mesh names point {} of {}", connectivity[at],
                                      mesh.vertices.size() - first_vertex));
      corners.push_back(static_cast<int>(first_vertex) + connectivity[at]);
    }
    add_polygon(mesh, corners);
  }
}

}  // namespace

MeshFile parse_vtp(const std::string& bytes) {
  const VtkXml file(bytes, "PolyData");
  MeshFile result;
  for (const pugi::xml_node piece : file.data_set().children("Piece")) {
    const std::size_t first_vertex = result.mesh.vertices.size();
    const auto points = vectors(file, piece.child("Points").first_child());
    expect_count(points.size(), piece, "NumberOfPoints");
    result.mesh.vertices.insert(result.mesh.vertices.end(), points.begin(), points.end());
    const pugi::xml_node data = piece.child("PointData");
    if (const pugi::xml_attribute name = data.attribute("Normals")) {
      const auto normals = vectors(file, named(data, name.value()));
      result.mesh.normals.insert(result.mesh.normals.end(), normals.begin(), normals.end());
    }
    add_polygons(file, piece, result.mesh, first_vertex);
  }
  if (result.mesh.vertices.empty()) throw input_error("the VTP mesh has no points");
  const std::vector<double> space = file.numbers(named(file.data_set().child("FieldData"), "SPACE"));
  result.says_lps = space == std::vector<double>{'L', 'P', 'S', '\0'};
  result.says_ras = space == std::vector<double>{'R', 'A', 'S', '\0'};
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
