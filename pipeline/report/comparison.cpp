#include "pipeline/report/comparison.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>

#include "pipeline/base/case_folder.hpp"
#include "pipeline/base/case_scans.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/version.hpp"
#include "pipeline/report/case/case_data.hpp"
#include "pipeline/report/content/biometry_rows.hpp"
#include "pipeline/report/content/content.hpp"
#include "pipeline/report/content/judgement.hpp"
#include "pipeline/report/dicom/source_study.hpp"
#include "pipeline/report/dicom/write_objects.hpp"
#include "pipeline/report/page/html.hpp"
#include "pipeline/report/pdf/pdf.hpp"
#include "pipeline/report/stage.hpp"

namespace emmetrope::report {
namespace {

namespace fs = std::filesystem;

std::optional<Measured> measured_at(const Json& json, const std::string& path) {
  const Json::json_pointer pointer("/" + path);
  if (!json.is_object() || !json.contains(pointer) || !json.at(pointer).is_object() ||
      is_withheld(json.at(pointer)))
    return std::nullopt;
  return json.at(pointer).get<Measured>();
}

constexpr const char *changed = "changed", *undetermined = "not determined", *unmeasured = "not measured";

/// b - a; for angles of an axis the shorter way round.
double difference_of(const Measured& a, const Measured& b, const NumberStyle& style) {
  const double difference = b.value - a.value;
  return style.unit == "axis" ? std::remainder(difference, 180) : difference;
}

void add_row(Table& table, const Json& earlier, const Json& later, const BiometryRow& row) {
  const auto a = measured_at(earlier, row.key), b = measured_at(later, row.key);
  if (!a && !b) return;
  if (!a || !b) {
    const Measured& known = a ? *a : *b;
    if (known.source == "prior") return;
    const auto told = [&](const std::optional<Measured>& measured, const Json& document) -> std::string {
      return !measured                     ? unmeasured
             : row.is_determined(document) ? format(measured->value, row.style)
                                           : undetermined;
    };
    table.rows.push_back({row.name, told(a, earlier), told(b, later), "\u2013", "\u2013", unmeasured});
    return;
  }
  const bool is_in_a = row.is_determined(earlier), is_in_b = row.is_determined(later);
  if (!is_in_a || !is_in_b) {
    table.rows.push_back({row.name, is_in_a ? format(a->value, row.style) : undetermined,
                          is_in_b ? format(b->value, row.style) : undetermined, "\u2013", "\u2013",
                          undetermined});
    return;
  }
  if (a->source == "prior" && b->source == "prior") {  // the population's values tell nothing of this eye
    table.rows.push_back(
        {row.name, format(a->value, row.style), format(b->value, row.style), "\u2013", "\u2013", unmeasured});
    return;
  }
  const double difference = difference_of(*a, *b, row.style);
  // Of unequal halves those that face each other.
  const double limit = difference > 0 ? std::hypot(a->ci95[1] - a->value, b->value - b->ci95[0])
                                      : std::hypot(a->value - a->ci95[0], b->ci95[1] - b->value);
  const std::string unit =
      row.style.unit == "axis" ? "deg" : row.style.unit;  // of axes that are alike it is 0
  const NumberStyle with_sign{row.style.decimals, true, unit}, without_sign{row.style.decimals, false, unit};
  table.rows.push_back({row.name, format(a->value, row.style), format(b->value, row.style),
                        format(difference, with_sign), "\u00b1 " + format(limit, without_sign),
                        std::abs(difference) > limit ? changed : "within the intervals"});
}

std::vector<BiometryRow> refraction_rows() {
  std::vector<BiometryRow> rows;
  for (const auto& [key, name] :
       {std::pair{"sphere_D", "Sphere"}, std::pair{"cylinder_D", "Cylinder"}, std::pair{"axis_deg", "Axis"},
        std::pair{"M_D", "M"}, std::pair{"J0_D", "J0"}, std::pair{"J45_D", "J45"}}) {
    BiometryRow row;
    row.key = key;
    row.name = name;
    const bool is_axis = row.key == "axis_deg";
    row.style = NumberStyle{is_axis ? 0 : 2, !is_axis, is_axis ? "axis" : "D"};
    if (is_axis) row.cylinder = "cylinder_D";
    rows.push_back(row);
  }
  return rows;
}

/// In what two refractions were not made alike: "vertex_distance_mm 12 and 30"; empty where they were.
std::string unlike(const Json& earlier, const Json& later) {
  std::string differences;
  for (const char* key :
       {"vertex_distance_mm", "pupil_mm", "wavelength_nm", "fovea_mm", "criterion", "chart"})
    if (earlier.contains(key) && later.contains(key) && earlier.at(key) != later.at(key))
      differences += fmt::format("{}{} {} and {}", differences.empty() ? "" : ", ", key,
                                 earlier.at(key).dump(), later.at(key).dump());
  return differences;
}

Table table_of(const CaseData& earlier, const EyeData& a, const CaseData& later, const EyeData& b) {
  Table table{clinical_name(a.laterality),
              {"Quantity", "Earlier", "Later", "Difference", "95 % limit", "Judgement"},
              {}};
  if (judge(earlier, a).has_refraction && judge(later, b).has_refraction &&
      unlike(a.prescription, b.prescription).empty())
    for (const auto& row : refraction_rows()) add_row(table, a.prescription, b.prescription, row);
  for (const auto* rows : measured_rows())
    for (const auto& row : *rows) add_row(table, a.biometry, b.biometry, row);
  return table;
}

/// Says of an eye whose refraction is no prescription that it is none, or that two were made in different ways; empty
/// where neither is so.
std::string estimates_in(const CaseData& earlier, const EyeData& a, const CaseData& later, const EyeData& b) {
  const Judgement first = judge(earlier, a), second = judge(later, b);
  if (!first.has_refraction || !second.has_refraction) return {};
  if (const std::string settings = unlike(a.prescription, b.prescription); !settings.empty())
    return clinical_name(a.laterality) +
           std::string(
               ": the refractions are not compared, as they were not made "
               "alike: ") +
           settings + ". Run emmetrope correct on one case as on the other.";
  if (first.has_prescription && second.has_prescription) return {};
  const char* which = first.has_prescription    ? "later"
                      : second.has_prescription ? "earlier"
                                                : "earlier and later";
  return clinical_name(a.laterality) + std::string(": the ") + which +
         " refraction is an estimate for information, not a prescription.";
}

/// "OD (right): Axial length, optical +0.35 mm; ..." or that nothing did.
std::string changes_in(const Table& table) {
  std::string changes;
  for (const auto& row : table.rows)
    if (row.back() == changed) changes += (changes.empty() ? "" : "; ") + row[0] + " " + row[3];
  return table.caption + ": " +
         (changes.empty() ? "nothing changed by more than its interval." : changes + ".");
}

/// One of the two cases.
struct Visit {
  const char* name;  ///< "Earlier"
  CaseData data;
  std::optional<SourceStudy> source;
  std::string date;  ///< YYYY-MM-DD, or empty

