#include "pipeline/follow/follow.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/version.hpp"
#include "pipeline/follow/quantities.hpp"
#include "pipeline/follow/visits.hpp"
#include "pipeline/report/document/document.hpp"
#include "pipeline/report/page/html.hpp"
#include "pipeline/report/pdf/pdf.hpp"

namespace emmetrope::follow {
namespace {

namespace fs = std::filesystem;

/// One eye over the visits: what each shows by itself, and the growth that all show together.
struct FollowedEye {
  Laterality laterality = Laterality::od;
  std::string reason;                         ///< why it is not followed; empty: it is
  std::vector<std::vector<double>> by_visit;  ///< quantities at each visit
  std::vector<Measured> per_year;
  std::vector<std::string> doubts;  ///< what was left out, and whether it is one eye
  std::string cornea_withheld;      ///< why its cornea's growth is not told; empty: it is
};

bool is_told(const FollowedQuantity& quantity, const FollowedEye& eye) {
  return !quantity.is_of_cornea || eye.cornea_withheld.empty();
}

/// By the limits of readings that contradict what is known (docs/use/instruments.md).
constexpr double doubted_sigmas = 3, refused_sigmas = 5;

/// What one eye does not do between two visits; where nobody knows how far they are apart that is a doubt at most.
void judge_differences(const Growth& growth, bool are_dated, FollowedEye& eye) {
  const auto visits = differences_of_quantities(growth);
  for (std::size_t k = 0; k < visits.size(); ++k)
    for (std::size_t q = 0; q < visits[k].size(); ++q) {
      const auto& [value, sigma] = visits[k][q];
      const FollowedQuantity& quantity = followed_quantities()[q];
      if (!is_told(quantity, eye) || std::abs(value) <= doubted_sigmas * sigma) continue;
      const std::string what = fmt::format(
          "{} of visit {} differs from the first by {:+.{}f} {}, {:.1f} standard deviations of what the errors of "
          "both and the growth of an eye in {} allow (two persons, surgery, accommodation, or one misread?)",
          quantity.name, k + 2, value, quantity.decimals, quantity.unit, std::abs(value) / sigma,
          are_dated ? "that time" : "a year");
      if (are_dated && std::abs(value) > refused_sigmas * sigma && eye.reason.empty())
        eye.reason = what;
      else
        eye.doubts.push_back(fmt::format("{}: {}.", clinical_name(eye.laterality), what));
    }
}

/// \throw Error (input_invalid) where two visits are one scan, whose errors would pass for growth that is known
void require_own_scans(const FollowedEye& eye) {
  for (std::size_t i = 1; i < eye.by_visit.size(); ++i)
    for (std::size_t k = 0; k < i; ++k)
      if (eye.by_visit[i] == eye.by_visit[k])
        throw input_error(fmt::format("visits {} and {} are one scan: {} is the same to the last digit",
                                      k + 1, i + 1, clinical_name(eye.laterality)),
                          "name one case a visit");
}

FollowedEye followed(const Visits& visits, Laterality laterality, double scale_sigma) {
  const EyeAtVisits at_visits = eye_at_visits(visits, laterality);
  FollowedEye eye{laterality, at_visits.reason, {}, {}, at_visits.doubts, ""};
  if (!eye.reason.empty()) return eye;
  const std::vector<std::string> unused = unused_readings(visits, laterality);
  eye.doubts.insert(eye.doubts.end(), unused.begin(), unused.end());
  for (const EyeAtVisit& visit : at_visits.eyes) {
    const Eigen::VectorXd values = quantities_of(visit.eye.eye());
    eye.by_visit.emplace_back(values.data(), values.data() + values.size());
  }
  require_own_scans(eye);
  eye.cornea_withheld = why_cornea_is_withheld(visits, laterality);
  if (!eye.cornea_withheld.empty())
    eye.doubts.push_back(fmt::format("{}: the growth of the cornea is withheld; {}.",
                                     clinical_name(laterality), eye.cornea_withheld));
  const Growth growth = growth_of(at_visits.eyes, scale_sigma);
  judge_differences(growth, visits.are_dated, eye);
  eye.per_year = growth_of_quantities(growth);
  return eye;
}

/// "+0.10", and "0.00" for what rounds to it.
std::string with_sign(double value, int decimals) {
  std::string text = fmt::format("{:+.{}f}", value, decimals);
  return text.find_first_of("123456789") == std::string::npos ? text.substr(1) : text;
}

bool is_growth(const Measured& growth) { return growth.ci95[0] > 0 || growth.ci95[1] < 0; }

/// Without dates it is the growth between the two visits.
std::string unit_of(const FollowedQuantity& quantity, const Visits& visits) {
  return quantity.unit + std::string(visits.are_dated ? " a year" : "");
}

report::Table table_of(const FollowedEye& eye, const Visits& visits) {
  report::Table table;
  table.caption = clinical_name(eye.laterality);
  table.header = {"Quantity"};
  for (std::size_t i = 0; i < visits.cases.size(); ++i)
    table.header.push_back(visits.are_dated ? fmt::format("{:.2f} years", visits.years[i])
                                            : fmt::format("Visit {}", i + 1));
  table.header.insert(table.header.end(), {"Growth", "95 % interval", "Judgement"});
  for (std::size_t q = 0; q < followed_quantities().size(); ++q) {
    const FollowedQuantity& quantity = followed_quantities()[q];
    if (!is_told(quantity, eye)) continue;
    std::vector<std::string> row{quantity.name};
    for (const std::vector<double>& values : eye.by_visit)
      row.push_back(fmt::format("{:.{}f} {}", values[q], quantity.decimals, quantity.unit));
    const Measured& growth = eye.per_year[q];
    row.push_back(with_sign(growth.value, quantity.decimals) + " " + unit_of(quantity, visits));
    row.push_back(with_sign(growth.ci95[0], quantity.decimals) + " to " +
                  with_sign(growth.ci95[1], quantity.decimals));
    row.emplace_back(is_growth(growth) ? "changes" : "no change is seen");
    table.rows.push_back(std::move(row));
  }
  return table;
}

std::string headline(const FollowedEye& eye, const Visits& visits) {
  if (!eye.reason.empty())
    return fmt::format("{}: not followed; {}.", clinical_name(eye.laterality), eye.reason);
  const Measured& length = eye.per_year.front();
  return fmt::format("{}: axial length {} {} ({} to {}).", clinical_name(eye.laterality),
                     with_sign(length.value, 2), unit_of(followed_quantities().front(), visits),
                     with_sign(length.ci95[0], 2), with_sign(length.ci95[1], 2));
}

/// What the reader is warned of, the visits' first.
std::vector<std::string> doubts_of(const std::vector<FollowedEye>& eyes, const Visits& visits) {
  std::vector<std::string> doubts = visits.doubts;
  for (const FollowedEye& eye : eyes) doubts.insert(doubts.end(), eye.doubts.begin(), eye.doubts.end());
  return doubts;
}

report::Document document_of(const std::vector<FollowedEye>& eyes, const Visits& visits) {
  report::Document document;
  document.title = "Emmetrope growth";
  document.date_iso = visits.dates.back();
  for (std::size_t i = 0; i < visits.cases.size(); ++i)
    document.heading.emplace_back(
        fmt::format("Visit {}", i + 1),
        visits.cases[i].subject() + (visits.dates[i].empty() ? "" : ", " + visits.dates[i]));
  document.heading.emplace_back("Software", "Emmetrope " + version());
  report::Section section{"growth", "Growth", {}};
  report::BulletList list;
  for (const FollowedEye& eye : eyes) list.items.push_back(headline(eye, visits));
  for (const std::string& doubt : doubts_of(eyes, visits)) list.items.push_back("Warning: " + doubt);
  list.items.insert(list.items.end(), visits.remarks.begin(), visits.remarks.end());
  section.blocks.push_back({list});
  for (const FollowedEye& eye : eyes)
    if (eye.reason.empty()) section.blocks.push_back({table_of(eye, visits)});
  section.blocks.push_back({report::Paragraph{
      "The visits are fitted together as one eye that changes evenly: the change since the first visit has the errors of "
      "both fits, and cornea, chamber and lens are known to change little. The columns of the visits are the fits of each "
      "by itself, to the vitreo-retinal interface."}});
  document.sections.push_back(std::move(section));
  return document;
}

Json json_of(const std::vector<FollowedEye>& eyes, const Visits& visits) {
  Json json{{"years", visits.are_dated ? Json(visits.years) : Json(nullptr)},
            {"remarks", visits.remarks},
            {"warnings", doubts_of(eyes, visits)}};
  for (const FollowedEye& eye : eyes) {
    Json& entry = json["eyes"][to_string(eye.laterality)];
    if (!eye.reason.empty()) {
      entry = {{"withheld", eye.reason}};
      continue;
    }
    for (std::size_t q = 0; q < followed_quantities().size(); ++q) {
      const FollowedQuantity& quantity = followed_quantities()[q];
      if (!is_told(quantity, eye)) {
        entry[quantity.key] = {{"withheld", eye.cornea_withheld}};
        continue;
      }
      Json at_visits = Json::array();
      for (const std::vector<double>& values : eye.by_visit) at_visits.push_back(values[q]);
      entry[quantity.key] = {{"visits", at_visits},
                             {visits.are_dated ? "per_year" : "growth", eye.per_year[q]}};
    }
  }
  return json;
}

}  // namespace

Answer run_follow(const FollowOptions& options, const CommonOptions& common) {
  if (options.visits.size() < 2) throw usage_error("one visit has no growth", "name two or more cases");
  const Visits visits = read_visits(options.visits, options.years, common.laterality);
  std::vector<FollowedEye> eyes;
  for (const Laterality eye : both_eyes)
    if (includes(common.laterality, eye)) eyes.push_back(followed(visits, eye, options.scale_sigma));
  const auto count = static_cast<std::size_t>(
      std::count_if(eyes.begin(), eyes.end(), [](const FollowedEye& eye) { return eye.reason.empty(); }));
  for (const std::string& doubt : doubts_of(eyes, visits)) spdlog::warn("{}", doubt);
  const Json json = json_of(eyes, visits);
  std::error_code fault;
  fs::create_directories(options.output, fault);
  if (fault)
    throw output_error("cannot make the folder " + options.output.string() + ": " + fault.message(),
                       "name a folder, or a place where one can be made, with -o");
  const report::Document document = document_of(eyes, visits);
  write_file(options.output / "growth.html", report::render_html(document, {}, {}));
  write_file(options.output / "growth.pdf", report::render_pdf(document).bytes);
  write_json(options.output / "growth.json", json);
  Answer answer;
  answer.status = count == eyes.size() ? ExitStatus::done
                  : count > 0          ? ExitStatus::partial
                                       : ExitStatus::no_result;
  answer.json = json;
  for (const FollowedEye& eye : eyes) answer.text += headline(eye, visits) + "\n";
  for (const std::string& remark : visits.remarks) answer.text += remark + "\n";
  answer.text += (options.output / "growth.html").string() + "\n";
  return answer;
}

}  // namespace emmetrope::follow
