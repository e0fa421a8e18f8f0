#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>

#include <cstring>

#include "pipeline/report/dicom/object.hpp"
#include "pipeline/report/dicom/objects.hpp"

namespace emmetrope::report {
namespace {

void put_document(DcmDataset& dataset, const std::string& bytes, const char* mime_type) {
  put(dataset, 0x0042, 0x0012, mime_type);
  std::string even = bytes;
  if (even.size() % 2 != 0) even.push_back('\0');
  check(dataset.putAndInsertUint8Array(DCM_EncapsulatedDocument, reinterpret_cast<const Uint8*>(even.data()),
                                       static_cast<unsigned long>(even.size())),
        "document");
  check(dataset.putAndInsertUint32(DCM_EncapsulatedDocumentLength, static_cast<Uint32>(bytes.size())),
        "document length");
}

/// Binary STL, LPS as its header says.
std::string stl_of(const TriangleMesh& mesh) {
  std::string stl(80, ' ');
  std::memcpy(stl.data(), "SPACE=LPS mm", 12);
  const auto append = [&](const auto& value) {
    std::array<char, sizeof value> bytes{};
    std::memcpy(bytes.data(), &value, sizeof value);
    stl.append(bytes.data(), bytes.size());
  };
  append(static_cast<std::uint32_t>(mesh.triangles.size()));
  for (const auto& triangle : mesh.triangles) {
    const Eigen::Vector3d &a = mesh.vertices[triangle[0]], &b = mesh.vertices[triangle[1]],
                          &c = mesh.vertices[triangle[2]];
    const Eigen::Vector3d normal = (b - a).cross(c - a).normalized();
    for (const auto& point : {normal, a, b, c})
      for (int axis = 0; axis < 3; ++axis) append(static_cast<float>(point[axis]));
    append(std::uint16_t{0});
  }
  return stl;
}

}  // namespace

std::string pdf_object(const SourceStudy& source, const std::string& pdf, bool identified,
                       const std::string& result) {
  DcmDataset dataset;
  ObjectName name;
  name.role = "report";
  name.modality = "DOC";
  name.description = "Emmetrope eye report";
  name.series_number = 9001;
  name.result = result;
  put_common(dataset, source, name);
  put(dataset, 0x0008, 0x0016, UID_EncapsulatedPDFStorage);
  put(dataset, 0x0008, 0x0064, "WSD");
  dataset.insertEmptyElement(DCM_AcquisitionDateTime);
  put(dataset, 0x0028, 0x0301, identified ? "YES" : "NO");
  put(dataset, 0x0042, 0x0010, "Emmetrope eye report, RESEARCH USE ONLY");
  dataset.insertEmptyElement(DCM_ConceptNameCodeSequence);
  put_references(dataset, 0x0042, 0x0013, source);
  put_document(dataset, pdf, "application/pdf");
  return file_bytes(dataset);
}

std::string mesh_object(const SourceStudy& source, const TriangleMesh& mesh_lps, Laterality eye,
                        const std::string& surface, int number, const std::string& result) {
  DcmDataset dataset;
  const std::string title = std::string(eye == Laterality::od ? "OD " : "OS ") + surface;
  put_common(dataset, source,
             {"meshes", "M3D", "Emmetrope surfaces, RESEARCH USE ONLY", 9005, result + title});
  put(dataset, 0x0008, 0x0016, UID_EncapsulatedSTLStorage);
  put(dataset, 0x0020, 0x0013, std::to_string(number));
  const bool has_frame = !source.images().empty() && !source.images().front().frame_of_reference_uid.empty();
  put(dataset, 0x0020, 0x0052,
      has_frame ? source.images().front().frame_of_reference_uid : stable_uid("frame " + source.study_uid()));
  dataset.insertEmptyElement(DCM_PositionReferenceIndicator);
  dataset.insertEmptyElement(DCM_AcquisitionDateTime);
  put(dataset, 0x0028, 0x0301, "NO");
  put(dataset, 0x0020, 0x0062, eye == Laterality::od ? "R" : "L");
  put(dataset, 0x0042, 0x0010, dicom_text(title, 64));
  dataset.insertEmptyElement(DCM_ConceptNameCodeSequence);
  put_references(dataset, 0x0042, 0x0013, source);
  put_code(dataset, 0x0040, 0x08ea, "mm", "UCUM", "mm");
  put_referenced_series(dataset, source, "");
  put_document(dataset, stl_of(mesh_lps), "model/stl");
  return file_bytes(dataset);
}

std::string picture_object(const SourceStudy& source, const std::string& rgb, int rows, int columns,
                           Laterality eye, const std::string& title, int number, const std::string& result) {
  DcmDataset dataset;
  put_common(dataset, source,
             {"pictures", "OT", "Emmetrope retinal images, RESEARCH USE ONLY", 9004, result + title});
  put(dataset, 0x0008, 0x0016, UID_SecondaryCaptureImageStorage);
  put(dataset, 0x0020, 0x0013, std::to_string(number));
  put(dataset, 0x0008, 0x0008, "DERIVED\\SECONDARY");
  put(dataset, 0x0008, 0x0064, "SYN");
  put(dataset, 0x0008, 0x2111, dicom_text(title, 1000));
  put(dataset, 0x0020, 0x0062, eye == Laterality::od ? "R" : "L");
  dataset.insertEmptyElement(DCM_PatientOrientation);
  put(dataset, 0x0028, 0x0301, "NO");
  put_references(dataset, 0x0008, 0x2112, source);
  const auto number_of = [&](const DcmTagKey& tag, int value) {
    check(dataset.putAndInsertUint16(tag, static_cast<Uint16>(value)), "pixel description");
  };
  number_of(DCM_SamplesPerPixel, 3);
  put(dataset, 0x0028, 0x0004, "RGB");
  number_of(DCM_PlanarConfiguration, 0);
  number_of(DCM_Rows, rows);
  number_of(DCM_Columns, columns);
  number_of(DCM_BitsAllocated, 8);
  number_of(DCM_BitsStored, 8);
  number_of(DCM_HighBit, 7);
  number_of(DCM_PixelRepresentation, 0);
  std::string pixels = rgb;
  if (pixels.size() % 2 != 0) pixels.push_back('\0');
  check(dataset.putAndInsertUint8Array(DCM_PixelData, reinterpret_cast<const Uint8*>(pixels.data()),
                                       static_cast<unsigned long>(pixels.size())),
        "pixels");
  return file_bytes(dataset);
}

}  // namespace emmetrope::report