  Visit(const char* which, const fs::path& folder, LateralityChoice eyes)
      : name(which), data(read_case(folder, eyes)), source(source_study_of(data)) {
    date = source ? study_date_of(data, *source) : data.study_date();
  }
};

/// Why a case gives nothing to compare of an eye: "Later, OD (right): No prescription: .... One reason; another."
std::vector<std::string> refusals_in(const Visit& visit) {
  std::vector<std::string> refusals;
  for (const auto& eye : visit.data.eyes)
    if (const Judgement judgement = judge(visit.data, eye); !judgement.has_refraction) {
      std::string why;
      for (const Finding& finding : judgement.reasons) {
        why += (why.empty() ? " " : "; ") + finding.what;
        if (why.back() == '.') why.pop_back();  // gates end without a full stop, sentences with one
      }
      if (!why.empty()) why += ".";
      refusals.push_back(
          fmt::format("{}, {}: {}.{}", visit.name, clinical_name(eye.laterality), judgement.verdict, why));
    }
  return refusals;
}

/// What the reader must know besides the differences.
std::vector<std::string> remarks_on(const Visit& earlier, const Visit& later) {
  std::vector<std::string> remarks{patients_of(earlier.source, later.source).text};
  if (earlier.data.subject() == later.data.subject() && later.data.subject() != "unknown")
    remarks.emplace_back(
        "Both cases were made from one study: differences are of the processing, not of the eye.");
  else if (share_a_scan(earlier.data.case_json, later.data.case_json))
    remarks.emplace_back(
        "Both cases are of one scan, whose images have the same matrix, least, largest and mean value: differences are "
        "of the processing, not of the eye.");
  for (const Visit* visit : {&earlier, &later})
    for (auto& refusal : refusals_in(*visit)) remarks.push_back(std::move(refusal));
  return remarks;
}

Document document_of(const Visit& first, const Visit& second, const std::vector<std::string>& remarks) {
  const CaseData &earlier = first.data, &later = second.data;
  Document document;
  document.title = "Emmetrope follow-up";
  document.date_iso = second.date;
  for (const Visit* visit : {&first, &second})
    document.heading.emplace_back(visit->name,
                                  visit->data.subject() + (visit->date.empty() ? "" : ", " + visit->date));
  document.heading.emplace_back("Software", "Emmetrope " + version());
  Section section{"differences", "Differences", {}};
  BulletList changes;
  std::vector<Table> tables;
  for (const auto& a : earlier.eyes)
    for (const auto& b : later.eyes)
      if (a.laterality == b.laterality)
        if (const Table table = table_of(earlier, a, later, b); !table.rows.empty()) {
          changes.items.push_back(changes_in(table));
          if (const std::string estimate = estimates_in(earlier, a, later, b); !estimate.empty())
            changes.items.push_back(estimate);
          tables.push_back(table);
        }
  changes.items.insert(changes.items.end(), remarks.begin(), remarks.end());
  section.blocks.push_back({changes});
  for (const auto& table : tables) section.blocks.push_back({table});
  if (tables.empty()) section.blocks.push_back({Paragraph{"No quantity was measured in both cases."}});
  section.blocks.push_back({Paragraph{
      "Differences are taken before rounding. A difference within the limit may be measurement error alone. "
      "The limit takes the two measurements as independent; a prior that both share (the lens's index, the "
      "back of the cornea) makes it wider than need be."}});
  document.sections.push_back(section);
  return document;
}

std::vector<StageInput> inputs_of(const CaseData& data) {
  std::vector<StageInput> inputs{{"case.json", data.folder / "case.json"}};
  if (!fs::exists(inputs[0].path)) inputs.clear();
  for (const char* stage : {"segmentation", "meshing", "correction"})
    for (const auto& input : inputs_below(data.folder, stage))
      if (input.path.extension() == ".json") inputs.push_back(input);
  return inputs;
}

bool are_equal(const std::vector<StageInput>& a, const std::vector<StageInput>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const StageInput& one, const StageInput& two) {
    return one.name == two.name && sha256_of_file(one.path) == sha256_of_file(two.path);
  });
}

}  // namespace

