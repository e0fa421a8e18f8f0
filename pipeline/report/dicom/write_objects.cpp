#include "pipeline/report/dicom/write_objects.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

#include "pipeline/base/files.hpp"
#include "pipeline/base/iso_date.hpp"
#include "pipeline/base/measured.hpp"
#include "pipeline/base/version.hpp"
#include "pipeline/report/content/content.hpp"
#include "pipeline/report/content/judgement.hpp"
#include "pipeline/report/dicom/objects.hpp"

namespace emmetrope::report {
namespace {

namespace fs = std::filesystem;

/// Everything that an object may tell, as one hash: the same result gives the same instances.
std::string result_hash(const CaseData& data) {
  std::string all;
  for (const auto& eye : data.eyes) all += eye.id();
  for (const auto& stage : data.stages)
    all += stage.provenance.dump(-1, ' ', false, Json::error_handler_t::replace);
  return sha256_of(all);
}

/// Runs one writer; a failure becomes a note.
template <typename Write>
void attempt(Notes& notes, const std::string& what, const Write& write) {
  try {
    write();
  } catch (const Error& error) {
    if (error.status() == ExitStatus::not_writable) throw;
    notes.push_back(what + " was not written: " + error.what());
  }
}

void write_if_any(const fs::path& file, const std::string& bytes) {
  if (!bytes.empty()) write_file(file, bytes);
}

void write_meshes(const fs::path& folder, const CaseData& data, const SourceStudy& source,
                  const std::string& result) {
  int number = 0;
  for (const auto& eye : data.eyes)
    for (const char* surface :
         {"cornea_anterior", "cornea_posterior", "lens_anterior", "lens_posterior", "retina"}) {
      ++number;
      if (!fs::exists(eye.mesh(surface))) continue;
      write_file(
          folder / fmt::format("{}_{}.dcm", eye.id(), surface),
          mesh_object(source, read_mesh(eye.mesh(surface)).mesh, eye.laterality, surface, number, result));
    }
}

void write_pictures(const fs::path& folder, const CaseData& data, const SourceStudy& source,
                    const std::string& result) {
  const std::string worn = worn_while_traced(data);
  int number = 0;
  for (const auto& eye : data.eyes)
    for (const auto& [name, file, title] :
         {std::tuple{"uncorrected", eye.uncorrected_png,
                     "Retinal image " + (worn.empty() ? "without a lens" : "through " + worn)},
          std::tuple{"corrected", eye.corrected_png, std::string("Retinal image with the lens")}}) {
      ++number;
      if (file.empty()) continue;
      const cv::Mat image = cv::imread(file.string(), cv::IMREAD_COLOR);
      if (image.empty()) throw input_error(file.string() + " is no picture", "run the stage again");
      cv::Mat rgb;
      cv::cvtColor(image, rgb, cv::COLOR_BGR2RGB);
      const std::string pixels(reinterpret_cast<const char*>(rgb.data), rgb.total() * 3);
      write_file(folder / fmt::format("{}_{}.dcm", eye.id(), name),
                 picture_object(source, pixels, rgb.rows, rgb.cols, eye.laterality,
                                std::string(eye.laterality == Laterality::od ? "OD: " : "OS: ") + title,
                                number, result));
    }
}

/// UID of the series that a stack was made of, from case.json; empty where it names none.
std::string series_of(const CaseData& data, const std::string& stack_name) {
  for (const auto& stack : data.case_json.value("stacks", Json::array()))
    if (stack.value("name", std::string()) == stack_name) return stack.value("uid", std::string());
  return {};
}

/// One a stack that has labels of these eyes; one that cannot be written takes no other with it.
void write_segmentations(const fs::path& folder, const CaseData& data, const SourceStudy& source,
                         const std::string& result, Notes& notes) {
  const fs::path names = data.folder / "segmentation" / "labels.json";
  if (!fs::exists(names)) return;
  int number = 1;
  for (const auto& stack : data.stacks) {
    const std::string name = stack.filename().string().substr(0, stack.filename().string().size() - 7);
    const fs::path labels = data.folder / "segmentation" / (name + "_labels.nii.gz");
    if (!fs::exists(labels)) continue;
    const std::string file = number == 1 ? "segmentation.dcm" : fmt::format("segmentation_{}.dcm", number);
    bool is_empty = false;
    attempt(notes, file, [&] {
      const std::string bytes = segmentation_object(source, labels, read_json(names), data.eyes,
                                                    series_of(data, name), number, result);
      is_empty = bytes.empty();
      write_if_any(folder / file, bytes);
    });
    if (!is_empty) ++number;
  }
}

/// One structure set a stack whose images are at hand.
void write_structure_sets(const fs::path& folder, const CaseData& data, const SourceStudy& source,
                          const std::string& result) {
  int number = 0;
  std::set<std::string> written;
  for (const auto& stack : data.case_json.value("stacks", Json::array())) {
    const std::string series = stack.value("uid", std::string());
    if (!stack.value("used", false) || !written.insert(series).second) continue;
    const std::string bytes = structure_set_object(source, data, series, stack.value("name", std::string()),
                                                   number + 1, result + series);
    if (bytes.empty()) continue;
    ++number;
    write_file(folder / (number == 1 ? "structures.dcm" : fmt::format("structures_{}.dcm", number)), bytes);
  }
}

/// "Spherical equivalent +-2.5 D (95 %). "
std::string uncertainty_of(const Json& prescription) {
  const auto M = measured_in(prescription, "M_D");
  return M ? fmt::format("Spherical equivalent +-{:.1f} D (95 %). ", (M->ci95[1] - M->ci95[0]) / 2)
           : std::string();
}

/// What is not to be overlooked first.
Json fhir_notes(const CaseData& data, const EyeData& eye, const Judgement& judgement) {
  Json notes = Json::array();
  if (const std::string doubts = doubts_of(eye, judgement); !doubts.empty())
    notes.push_back({{"text", doubts}});
  const double vertex_mm = value_of(eye.prescription, "vertex_distance_mm").value_or(12);
  notes.push_back({{"text", fmt::format("Vertex distance {:g} mm, {}. {}{}{}", vertex_mm,
                                        refracted_point(data), uncertainty_of(eye.prescription),
                                        conditions_of(eye.prescription), research_notice)}});
  return notes;
}

}  // namespace

Json fhir_prescription(const CaseData& data, const std::string& study_date) {
  Json lenses = Json::array();
  for (const auto& eye : data.eyes) {
    const Judgement judgement = judge(data, eye);
    if (!judgement.has_prescription) continue;
    const Json rounded = eye.prescription.value("rounded", Json::object());
    Json lens{{"product",
               {{"coding",
                 {{{"system", "http://terminology.hl7.org/CodeSystem/ex-visionprescriptionproduct"},
                   {"code", is_of_contact_lens(eye) ? "contact" : "lens"}}}}}},
              {"eye", eye.laterality == Laterality::od ? "right" : "left"},
              // FHIR R4: sphere is a spectacle lens's power
              {is_of_contact_lens(eye) ? "power" : "sphere", value_of(rounded, "sphere_D").value_or(0)}};
    if (const double cylinder = value_of(rounded, "cylinder_D").value_or(0); cylinder != 0) {
      lens["cylinder"] = cylinder;
      lens["axis"] = std::lround(value_of(rounded, "axis_deg").value_or(180));
    }
    lens["note"] = fhir_notes(data, eye, judgement);
    lenses.push_back(lens);
  }
  if (lenses.empty()) return nullptr;
  Json resource{{"resourceType", "VisionPrescription"}, {"status", "draft"}};
  if (study_date.empty()) {
    const Json unknown{{"extension",
                        {{{"url", "http://hl7.org/fhir/StructureDefinition/data-absent-reason"},
                          {"valueCode", "unknown"}}}}};
    resource["_created"] = unknown;
    resource["_dateWritten"] = unknown;
  } else {
    resource["created"] = study_date;
    resource["dateWritten"] = study_date;
  }
  resource["patient"] = {{"identifier", {{"value", data.subject()}}}};
  resource["prescriber"] = {{"display", "None: made by software, unverified"}};
  resource["lensSpecification"] = lenses;
  return resource;
}

std::string study_date_of(const CaseData& data, const SourceStudy& source) {
  if (!data.study_date().empty() || source.images().empty()) return data.study_date();
  return iso_date(source.known_date());
}

void write_objects(const fs::path& folder, const CaseData& data, const SourceStudy& source,
                   const std::string& pdf, bool identified, Notes& notes) {
  const std::string result = result_hash(data);
  const fs::path more = folder / "dicom";
  fs::create_directories(more);
  if (std::any_of(data.eyes.begin(), data.eyes.end(), is_of_contact_lens))
    notes.emplace_back(
        "prescription.dcm has spectacles alone: a contact lens, vertex distance 0, is not in it");
  attempt(notes, "prescription.dcm",
          [&] { write_if_any(folder / "prescription.dcm", prescription_object(source, data, result)); });
  attempt(notes, "biometry.dcm",
          [&] { write_if_any(folder / "biometry.dcm", biometry_object(source, data, result)); });
  write_segmentations(folder, data, source, result, notes);
  attempt(notes, "structures.dcm", [&] { write_structure_sets(folder, data, source, result); });
  attempt(notes, "A surface mesh as DICOM", [&] { write_meshes(more, data, source, result); });
  attempt(notes, "A retinal image as DICOM", [&] { write_pictures(more, data, source, result); });
  attempt(notes, "report.dcm",
          [&] { write_file(folder / "report.dcm", pdf_object(source, pdf, identified, result)); });
  if (const Json fhir = fhir_prescription(data, study_date_of(data, source)); !fhir.is_null())
    write_json(folder / "prescription.fhir.json", fhir);
  if (fs::is_empty(more)) fs::remove(more);
}

}  // namespace emmetrope::report
