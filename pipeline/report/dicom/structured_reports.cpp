#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmsr/cmr/tid1500.h>
#include <dcmtk/dcmsr/dsrdoc.h>
#include <fmt/format.h>

#include <algorithm>

#include "pipeline/base/files.hpp"
#include "pipeline/base/version.hpp"
#include "pipeline/report/content/biometry_rows.hpp"
#include "pipeline/report/content/content.hpp"
#include "pipeline/report/content/first_page.hpp"
#include "pipeline/report/content/judgement.hpp"
#include "pipeline/report/dicom/object.hpp"
#include "pipeline/report/dicom/objects.hpp"

namespace emmetrope::report {
namespace {

constexpr std::size_t most_characters_of_text = 10000;
constexpr const char* biometry_notice =
    "Research use only. Not a medical device. Uncertainties are the distances of the 95 % limits from the "
    "value. A measurement whose method is a prior is the population's value, not this patient's.";

/// A decimal string of at most 16 characters.
std::string decimal_string(double value) {
  std::string text = fixed(value, 4);
  return text.size() > 16 ? text.substr(0, 16) : text;
}

DSRCodedEntryValue unit_code(const std::string& unit) {
  if (unit == "D") return {"[diop]", "UCUM", "diopter"};
  if (unit == "deg" || unit == "axis") return {"deg", "UCUM", "degree"};
  if (unit == "mm") return {"mm", "UCUM", "mm"};
  if (unit == "\u00b5m") return {"um", "UCUM", "um"};
  if (unit == "mm\u00b2") return {"mm2", "UCUM", "mm2"};
  if (unit == "mm\u00b3") return {"mm3", "UCUM", "mm3"};
  return {"1", "UCUM", "no units"};
}

/// Writes the document into a dataset and replaces what DCMTK takes from the clock and from chance.
std::string document_bytes(DSRDocument& document, const SourceStudy& source, const ObjectName& name) {
  for (const auto& image : source.images())
    check(document.getCurrentRequestedProcedureEvidence().addItem(
              source.study_uid().c_str(), image.series_uid.c_str(), image.sop_class_uid.c_str(),
              image.sop_instance_uid.c_str()),
          "source images");
  DcmDataset dataset;
  check(document.write(dataset), "structured report");
  put_common(dataset, source, name);
  return file_bytes(dataset);
}

/// Builds a content tree by depth.
class Tree {
 public:
  explicit Tree(DSRDocumentTree& tree) : tree_(tree) {}

  /// \param template_id  of DCMR
  void root(const DSRCodedEntryValue& concept_name, const char* template_id) {
    add(DSRTypes::RT_isRoot, DSRTypes::VT_Container, DSRTypes::AM_afterCurrent, concept_name);
    check(tree_.getCurrentContentItem().setTemplateIdentification(template_id, "DCMR"), "template");
  }
  /// Goes into the new container; `up` leaves it.
  void container(const DSRCodedEntryValue& concept_name) {
    add(DSRTypes::RT_contains, DSRTypes::VT_Container, DSRTypes::AM_belowCurrent, concept_name);
  }
  void up() { tree_.goUp(); }
  void text(const DSRCodedEntryValue& concept_name, const std::string& value) {
    add(DSRTypes::RT_contains, DSRTypes::VT_Text, DSRTypes::AM_belowCurrent, concept_name);
    check(tree_.getCurrentContentItem().setStringValue(value.c_str()), "text item");
    tree_.goUp();
  }
  void number(const DSRCodedEntryValue& concept_name, double value, const std::string& unit) {
    add(DSRTypes::RT_contains, DSRTypes::VT_Num, DSRTypes::AM_belowCurrent, concept_name);
    check(tree_.getCurrentContentItem().setNumericValue(
              DSRNumericMeasurementValue(decimal_string(value).c_str(), unit_code(unit))),
          "number");
    tree_.goUp();
  }

