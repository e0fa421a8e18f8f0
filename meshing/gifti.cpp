#include "meshing/gifti.hpp"

#include <fmt/format.h>

#include <iterator>

#include "pipeline/base/files.hpp"

namespace emmetrope::meshing {
namespace {

using Eigen::Vector3d;
using Text = std::back_insert_iterator<std::string>;

void open_array(Text out, const char* intent, const char* type, std::size_t rows) {
  fmt::format_to(out,
                 "  <DataArray Intent=\"{}\" DataType=\"{}\" ArrayIndexingOrder=\"RowMajorOrder\" "
                 "Dimensionality=\"2\" Dim0=\"{}\" Dim1=\"3\" Encoding=\"ASCII\" Endian=\"LittleEndian\" "
                 "ExternalFileName=\"\" ExternalFileOffset=\"\">\n",
                 intent, type, rows);
}

void write_vectors(Text out, const char* intent, const std::vector<Vector3d>& lps) {
  open_array(out, intent, "NIFTI_TYPE_FLOAT32", lps.size());
  if (std::string_view(intent) == "NIFTI_INTENT_POINTSET") {
    fmt::format_to(out,
                   "    <CoordinateSystemTransformMatrix>\n"
                   "      <DataSpace><![CDATA[NIFTI_XFORM_SCANNER_ANAT]]></DataSpace>\n"
                   "      <TransformedSpace><![CDATA[NIFTI_XFORM_SCANNER_ANAT]]></TransformedSpace>\n"
                   "      <MatrixData>1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</MatrixData>\n"
                   "    </CoordinateSystemTransformMatrix>\n");
  }
  fmt::format_to(out, "    <Data>\n");
  for (const Vector3d& v : lps) fmt::format_to(out, "{:.9g} {:.9g} {:.9g}\n", -v.x(), -v.y(), v.z());
  fmt::format_to(out, "    </Data>\n  </DataArray>\n");
}

}  // namespace

void write_gifti(const std::filesystem::path& file, const TriangleMesh& mesh_in_lps) {
  std::string text;
  const Text out(text);
  const std::size_t arrays = mesh_in_lps.normals.empty() ? 2 : 3;
  fmt::format_to(out,
                 "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
                 "<!DOCTYPE GIFTI SYSTEM \"http://www.nitrc.org/frs/download.php/115/gifti.dtd\">\n"
                 "<GIFTI Version=\"1.0\" NumberOfDataArrays=\"{}\">\n",
                 arrays);
  write_vectors(out, "NIFTI_INTENT_POINTSET", mesh_in_lps.vertices);
  open_array(out, "NIFTI_INTENT_TRIANGLE", "NIFTI_TYPE_INT32", mesh_in_lps.triangles.size());
  fmt::format_to(out, "    <Data>\n");
  for (const auto& t : mesh_in_lps.triangles) fmt::format_to(out, "{} {} {}\n", t[0], t[1], t[2]);
  fmt::format_to(out, "    </Data>\n  </DataArray>\n");
  if (!mesh_in_lps.normals.empty()) write_vectors(out, "NIFTI_INTENT_VECTOR", mesh_in_lps.normals);
  fmt::format_to(out, "</GIFTI>\n");
  write_file(file, text);
}

}  // namespace emmetrope::meshing
