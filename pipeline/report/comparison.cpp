#include "pipeline/report/comparison.hpp"

#include <cmath>

#include "pipeline/base/case_folder.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/version.hpp"
#include "pipeline/report/case_data.hpp"
#include "pipeline/report/content.hpp"
#include "pipeline/report/dicom/source_study.hpp"
#include "pipeline/report/html.hpp"
#include "pipeline/report/judgement.hpp"
#include "pipeline/report/normal_ranges.hpp"
#include "pipeline/report/pdf.hpp"
#include "pipeline/report/report.hpp"

namespace emmetrope::report {
namespace {

namespace fs = std::filesystem;

std::optional<Measured> measured_at(const Json& json, const std::string& path) {
  const Json::json_pointer pointer("/" + path);
  if (!json.is_object() || !json.contains(pointer) || !json.at(pointer).is_object()) return std::nullopt;
  return json.at(pointer).get<Measured>();
}

constexpr const char* changed = "changed";

/// b - a; for angles of an axis the shorter way round.
double difference_of(const Measured& a, const Measured& b, const NumberStyle& style) {
  const double difference = b.value - a.value;
  return style.unit == "deg" ? std::remainder(difference, 180) : difference;
}

void add_row(Table& table, const Json& earlier, const Json& later, const BiometryRow& row) {
  const auto a = measured_at(earlier, row.key), b = measured_at(later, row.key);
  if (!a || !b) return;
  const double limit = std::hypot((a->ci95[1] - a->ci95[0]) / 2, (b->ci95[1] - b->ci95[0]) / 2);
  const double difference = difference_of(*a, *b, row.style);
  const NumberStyle with_sign{row.style.decimals, true, row.style.unit},
      without_sign{row.style.decimals, false, row.style.unit};
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
    row.style = NumberStyle{is_axis ? 0 : 2, !is_axis, is_axis ? "deg" : "D"};
    rows.push_back(row);
  }
  return rows;
}

Table table_of(const CaseData& earlier, const EyeData& a, const CaseData& later, const EyeData& b) {
  Table table{clinical_name(a.laterality),
              {"Quantity", "Earlier", "Later", "Difference", "95 % limit", "Judgement"},
              {}};
  if (judge(earlier, a).has_refraction && judge(later, b).has_refraction)
    for (const auto& row : refraction_rows()) add_row(table, a.prescription, b.prescription, row);
  for (const auto* rows : {&biometry_rows(), &keratometry_rows()})
    for (const auto& row : *rows) add_row(table, a.biometry, b.biometry, row);
  return table;
}

/// Says of an eye whose refraction is no prescription that it is none; empty where both are.
std::string estimates_in(const CaseData& earlier, const EyeData& a, const CaseData& later, const EyeData& b) {
  const Judgement first = judge(earlier, a), second = judge(later, b);
  if (!first.has_refraction || !second.has_refraction) return {};
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

Document document_of(const CaseData& earlier, const CaseData& later) {
  Document document;
  document.title = "Emmetrope follow-up";
  document.date_iso = study_date_of(later);
  for (const auto& [name, data] : {std::pair{"Earlier", &earlier}, std::pair{"Later", &later}})
    document.heading.emplace_back(
        name, data->subject() + (study_date_of(*data).empty() ? "" : ", " + study_date_of(*data)));
  document.heading.emplace_back("Software", "Emmetrope " + version());
  Section section{"differences", "Differences", {}};
  BulletList changes;
  if (earlier.subject() != later.subject())
    changes.items.emplace_back(
        "The two cases carry different pseudonyms: make sure that they are of one patient.");
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
  if (!changes.items.empty()) section.blocks.push_back({changes});
  for (const auto& table : tables) section.blocks.push_back({table});
  if (tables.empty()) section.blocks.push_back({Paragraph{"No quantity was measured in both cases."}});
  section.blocks.push_back({Paragraph{
      "Differences are taken before rounding. A difference within the limit may be measurement error alone. "
      "The limit takes the two measurements as "
      "independent; a prior that both share (the lens's index, the back of the cornea) makes it wider than "
      "need be. "
      "Cases carry pseudonyms: whether both are of one patient must be known from elsewhere."}});
  document.sections.push_back(section);
  return document;
}

void add_inputs(StageSpec& spec, const CaseData& data, const std::string& prefix) {
  for (const char* stage : {"segmentation", "meshing", "correction"})
    for (auto& input : inputs_below(data.folder, stage)) {
      input.name = prefix + input.name;
      if (input.path.extension() == ".json") spec.inputs.push_back(input);
    }
}

}  // namespace

Answer write_comparison(const fs::path& earlier_folder, const fs::path& later_folder,
                        const CommonOptions& common) {
  const CaseData earlier = read_case(earlier_folder, common.laterality);
  const CaseData later = read_case(later_folder, common.laterality);
  quiet_dicom_library();
  const std::string earlier_date = study_date_of(earlier), later_date = study_date_of(later);
  if (!earlier_date.empty() && !later_date.empty() && earlier_date > later_date)
    throw input_error("the earlier case is dated " + earlier_date + ", the later one " + later_date,
                      "name the earlier case first");
  StageSpec spec;
  spec.stage = "comparison";
  add_inputs(spec, earlier, "earlier/");
  add_inputs(spec, later, "later/");
  const auto work = [&](StageWorkspace& workspace) {
    const Document document = document_of(earlier, later);
    write_file(workspace.folder() / "comparison.html", render_html(document, {}));
    write_file(workspace.folder() / "comparison.pdf", render_pdf(document).bytes);
    return StageVerdict{};
  };
  const StageOutcome outcome = run_stage(later_folder, spec, common, work);
  const fs::path html = later_folder / "comparison" / "comparison.html";
  Answer answer;
  answer.json = {{"html", html.string()}, {"pdf", (later_folder / "comparison" / "comparison.pdf").string()}};
  answer.text = "comparison: " + describe(outcome) + "\n" + html.string() + "\n";
  return answer;
}

}  // namespace emmetrope::report