 private:
  void add(DSRTypes::E_RelationshipType relationship, DSRTypes::E_ValueType type, DSRTypes::E_AddMode mode,
           const DSRCodedEntryValue& concept_name) {
    if (tree_.addContentItem(relationship, type, mode) == 0) check(SR_EC_InvalidDocumentTree, "content tree");
    check(tree_.getCurrentContentItem().setConceptName(concept_name), "concept name");
  }
  DSRDocumentTree& tree_;
};

/// How a number came about, as TID 300's measurement method.
DSRCodedEntryValue method_code(const Measured& measured) {
  const std::string source = measured.source + (measured.method == "edges" ? " edges" : "");
  if (source == "mri") return {"113091000", "SCT", "Magnetic resonance imaging"};
  std::string code;
  for (const char c : source)
    if (std::isalnum(static_cast<unsigned char>(c)) != 0)
      code += static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return {code.substr(0, 16).c_str(), own_scheme,
          (source_name(measured.source) + (measured.method == "edges" ? ", edges" : "")).c_str()};
}

/// A number of the report.
struct ReportedNumber {
  std::optional<Measured> interval;  ///< where it has one
  std::string unit;
};

/// TID 310 below each measurement that has an interval: how far its 95 % limits lie from the value (CID 225).
/// DCMTK's template knows no such rows.
/// \param numbers  one for each measurement of the tree, in its order
void add_uncertainties(DSRDocumentTree& tree, const std::vector<ReportedNumber>& numbers) {
  std::vector<std::size_t> nodes;
  if (tree.gotoRoot() != 0) do {
      if (tree.getCurrentContentItem().getValueType() == DSRTypes::VT_Num) nodes.push_back(tree.getNodeID());
    } while (tree.iterate() != 0);
  if (nodes.size() != numbers.size()) check(SR_EC_InvalidDocumentTree, "measurement intervals");
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const std::optional<Measured>& interval = numbers[i].interval;
    if (!interval) continue;
    const auto add = [&](const DSRCodedEntryValue& concept_name, double range) {
      if (tree.gotoNode(nodes[i]) == 0 ||
          tree.addContentItem(DSRTypes::RT_hasProperties, DSRTypes::VT_Num, DSRTypes::AM_belowCurrent) == 0)
        check(SR_EC_InvalidDocumentTree, "measurement interval");
      check(tree.getCurrentContentItem().setConceptName(concept_name), "measurement interval");
      check(tree.getCurrentContentItem().setNumericValue(
                DSRNumericMeasurementValue(decimal_string(range).c_str(), unit_code(numbers[i].unit))),
            "measurement interval");
    };
    add({"371886008", "SCT", "+, range of upper measurement uncertainty"},
        interval->ci95[1] - interval->value);
    add({"371885007", "SCT", "-, range of lower measurement uncertainty"},
        interval->value - interval->ci95[0]);
  }
}

std::string interval_sentence(const std::string& name, const Json& value, const NumberStyle& style) {
  if (!value.is_object()) return {};
  const auto measured = value.get<Measured>();
  const std::string unit = style.unit == "deg" || style.unit == "axis"
                               ? ""
                               : " " + style.unit;  // an angle's interval has its sign
  return name + ": 95 % interval " + format_interval(measured, style) + unit + ", " +
         source_name(measured.source);
}

/// What coded powers do not say, the doubts first.
std::string prescription_comment(const CaseData& data, const EyeData& eye, const Judgement& judgement) {
  const NumberStyle dioptres{2, true, "D"};
  std::string text = doubts_of(eye, judgement);
  text += fmt::format("{}{}: vertex distance {:g} mm, {}. {}", text.empty() ? "" : " ",
                      clinical_name(eye.laterality),
                      value_of(eye.prescription, "vertex_distance_mm").value_or(12), refracted_point(data),
                      conditions_of(eye.prescription));
  for (const auto& [key, name, style] :
       {std::tuple{"sphere_D", "Sphere", dioptres}, std::tuple{"cylinder_D", "Cylinder", dioptres},
        std::tuple{"axis_deg", "Axis", NumberStyle{0, false, "axis"}}}) {
    const bool is_undetermined =
        key == std::string("axis_deg") && !has_axis(eye.prescription.value("cylinder_D", Json()));
    if (is_undetermined || !eye.prescription.contains(key)) continue;
    const auto value = value_of(eye.prescription, key);
    const std::string interval = interval_sentence(name, eye.prescription[key], style);
    if (value && !interval.empty()) text += interval + ", value " + format(*value, style) + ". ";
  }
  return dicom_text(text, most_characters_of_text);
}

/// The comment, then the sphere, cylinder and axis of the rounded lens.
void add_eye(Tree& tree, const EyeData& eye, const std::string& comment) {
  const bool is_right = eye.laterality == Laterality::od;
  const Json rounded = eye.prescription.value("rounded", Json::object());
  tree.container({is_right ? "111688" : "111689", "DCM", is_right ? "Right Eye Rx" : "Left Eye Rx"});
  tree.text({"121106", "DCM", "Comment"}, comment);
  tree.number({"251795007", "SCT", "Sphere"}, value_of(rounded, "sphere_D").value_or(0), "D");
  const double cylinder = value_of(rounded, "cylinder_D").value_or(0);
  if (cylinder != 0) {
    tree.number({"251797004", "SCT", "Cylinder"}, cylinder, "D");
    tree.number({"251799001", "SCT", "Axis"}, value_of(rounded, "axis_deg").value_or(180), "deg");
  }
  tree.up();
}

void describe_document(DSRDocument& document, const SourceStudy& source) {
  check(document.setSpecificCharacterSet("ISO_IR 192"), "character set");
  check(document.createNewSeriesInStudy(source.study_uid().c_str()), "series");
  check(document.setManufacturer(manufacturer), "equipment");
  check(document.setManufacturerModelName(model), "equipment");
  check(document.setDeviceSerialNumber(serial_number), "equipment");
  check(document.setSoftwareVersions(dicom_text(version(), 64).c_str()), "equipment");
  check(document.setPreliminaryFlag(DSRTypes::PF_Preliminary), "preliminary");
}

void start_measurement_report(TID1500_MeasurementReport& report) {
  // By its code: the class of languages has another name in every other DCMTK.
  check(report.setLanguage(DSRCodedEntryValue("eng", "RFC5646", "English")), "language");
  check(report.getObservationContext().addDeviceObserver(stable_uid("device " + version()).c_str(), model,
                                                         manufacturer, model, serial_number),
        "observer");
  check(report.addProcedureReported(DSRCodedEntryValue("113091000", "SCT", "Magnetic resonance imaging")),
        "procedure");
}

using MeasurementGroup = TID1500_MeasurementReport::TID1501_Measurements;

/// Which eye the group's numbers are of.
void describe_finding(MeasurementGroup& group, const SourceStudy& source, const EyeData& eye) {
  const bool is_right = eye.laterality == Laterality::od;
  check(group.setTrackingIdentifier(is_right ? "OD (right eye)" : "OS (left eye)"), "tracking");
  check(group.setTrackingUniqueIdentifier(stable_uid("eye " + source.study_uid() + eye.id()).c_str()),
        "tracking");
  check(group.addFindingSite(
            DSRCodedEntryValue("81745001", "SCT", "Eye"),
            CID244e_Laterality(is_right ? CID244e_Laterality::Right : CID244e_Laterality::Left)),
        "site");
}

/// What coded numbers do not say of an eye.
std::string biometry_comment(const EyeData& eye) {
  const auto& rows = keratometry_rows();
  const bool is_toric =
      std::all_of(rows.begin(), rows.end(), [&](const auto& row) { return row.is_determined(eye.biometry); });
  std::string text = biometry_notice;
  if (!is_toric) text += " The corneal cylinder may be none: its axes are not determined.";
  for (const auto& [reason, list] : withheld_quantities(eye.biometry))
    text += fmt::format(" Withheld, since {}: {}.", reason, list);
  return dicom_text(text, most_characters_of_text);
}

/// Writes an eye's biometry into its group, and lists what has been written.
void add_measurements(MeasurementGroup& group, const EyeData& eye, std::vector<ReportedNumber>& numbers) {
  for (const auto* rows : measured_rows())
    for (const auto& row : *rows) {
      const auto value = value_at(eye.biometry, "/" + row.key);
      if (!value) continue;
      const std::string code = "E" + sha256_of(row.key).substr(0, 10);  // at most 16 characters
      check(group.addMeasurement(DSRCodedEntryValue(code.c_str(), own_scheme, row.name.c_str()),
                                 CMR_TID1501_in_TID1500::MeasurementValue(decimal_string(*value).c_str(),
                                                                          unit_code(row.style.unit)),
                                 OFTrue),
            row.key);
      const Json& found = eye.biometry.at(Json::json_pointer("/" + row.key));
      const auto measured = found.is_object() ? std::optional(found.get<Measured>()) : std::nullopt;
      if (measured) check(group.getMeasurement().setMeasurementMethod(method_code(*measured)), row.key);
      numbers.push_back({measured, row.style.unit});
    }
}

}  // namespace

