#include <CLI/CLI.hpp>
#include <regex>

#include "pipeline/base/command_line.hpp"
#include "pipeline/base/iso_date.hpp"
#include "pipeline/pacs/command.hpp"

namespace {

/// To an archive these match what nobody named: wild cards, lists, and nothing at all, as spaces do not count.
std::string one_value(const std::string& text) {
  const bool is_one = !text.empty() && text.find_first_of("*?\\") == std::string::npos &&
                      text.front() != ' ' && text.back() != ' ';
  return is_one ? "" : "give one value, without * ? \\ and without spaces at its ends";
}

/// One in another form archives read as they like; one that no calendar has, or a range that ends before it begins, has no
/// studies.
std::string date_or_range(const std::string& text) {
  static const std::regex form("([0-9]{8})|([0-9]{8})-([0-9]{8})?|-([0-9]{8})");
  std::smatch dates;
  bool is_valid = std::regex_match(text, dates, form);
  for (std::size_t i = 1; i < dates.size(); ++i)
    is_valid = is_valid && (!dates[i].matched || !emmetrope::iso_date(dates[i]).empty());
  if (is_valid && dates[2].matched && dates[3].matched) is_valid = dates[2] <= dates[3];
  return is_valid ? ""
                  : "\"" + text + "\": expected a date YYYYMMDD, or two with - between, the earlier first";
}

}  // namespace

int main(int argc, char** argv) {
  emmetrope::pacs::PacsOptions options;
  return emmetrope::run_command(
      argc, argv,
      {"pacs", "Fetches a study from an archive (pull), or gives it the DICOM objects of a case (push).",
       "emmetrope pacs pull archive.json --accession A123 -o study    or: emmetrope pacs push archive.json case",
       [&](CLI::App& app) {
         app.add_option("action", options.action, "pull: a study comes; push: a case's results go")
             ->required()
             ->check(CLI::IsMember({"pull", "push"}))
             ->type_name("ACTION");
         app.add_option("settings", options.settings,
                        "host, port, called_ae_title, calling_ae_title, tls: a JSON file")
             ->required()
             ->type_name("ARCHIVE");
         app.add_option("case", options.case_folder, "With push: a case with its report")->type_name("CASE");
         app.add_option("--study-uid", options.query.study_uid, "With pull: StudyInstanceUID")
             ->check(one_value)
             ->type_name("UID");
         app.add_option("--accession", options.query.accession_number, "With pull: AccessionNumber")
             ->check(one_value)
             ->type_name("TEXT");
         app.add_option("--patient-id", options.query.patient_id, "With pull: PatientID")
             ->check(one_value)
             ->type_name("TEXT");
         app.add_option("--study-date", options.query.study_date,
                        "With pull: YYYYMMDD, or two with - between")
             ->check(one_value)
             ->check(date_or_range)
             ->type_name("DATE");
         app.add_option("-o,--output", options.output, "With pull: folder to make")->type_name("STUDY");
       },
       [&](const emmetrope::CommonOptions& common) { return emmetrope::pacs::run_pacs(options, common); }});
}
