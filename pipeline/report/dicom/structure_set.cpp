// RT Structure Set (PS3.3 A.19.3): outlines of the lens and of the eye within its wall on the images they were measured in.
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>
#include <fmt/format.h>

#include <algorithm>

#include "pipeline/report/dicom/object.hpp"
#include "pipeline/report/dicom/objects.hpp"
#include "pipeline/report/dicom/plane_cut.hpp"

namespace emmetrope::report {
namespace {

/// A body, by the sheets of its surface.
struct Body {
  const char* name;         ///< without the side; TG-263's where it has one
  const char* description;  ///< what its outline is
  std::vector<const char*> surfaces;
  const char *code, *scheme, *meaning;
  const char* interpreted_type;
  const char* colour;
};
const std::vector<Body>& bodies() {
  static const std::vector<Body> list{
      // TG-263's Eye is the whole globe, of which no surface says where the wall ends.
      {"Eye_inner",
       "Without retina, choroid and sclera: vitreo-retinal interface and anterior cornea, straight between their rims",
       {"retina", "cornea_anterior"},
       "EYE_INNER",
       own_scheme,
       "Eyeball within its wall",
       "CAVITY",
       "80\\160\\255"},
      {"Lens",
       "Anterior and posterior surface of the lens",
       {"lens_anterior", "lens_posterior"},
       "78076003",
       "SCT",
       "Lens of eye",
       "ORGAN",
       "255\\200\\60"}};
  return list;
}

/// Outlines on the images, with the image that each lies on.
struct Region {
  const Body* body = nullptr;
  Laterality eye = Laterality::od;
  std::vector<std::pair<const SourceImage*, Polyline>> outlines;
};

/// \param head_shift_mm  from the images to where the surfaces are
Region region_of(const Body& body, const EyeData& eye, const std::vector<const SourceImage*>& images,
                 const Eigen::Vector3d& head_shift_mm) {
  Region region{&body, eye.laterality, {}};
  std::vector<TriangleMesh> sheets;
  for (const char* surface : body.surfaces) {
    if (!std::filesystem::exists(eye.mesh(surface))) return region;
    sheets.push_back(read_mesh(eye.mesh(surface)).mesh);
    for (Eigen::Vector3d& vertex : sheets.back().vertices) vertex -= head_shift_mm;
  }
  if (sheets.size() == 2) sheets.push_back(between_rims(sheets[0], sheets[1]));
  for (const SourceImage* image : images) {
    std::vector<Polyline> pieces;
    for (const TriangleMesh& sheet : sheets)
      for (Polyline& piece : cut_by_plane(sheet, image->position_lps, image->normal))
        pieces.push_back(std::move(piece));
    if (Polyline outline = joined_outline(std::move(pieces)); !outline.empty())
      region.outlines.emplace_back(image, std::move(outline));
  }
  return region;
}

DcmItem& add_item(DcmItem& parent, const DcmTagKey& sequence) {
  DcmItem* item = nullptr;
  check(parent.findOrCreateSequenceItem(sequence, item, -2), DcmTag(sequence).getTagName());
  return *item;
}

void put_text(DcmItem& item, const DcmTagKey& tag, const std::string& value) {
  put(item, tag.getGroup(), tag.getElement(), value);
}

void put_image(DcmItem& parent, const SourceImage& image) {
  DcmItem& reference = add_item(parent, DCM_ContourImageSequence);
  put_text(reference, DCM_ReferencedSOPClassUID, image.sop_class_uid);
  put_text(reference, DCM_ReferencedSOPInstanceUID, image.sop_instance_uid);
}

void put_frame(DcmItem& dataset, const SourceStudy& source, const std::vector<const SourceImage*>& images) {
  DcmItem& frame = add_item(dataset, DCM_ReferencedFrameOfReferenceSequence);
  put_text(frame, DCM_FrameOfReferenceUID, images.front()->frame_of_reference_uid);
  DcmItem& study = add_item(frame, DCM_RTReferencedStudySequence);
  put_text(study, DCM_ReferencedSOPClassUID,
           "1.2.840.10008.3.1.2.3.1");  // Detached Study Management, as A.19.3 has it
  put_text(study, DCM_ReferencedSOPInstanceUID, source.study_uid());
  DcmItem& series = add_item(study, DCM_RTReferencedSeriesSequence);
  put_text(series, DCM_SeriesInstanceUID, images.front()->series_uid);
  for (const SourceImage* image : images) put_image(series, *image);
}

std::string coordinates_of(const Polyline& outline) {
  std::string text;
  for (const Eigen::Vector3d& point : outline)
    text +=
        fmt::format("{}{:.3f}\\{:.3f}\\{:.3f}", text.empty() ? "" : "\\", point.x(), point.y(), point.z());
  return text;
}

void put_region(DcmItem& dataset, const Region& region, const std::string& frame_uid, int number) {
  const char* side = region.eye == Laterality::od ? "R" : "L";
  const std::string name = fmt::format("{}_{}", region.body->name, side);
  DcmItem& roi = add_item(dataset, DCM_StructureSetROISequence);
  put_text(roi, DCM_ROINumber, std::to_string(number));
  put_text(roi, DCM_ReferencedFrameOfReferenceUID, frame_uid);
  put_text(roi, DCM_ROIName, name);
  put_text(roi, DCM_ROIDescription, region.body->description);
  put_text(roi, DCM_ROIGenerationAlgorithm, "AUTOMATIC");
  DcmItem& contours = add_item(dataset, DCM_ROIContourSequence);
  put_text(contours, DCM_ROIDisplayColor, region.body->colour);
  put_text(contours, DCM_ReferencedROINumber, std::to_string(number));
  for (const auto& [image, outline] : region.outlines) {
    DcmItem& contour = add_item(contours, DCM_ContourSequence);
    put_image(contour, *image);
    put_text(contour, DCM_ContourGeometricType, "CLOSED_PLANAR");
    put_text(contour, DCM_NumberOfContourPoints, std::to_string(outline.size()));
    put_text(contour, DCM_ContourData, coordinates_of(outline));
  }
  DcmItem& observation = add_item(dataset, DCM_RTROIObservationsSequence);
  put_text(observation, DCM_ObservationNumber, std::to_string(number));
  put_text(observation, DCM_ReferencedROINumber, std::to_string(number));
  put_code(observation, DCM_RTROIIdentificationCodeSequence.getGroup(),
           DCM_RTROIIdentificationCodeSequence.getElement(), region.body->code, region.body->scheme,
           region.body->meaning);
  put_text(observation, DCM_RTROIInterpretedType, region.body->interpreted_type);
  observation.insertEmptyElement(DCM_ROIInterpreter);
}

}  // namespace

std::string structure_set_object(const SourceStudy& source, const CaseData& data,
                                 const std::string& series_uid, const std::string& stack, int number,
                                 const std::string& result) {
  std::vector<const SourceImage*> images;
  for (const SourceImage& image : source.images())
    if (image.series_uid == series_uid) images.push_back(&image);
  if (images.empty() || images.front()->frame_of_reference_uid.empty()) return {};
  std::vector<Region> regions;
  for (const EyeData& eye : data.eyes)
    if (is_fitted_to(eye, stack))
      for (const Body& body : bodies())
        if (Region region = region_of(body, eye, images, head_shift(eye, stack)); !region.outlines.empty())
          regions.push_back(std::move(region));
  if (regions.empty()) return {};
  DcmDataset dataset;
  put_common(dataset, source, {"structures", "RTSTRUCT", "Eye outlines, RESEARCH USE ONLY", 9007, result});
  put_text(dataset, DCM_InstanceNumber, std::to_string(number));
  put(dataset, 0x0008, 0x0016, UID_RTStructureSetStorage);
  put_text(dataset, DCM_FrameOfReferenceUID, images.front()->frame_of_reference_uid);
  dataset.insertEmptyElement(DCM_PositionReferenceIndicator);
  dataset.insertEmptyElement(DCM_OperatorsName);
  put_text(dataset, DCM_StructureSetLabel, "Emmetrope");
  put_text(dataset, DCM_StructureSetName, "Eye outlines, RESEARCH USE ONLY");
  put_text(dataset, DCM_StructureSetDate, source.date());
  put_text(dataset, DCM_StructureSetTime, source.time());
  put_frame(dataset, source, images);
  int region_number = 0;
  for (const Region& region : regions)
    put_region(dataset, region, images.front()->frame_of_reference_uid, ++region_number);
  put_text(dataset, DCM_ApprovalStatus, "UNAPPROVED");
  return file_bytes(dataset);
}

}  // namespace emmetrope::report