PatientsRemark patients_of(const std::optional<SourceStudy>& earlier,
                           const std::optional<SourceStudy>& later) {
  if (!earlier || !later)
    return {std::string("Whether both cases are of one patient was not checked: the source study of the ") +
            (earlier ? "later case"
             : later ? "earlier case"
                     : "cases") +
            " is not at hand."};
  const auto differ = [&](std::string (SourceStudy::*read)() const) {
    const std::string a = ((*earlier).*read)(), b = ((*later).*read)();
    return a.empty() || b.empty() ? std::nullopt : std::optional(a != b);
  };
  const auto ids = differ(&SourceStudy::patient_id), births = differ(&SourceStudy::birth_date);
  if (births.value_or(false))
    throw input_error(
        "the two cases are of two patients: (0010,0030) PatientBirthDate of their source studies differs",
        "name two cases of one patient");
  if (ids.value_or(false))
    return {
        "(0010,0020) PatientID of the two source studies differs: make sure that both are of one patient.",
        true};
  if (!ids && !births)
    return {
        "Whether both cases are of one patient was not checked: a source study has neither PatientID nor "
        "birth date."};
  return {std::string("The source studies agree in the patient's ") + (ids ? "ID" : "") +
          (ids && births ? " and " : "") + (births ? "birth date" : "") + "."};
}

Answer write_comparison(const fs::path& earlier_folder, const fs::path& later_folder,
                        const CommonOptions& common) {
  quiet_dicom_library();
  const Visit earlier("Earlier", earlier_folder, common.laterality),
      later("Later", later_folder, common.laterality);
  const std::vector<StageInput> of_earlier = inputs_of(earlier.data), of_later = inputs_of(later.data);
  if (are_equal(of_earlier, of_later))
    throw usage_error(
        "--compare: " + earlier_folder.string() + " and " + later_folder.string() + " hold the same results",
        "name two cases that were made from two studies of one patient");
  if (!earlier.date.empty() && !later.date.empty() && earlier.date > later.date)
    throw input_error("the earlier case is dated " + earlier.date + ", the later one " + later.date,
                      "name the earlier case first");
  const std::vector<std::string> remarks = remarks_on(earlier, later);
  StageSpec spec;
  spec.stage = "comparison";
  spec.parameters = {{"remarks", remarks}};
  for (const auto& [prefix, inputs] : {std::pair{"earlier/", &of_earlier}, std::pair{"later/", &of_later}})
    for (const StageInput& input : *inputs) spec.inputs.push_back({prefix + input.name, input.path});
  const auto work = [&](StageWorkspace& workspace) {
    const Document document = document_of(earlier, later, remarks);
    write_file(workspace.folder() / "comparison.html", render_html(document, {}, {}));
    write_file(workspace.folder() / "comparison.pdf", render_pdf(document).bytes);
    return StageVerdict{};
  };
  const StageOutcome outcome = run_stage(later_folder, spec, common, work);
  const fs::path html = later_folder / "comparison" / "comparison.html";
  Answer answer;
  answer.json = {{"remarks", remarks},
                 {"html", html.string()},
                 {"pdf", (later_folder / "comparison" / "comparison.pdf").string()}};
  answer.text = describe("comparison", outcome, common.verbosity);
  for (const std::string& remark : remarks) answer.text += remark + "\n";
  answer.text += html.string() + "\n";
  return answer;
}

}  // namespace emmetrope::report