bool is_of_contact_lens(const EyeData& eye) {
  return value_of(eye.prescription, "vertex_distance_mm") == 0.0;
}

std::string conditions_of(const Json& prescription) {
  std::string text;
  if (!has_axis(prescription.value("cylinder_D", Json())))
    text += "The cylinder may be none: its axis is not determined. ";
  return text + light_of(prescription, "In light of {:g} nm. ");
}

std::string prescription_object(const SourceStudy& source, const CaseData& data, const std::string& result) {
  DSRDocument document(DSRTypes::DT_SpectaclePrescriptionReport);
  describe_document(document, source);
  Tree tree(document.getTree());
  tree.root({"111671", "DCM", "Spectacle Prescription Report"}, "2020");
  bool any = false;
  for (const auto& eye : data.eyes) {
    const Judgement judgement = judge(data, eye);
    if (!judgement.has_prescription || is_of_contact_lens(eye)) continue;
    any = true;
    add_eye(tree, eye, prescription_comment(data, eye, judgement));
  }
  if (!any) return {};
  tree.text({"121106", "DCM", "Comment"}, research_notice);
  ObjectName name;
  name.role = "prescription";
  name.modality = "SR";
  name.description = "Spectacle prescription, RESEARCH USE ONLY";
  name.series_number = 9002;
  name.result = result;
  return document_bytes(document, source, name);
}

