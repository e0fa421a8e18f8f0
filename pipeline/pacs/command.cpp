#include "pipeline/pacs/command.hpp"

#include <fmt/format.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <numeric>
#include <tuple>

#include "pipeline/base/case_folder.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/log.hpp"
#include "pipeline/base/progress.hpp"
#include "pipeline/base/scratch_folder.hpp"

namespace emmetrope::pacs {
namespace {

namespace fs = std::filesystem;

void require_query(const StudyQuery& query) {
  const bool asks = !query.study_uid.empty() || !query.patient_id.empty() ||
                    !query.accession_number.empty() || !query.study_date.empty();
  if (!asks)
    throw usage_error("pull: which study is not said",
                      "give --study-uid, --accession, --patient-id or --study-date");
}

FoundStudy only_one(std::vector<FoundStudy> studies) {
  // A federation of archives may list one twice.
  std::sort(studies.begin(), studies.end(), [](const FoundStudy& a, const FoundStudy& b) {
    return std::tie(a.uid, a.patient_id) < std::tie(b.uid, b.patient_id);
  });
  studies.erase(std::unique(studies.begin(), studies.end(),
                            [](const FoundStudy& a, const FoundStudy& b) {
                              return a.uid == b.uid && a.patient_id == b.patient_id;
                            }),
                studies.end());
  if (studies.empty())
    throw input_error("the archive has no such study", "check what is asked for; names are not searched");
  if (studies.size() == 1) return studies.front();
  if (std::all_of(studies.begin(), studies.end(),
                  [&](const FoundStudy& study) { return study.uid == studies.front().uid; }))
    throw input_error(
        fmt::format("study {} is of {} patients in the archive", studies.front().uid, studies.size()),
        shared_uid_remedy);
  constexpr std::size_t most_listed = 20;
  std::string list;
  for (std::size_t i = 0; i < std::min(studies.size(), most_listed); ++i)
    list += fmt::format("\n  {}  {}  {}  {}", studies[i].uid, studies[i].date, studies[i].modalities,
                        studies[i].description);
  throw input_error(fmt::format("{} studies are found:{}", studies.size(), list),
                    "choose one by --study-uid");
}

/// A pull that was killed leaves images where nobody looks for them. Processes of other machines, which may write to the
/// same folder, are not seen; of a folder that may not be listed nothing is said.
void warn_of_remains(const fs::path& output) {
  const std::string before_id = output.filename().string() + ".pulling-";
  std::error_code unreadable;
  for (const auto& entry : fs::directory_iterator(output.parent_path(), unreadable)) {
    const std::string name = entry.path().filename().string();
    if (name.rfind(before_id, 0) != 0) continue;
    const pid_t process = static_cast<pid_t>(std::strtol(name.c_str() + before_id.size(), nullptr, 10));
    if (process > 0 && ::kill(process, 0) != 0 && errno == ESRCH)
      spdlog::warn(
          "{} holds images of a pull that no process of this machine goes on with: remove it if none elsewhere does",
          entry.path().string());
  }
}

Answer pull(const PacsOptions& options, const CommonOptions& common) {
  require_query(options.query);
  if (options.output.empty()) throw usage_error("pull: -o is missing", "name the folder for the study");
  // "study/" is the folder "study".
  const fs::path named = fs::absolute(options.output).lexically_normal();
  const fs::path output = named.has_filename() ? named : named.parent_path();
  if (fs::exists(output) && !fs::is_empty(output))
    throw output_error(output.string() + " is there already", "name a new folder");
  const Archive archive(read_settings(options.settings));
  const FoundStudy study = only_one(archive.find_studies(options.query));
  if (!options.query.accession_number.empty() && study.accession_number.empty())
    spdlog::warn(
        "the archive does not say the accession number of study {}: only images that have one are compared",
        study.uid);
  // What comes is compared with what was asked for, else with itself: archives that have corrected an identifier may
  // send the original one.
  StudyQuery asked = options.query;
  if (asked.study_uid.empty()) asked.study_uid = study.uid;
  const std::vector<FoundSeries> series = archive.find_mr_series(asked.study_uid);
  if (series.empty())
    throw input_error("study " + asked.study_uid + " has no MR images in the archive: " + study.modalities);
  fs::create_directories(output.parent_path());
  warn_of_remains(output);
  const ScratchFolder scratch(fmt::format("{}.pulling-{}", output.string(), ::getpid()));
  const std::size_t expected =
      std::accumulate(series.begin(), series.end(), std::size_t{0},
                      [](std::size_t sum, const FoundSeries& one) { return sum + one.images.size(); });
  std::size_t count = 0;
  {
    Progress progress("receiving images", expected, common.verbosity);
    count = archive.get(asked, series, scratch.path(), [&] { progress.advance(); });
  }
  fs::remove(output);
  fs::rename(scratch.path(), output);
  Answer answer;
  answer.json = {{"study_uid", asked.study_uid}, {"files", count}, {"study", output.string()}};
  answer.text = fmt::format("{} images of study {}\n{}\n", count, asked.study_uid, output.string());
  return answer;
}

Answer push(const PacsOptions& options, const CommonOptions& common) {
  if (!looks_like_a_case(options.case_folder))
    throw usage_error("push: " + options.case_folder.string() + " is no case",
                      "emmetrope pacs push SETTINGS CASE");
  read_verdict(options.case_folder, "report");  // what is sent is whole and of this case
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(options.case_folder / "report"))
    if (entry.path().extension() == ".dcm") files.push_back(entry.path());
  if (files.empty())
    throw input_error((options.case_folder / "report").string() + " holds no DICOM object",
                      "run emmetrope report " + options.case_folder.string() + " --study STUDY");
  std::sort(files.begin(), files.end());
  const Archive archive(read_settings(options.settings));
  Progress progress("sending objects", files.size(), common.verbosity);
  archive.store(files, [&] { progress.advance(); });
  Answer answer;
  answer.json = {{"files", files.size()}};
  answer.text = fmt::format("{} objects sent\n", files.size());
  return answer;
}

}  // namespace

Answer run_pacs(const PacsOptions& options, const CommonOptions& common) {
  return options.action == "pull" ? pull(options, common) : push(options, common);
}

}  // namespace emmetrope::pacs
