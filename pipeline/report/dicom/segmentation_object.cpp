#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmfg/fgderimg.h>
#include <dcmtk/dcmfg/fgfracon.h>
#include <dcmtk/dcmfg/fgpixmsr.h>
#include <dcmtk/dcmfg/fgplanor.h>
#include <dcmtk/dcmfg/fgplanpo.h>
#include <dcmtk/dcmfg/fgseg.h>
#include <dcmtk/dcmseg/segdoc.h>
#include <dcmtk/dcmseg/segment.h>

#include <fmt/format.h>

#include "pipeline/base/error.hpp"
#include "pipeline/base/version.hpp"
#include "pipeline/report/dicom/object.hpp"
#include "pipeline/report/dicom/objects.hpp"
#include "pipeline/report/figures/slices.hpp"

namespace emmetrope::report {
namespace {

struct StructureCode {
  const char *word, *code, *meaning;
};
/// SNOMED CT codes of what a label's name may contain; the first that matches.
constexpr std::array<StructureCode, 12> structures{
    {{"cornea", "28726007", "Cornea"},
     {"lens", "78076003", "Lens of eye"},
     {"iris", "41296002", "Iris"},
     {"aqueous", "31636006", "Anterior chamber of eye"},
     {"anterior chamber", "31636006", "Anterior chamber of eye"},
     {"vitreous", "372242005", "Vitreous body"},
     {"sclera", "18619003", "Sclera"},
     {"wall", "18619003", "Sclera"},
     {"retina", "5665001", "Retina"},
     {"nerve", "18234004", "Optic nerve"},
     {"globe", "79652003", "Eyeball"},
     {"eye", "79652003", "Eyeball"}}};

const StructureCode& code_of(const std::string& name) {
  for (const auto& structure : structures)
    if (name.find(structure.word) != std::string::npos) return structure;
  return structures.back();
}

struct Label {
  int value = 0;
  std::string name;  ///< "right cornea"
  bool is_right() const { return name.rfind("right", 0) == 0; }
  bool is_left() const { return name.rfind("left", 0) == 0; }
};

/// Those of {"labels": [{"value", "name"}]} that are of these eyes, or of no side.
std::vector<Label> labels_of(const Json& json, const std::vector<EyeData>& eyes) {
  const auto has = [&](Laterality side) {
    return std::any_of(eyes.begin(), eyes.end(), [&](const EyeData& eye) { return eye.laterality == side; });
  };
  std::vector<Label> labels;
  for (const Json& entry : json.at("labels")) {
    const Label label{entry.at("value").get<int>(), entry.at("name").get<std::string>()};
    if ((label.is_right() && !has(Laterality::od)) || (label.is_left() && !has(Laterality::os))) continue;
    labels.push_back(label);
  }
  std::sort(labels.begin(), labels.end(), [](const Label& a, const Label& b) { return a.value < b.value; });
  return labels;
}

std::string decimal(double value) { return fmt::format("{:.6g}", std::abs(value) < 1e-9 ? 0.0 : value); }

/// A plane of voxels in the patient.
struct PlaneGrid {
  Eigen::Vector3d row, column, normal;  ///< unit directions in which columns, rows and slices grow
  double column_spacing_mm = 0, row_spacing_mm = 0, slice_spacing_mm = 0;
};

PlaneGrid grid_of(const Eigen::Matrix4d& lps_from_voxel) {
  const Eigen::Vector3d i = lps_from_voxel.block<3, 1>(0, 0), j = lps_from_voxel.block<3, 1>(0, 1),
                        k = lps_from_voxel.block<3, 1>(0, 2);
  PlaneGrid grid;
  grid.row = i.normalized();
  grid.column = j.normalized();
  grid.normal = k.normalized();
  grid.column_spacing_mm = i.norm();
  grid.row_spacing_mm = j.norm();
  grid.slice_spacing_mm = k.norm();
  return grid;
}

std::unique_ptr<DcmSegment> segment_of(const Label& label) {
  const StructureCode& structure = code_of(label.name);
  DcmSegment* made = nullptr;
  check(DcmSegment::create(made, dicom_text(label.name, 60).c_str(),
                           CodeSequenceMacro("123037004", "SCT", "Anatomical Structure"),
                           CodeSequenceMacro(structure.code, "SCT", structure.meaning),
                           DcmSegTypes::SAT_AUTOMATIC, "Emmetrope parametric eye fit"),
        "segment " + label.name);
  std::unique_ptr<DcmSegment> segment(made);
  auto& modifiers = segment->getSegmentedPropertyTypeModifierCode();
  if (label.is_right()) modifiers.push_back(new CodeSequenceMacro("24028007", "SCT", "Right"));
  if (label.is_left()) modifiers.push_back(new CodeSequenceMacro("7771000", "SCT", "Left"));
  return segment;
}

void add_frame(DcmSegmentation& object, const SourceStudy& source, const std::string& series_uid,
               const PlaneGrid& grid, const Eigen::Vector3d& position, Uint16 segment, Uint32 plane,
               std::vector<Uint8>& mask) {
  FGPlanePosPatient place;
  check(place.setImagePositionPatient(decimal(position.x()).c_str(), decimal(position.y()).c_str(),
                                      decimal(position.z()).c_str()),
        "plane position");
  FGFrameContent content;
  check(content.setDimensionIndexValues(segment, 0), "dimension");
  check(content.setDimensionIndexValues(plane, 1), "dimension");
  FGSegmentation reference;
  check(reference.setReferencedSegmentNumber(segment), "segment number");
  FGDerivationImage derivation;
  DerivationImageItem* item = nullptr;
  for (const auto& image : source.images()) {
    const bool is_of_stack = series_uid.empty() || image.series_uid == series_uid;
    const bool lies_here =
        is_of_stack &&
        std::abs((image.position_lps - position).dot(grid.normal)) < grid.slice_spacing_mm / 2 &&
        std::abs(std::abs(image.normal.dot(grid.normal)) - 1) < 1e-3;
    if (!lies_here) continue;
    if (item == nullptr)
      check(derivation.addDerivationImageItem(CodeSequenceMacro("113076", "DCM", "Segmentation"), "", item),
            "derivation");
    auto* made = new SourceImageItem();
    check(made->getImageSOPInstanceReference().setReferencedSOPClassUID(image.sop_class_uid.c_str()),
          "source image");
    check(made->getImageSOPInstanceReference().setReferencedSOPInstanceUID(image.sop_instance_uid.c_str()),
          "source image");
    check(
        made->getPurposeOfReferenceCode().set("121322", "DCM", "Source image for image processing operation"),
        "source image");
    item->getSourceImageItems().push_back(made);
  }
  OFVector<FGBase*> groups;
  groups.push_back(&place);
  groups.push_back(&content);
  groups.push_back(&reference);
  if (item != nullptr) groups.push_back(&derivation);
  check(object.addFrame(mask.data(), segment, groups), "frame");
}

void share_geometry(DcmSegmentation& object, const PlaneGrid& grid) {
  FGPlaneOrientationPatient orientation;
  check(orientation.setImageOrientationPatient(
            decimal(grid.row.x()).c_str(), decimal(grid.row.y()).c_str(), decimal(grid.row.z()).c_str(),
            decimal(grid.column.x()).c_str(), decimal(grid.column.y()).c_str(),
            decimal(grid.column.z()).c_str()),
        "orientation");
  FGPixelMeasures measures;
  check(measures.setPixelSpacing(
            (decimal(grid.row_spacing_mm) + "\\" + decimal(grid.column_spacing_mm)).c_str()),
        "spacing");
  check(measures.setSpacingBetweenSlices(decimal(grid.slice_spacing_mm).c_str()), "spacing");
  check(measures.setSliceThickness(decimal(grid.slice_spacing_mm).c_str()), "spacing");
  check(object.addForAllFrames(orientation), "orientation");
  check(object.addForAllFrames(measures), "spacing");
}

std::unique_ptr<DcmSegmentation> empty_object(const Eigen::Vector3i& size, int number) {
  DcmSegmentation* made = nullptr;
  check(DcmSegmentation::createBinarySegmentation(
            made, static_cast<Uint16>(size.y()), static_cast<Uint16>(size.x()),
            IODGeneralEquipmentModule::EquipmentInfo(manufacturer, model, serial_number,
                                                     dicom_text(version(), 60).c_str()),
            ContentIdentificationMacro(std::to_string(number).c_str(), "EYES",
                                       "Structures of the eyes, RESEARCH USE ONLY", "")),
        "segmentation");
  return std::unique_ptr<DcmSegmentation>(made);
}

void add_dimensions(DcmSegmentation& object, const std::string& organization) {
  check(object.getDimensions().addDimensionIndex(DCM_ReferencedSegmentNumber, organization.c_str(),
                                                 DCM_SegmentIdentificationSequence, "Segment"),
        "dimension");
  check(object.getDimensions().addDimensionIndex(DCM_ImagePositionPatient, organization.c_str(),
                                                 DCM_PlanePositionSequence, "Plane"),
        "dimension");
}

/// One slice's voxels of a label as ones; true if there are any.
bool fill_mask(std::vector<Uint8>& mask, const Volume& volume, int slice, int label) {
  const Eigen::Vector3i size = volume.size();
  for (int j = 0; j < size.y(); ++j)
    for (int i = 0; i < size.x(); ++i)
      mask[static_cast<std::size_t>(j) * size.x() + i] = std::lround(volume.at(i, j, slice)) == label;
  return std::any_of(mask.begin(), mask.end(), [](Uint8 voxel) { return voxel != 0; });
}

}  // namespace

std::string segmentation_object(const SourceStudy& source, const std::filesystem::path& label_nifti,
                                const Json& labels_json, const std::vector<EyeData>& eyes,
                                const std::string& series_uid, int number, const std::string& result) {
  const Volume volume(label_nifti);
  const Eigen::Vector3i size = volume.size();
  const PlaneGrid grid = grid_of(volume.lps_from_voxel());
  const std::unique_ptr<DcmSegmentation> object = empty_object(size, number);
  share_geometry(*object, grid);
  add_dimensions(*object, stable_uid("dimensions " + source.study_uid()));
  bool any = false;
  std::vector<Uint8> mask(static_cast<std::size_t>(size.x()) * static_cast<std::size_t>(size.y()));
  for (const auto& label : labels_of(labels_json, eyes)) {
    Uint16 segment = 0;
    for (int k = 0; k < size.z(); ++k) {
      if (!fill_mask(mask, volume, k, label.value)) continue;
      if (segment == 0) check(object->addSegment(segment_of(label).release(), segment), "segment");
      const Eigen::Vector3d position = (volume.lps_from_voxel() * Eigen::Vector4d(0, 0, k, 1)).head<3>();
      add_frame(*object, source, series_uid, grid, position, segment, static_cast<Uint32>(k + 1), mask);
      any = true;
    }
  }
  if (!any) return {};
  DcmDataset header;
  ObjectName name;
  name.role = "segmentation";
  name.modality = "SEG";
  name.description = "Eye structures, RESEARCH USE ONLY";
  name.series_number = 9006;
  name.result = result;
  put_common(header, source, name);
  const bool has_frame = !source.images().empty() && !source.images().front().frame_of_reference_uid.empty();
  put(header, 0x0020, 0x0052,
      has_frame ? source.images().front().frame_of_reference_uid : stable_uid("frame " + source.study_uid()));
  header.insertEmptyElement(DCM_PositionReferenceIndicator);
  check(object->importFromSourceImage(header), "patient and study");
  check(object->getSeries().setSeriesNumber("9006"), "series");
  DcmDataset dataset;
  check(object->writeDataset(dataset), "segmentation");
  put_common(dataset, source,
             {"segmentation", "SEG", "Eye structures, RESEARCH USE ONLY", 9006,
              result + label_nifti.filename().string()});
  put(dataset, 0x0020, 0x0013, std::to_string(number));
  put_referenced_series(dataset, source, series_uid);
  return file_bytes(dataset);
}

}  // namespace emmetrope::report