std::string biometry_object(const SourceStudy& source, const CaseData& data, const std::string& result) {
  TID1500_MeasurementReport report(CMR_CID7021::ImagingMeasurementReport);
  start_measurement_report(report);
  std::vector<ReportedNumber> numbers;
  bool any = false;
  for (const auto& eye : data.eyes) {
    if (!eye.biometry.is_object()) continue;
    if (any) check(report.addIndividualMeasurements(), "measurement group");
    auto& group = report.getIndividualMeasurements();
    describe_finding(group, source, eye);
    add_measurements(group, eye, numbers);
    check(group.addQualitativeEvaluation(DSRCodedEntryValue("121106", "DCM", "Comment"),
                                         OFString(biometry_comment(eye).c_str())),
          "comment");
    any = true;
  }
  if (!any) return {};
  DSRDocument document;
  check(document.setTreeFromRootTemplate(report, OFTrue /* expand */), "TID 1500");
  add_uncertainties(document.getTree(), numbers);
  describe_document(document, source);
  ObjectName name;
  name.role = "biometry";
  name.modality = "SR";
  name.description = "Eye biometry, RESEARCH USE ONLY";
  name.series_number = 9003;
  name.result = result;
  return document_bytes(document, source, name);
}

}  // namespace emmetrope::report
