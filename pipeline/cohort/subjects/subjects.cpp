#include "pipeline/cohort/subjects/subjects.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <set>
#include <sstream>

#include "pipeline/base/clean_text.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/log.hpp"
#include "pipeline/base/version.hpp"
#include "pipeline/cohort/subjects/readings.hpp"
#include "pipeline/cohort/subjects/table.hpp"

namespace emmetrope::cohort {
namespace {

namespace fs = std::filesystem;

/// Of every file its place, size and last change. What cannot be read is left out: the study's own reader tells of it.
constexpr std::size_t sample_bytes = 4096;

/// From the beginning, where DICOM says whose file it is, and the middle, where NIfTI has its voxels.
std::string sample_of(const fs::path& file, std::uintmax_t size) {
  std::ifstream stream(file, std::ios::binary);
  std::string bytes(2 * sample_bytes, '\0');
  stream.read(bytes.data(), sample_bytes);
  stream.clear();
  stream.seekg(static_cast<std::streamoff>(size / 2));
  stream.read(bytes.data() + sample_bytes, sample_bytes);
  return bytes;
}

/// A study has fewer, and is refused by its own reader where it has more (a disk's top folder).
constexpr std::size_t most_entries = 100'000;

/// Of two studies that have changed names the files may be alike in names, sizes and times: the largest is looked into.
Json fingerprint_of(const fs::path& study) {
  std::vector<std::string> files;
  fs::path largest;
  std::uintmax_t largest_size = 0;
  std::error_code unreadable;
  fs::recursive_directory_iterator entry(study, fs::directory_options::skip_permission_denied, unreadable);
  std::size_t entries = 0;
  for (; !unreadable && entry != fs::recursive_directory_iterator() && entries < most_entries;
       entry.increment(unreadable), ++entries) {
    std::error_code gone;
    if (!entry->is_regular_file(gone)) continue;
    const std::uintmax_t size = entry->file_size(gone);
    files.push_back(fmt::format("{} {} {}", entry->path().lexically_relative(study).string(), size,
                                entry->last_write_time(gone).time_since_epoch().count()));
    if (!gone && (size > largest_size || (size == largest_size && entry->path() < largest))) {
      largest = entry->path();
      largest_size = size;
    }
  }
  std::sort(files.begin(), files.end());
  const std::size_t count = files.size();
  if (!largest.empty()) files.push_back(sample_of(largest, largest_size));
  return {{"files", count}, {"state", sha256_of(fmt::format("{}", fmt::join(files, "\n")))}};
}

Subject make_subject(const std::string& name, const fs::path& study) {
  std::string shown = study.string();
  const bool is_utf8 = make_clean_utf8(shown);
  if (shown != study.string())
    throw input_error("the name of the folder " + shown +
                          (is_utf8 ? " holds a line break or another control character" : " is not UTF-8"),
                      "rename it");
  return {plain_name(name), fs::absolute(study).lexically_normal(), {}, fingerprint_of(study)};
}

/// One that cannot be looked at is none.
bool is_folder(const fs::path& path) {
  std::error_code unreadable;
  return fs::is_directory(path, unreadable);
}

std::vector<fs::path> folders_in(const fs::path& folder) {
  std::vector<fs::path> folders;
  std::error_code unreadable;
  for (const auto& entry : fs::directory_iterator(folder, unreadable))
    if (entry.is_directory(unreadable) && entry.path().filename().string().front() != '.')
      folders.push_back(entry.path());
  std::sort(folders.begin(), folders.end());
  return folders;
}

bool starts_with(const fs::path& folder, const char* beginning) {
  return folder.filename().string().rfind(beginning, 0) == 0;
}

/// The folders "sub-01" or "ses-1" of those labels; all where none is named.
std::vector<fs::path> labelled_folders(const fs::path& folder, const std::string& prefix,
                                       const std::set<std::string>& labels) {
  std::vector<fs::path> folders;
  if (labels.empty()) {
    for (const fs::path& one : folders_in(folder))
      if (starts_with(one, prefix.c_str())) folders.push_back(one);
    return folders;
  }
  for (const std::string& label : labels)
    if (is_folder(folder / (prefix + label))) folders.push_back(folder / (prefix + label));
  return folders;
}

/// \throw Error (input_invalid) naming an image whose name is another person's or session's
void require_own_images(const fs::path& anat, const std::string& person, const std::string& visit) {
  for (const auto& entry : fs::directory_iterator(anat)) {
    const std::string file = entry.path().filename().string();
    const bool names_session = file.find("_ses-") != std::string::npos;
    if (file.rfind("sub-", 0) == 0 && file.rfind((names_session ? visit : person) + "_", 0) != 0)
      throw input_error(entry.path().string() + ": the name is not that of " + visit,
                        "BIDS names an image after its participant and session");
  }
}

std::vector<Subject> of_bids(const fs::path& dataset, const BidsChoice& choice) {
  for (const std::string& label : choice.participants)
    if (label.empty() || !is_folder(dataset / ("sub-" + label)))
      throw input_error(fmt::format("{}: there is no participant \"sub-{}\"", dataset.string(), label),
                        "name folders sub-* of the dataset");
  std::vector<Subject> subjects;
  std::set<std::string> sessions_seen;
  for (const fs::path& person : labelled_folders(dataset, "sub-", choice.participants)) {
    const std::string name = person.filename().string();
    const std::size_t before = subjects.size();
    const auto add = [&](const std::string& visit, const fs::path& anat) {
      require_own_images(anat, name, visit);
      subjects.push_back(make_subject(visit, anat));
    };
    if (choice.sessions.empty() && is_folder(person / "anat")) add(name, person / "anat");
    for (const fs::path& session : labelled_folders(person, "ses-", choice.sessions)) {
      if (!is_folder(session / "anat")) continue;
      add(name + "_" + session.filename().string(), session / "anat");
      sessions_seen.insert(session.filename().string().substr(4));
    }
    if (!choice.participants.empty() && subjects.size() == before)
      spdlog::warn("{} has no images in anat{}", name, choice.sessions.empty() ? "" : " of these sessions");
  }
  for (const std::string& label : choice.sessions)
    if (sessions_seen.count(label) == 0)
      throw input_error(fmt::format("{}: nobody has a session \"ses-{}\" with anat", dataset.string(), label),
                        "name folders ses-* of the dataset");
  return subjects;
}

std::vector<Subject> of_folder(const fs::path& studies) {
  std::vector<Subject> subjects;
  for (const fs::path& study : folders_in(studies))
    subjects.push_back(make_subject(study.filename().string(), study));
  return subjects;
}

std::vector<Subject> of_table(const fs::path& file, const Table& table) {
  std::vector<Subject> subjects;
  std::map<fs::path, std::string> whose;
  for (std::size_t row = 0; row < table.rows.size(); ++row) {
    const std::string named = table.cell(row, "study");
    const fs::path study = file.parent_path() / named;
    if (named.empty() || !is_folder(study))
      throw input_error(table.place(row, "study") + ": \"" + named + "\" is no folder",
                        "give the study's folder as a path from the table");
    subjects.push_back(make_subject(table.cell(row, id_column), study));
    const auto [other, is_new] = whose.emplace(fs::weakly_canonical(study), subjects.back().id);
    if (!is_new)
      throw input_error(fmt::format("{}: \"{}\" is the study of \"{}\" already", table.place(row, "study"),
                                    named, other->second),
                        "give each participant a study of its own");
  }
  return subjects;
}

void require_distinct(const std::vector<Subject>& subjects) {
  for (std::size_t i = 1; i < subjects.size(); ++i)
    if (subjects[i].id == subjects[i - 1].id)
      throw input_error(fmt::format("two studies have the name \"{}\": {} and {}", subjects[i].id,
                                    subjects[i - 1].study.string(), subjects[i].study.string()),
                        "rename one; characters other than letters, digits, '-', '_' and '.' become '_'");
  std::map<fs::path, std::string> whose;
  for (const Subject& subject : subjects) {
    const auto [other, is_new] = whose.emplace(fs::canonical(subject.study), subject.id);
    if (!is_new)
      throw input_error(
          fmt::format("{} is the study of \"{}\" already", subject.study.string(), other->second),
          "give each participant a study of its own: remove the link");
  }
}

}  // namespace

Json to_json(const Subject& subject) {
  return {{"study", subject.study.string()},
          {"age", subject.age},
          {"sex", subject.sex},
          {"options", subject.options},
          {"fingerprint", subject.fingerprint},
          {"version", version()}};  // another version measures anew
}

Subject read_subject(const fs::path& file, const std::string& id) {
  const Json json = read_json(file);
  try {
    return {id,
            json.at("study").get<std::string>(),
            json.at("options").get<std::map<std::string, std::vector<std::string>>>(),
            json.at("fingerprint"),
            json.value("age", std::string()),
            json.value("sex", std::string())};
  } catch (const Json::exception& fault) {
    throw input_error(file.string() + ": " + fault.what(), "run emmetrope cohort again: it writes this file");
  }
}

void require_bids(const fs::path& dataset) {
  if (!fs::exists(dataset / "dataset_description.json"))
    throw input_error(dataset.string() + " is no BIDS dataset: it has no dataset_description.json",
                      "name the folder that holds dataset_description.json and the folders sub-*");
}

std::vector<Subject> find_subjects(const fs::path& studies, const BidsChoice& choice) {
  std::vector<Subject> subjects;
  if (studies.extension() == ".tsv") {
    const Table table = read_table(studies, {id_column, "study"});
    require_distinct_rows(table, false);
    subjects = of_table(studies, table);
    add_readings(subjects, table, false, true);
  } else if (fs::is_directory(studies)) {
    const bool bids = fs::exists(studies / "dataset_description.json");
    subjects = bids ? of_bids(studies, choice) : of_folder(studies);
    const bool all_are_here = choice.participants.empty() && choice.sessions.empty();
    if (const fs::path file = studies / "participants.tsv"; fs::exists(file))
      add_readings(subjects, read_table(file, {id_column}), bids, all_are_here);
    if (bids) add_ages_of_sessions(subjects, studies);
  } else {
    throw input_error(studies.string() + " is neither a folder nor a .tsv table",
                      "name a folder of studies, a BIDS dataset or a participants.tsv");
  }
  add_ages_to_options(subjects);
  if (subjects.empty())
    throw input_error("no study in " + studies.string(),
                      "expected folders of images, or sub-*/[ses-*/]anat beside dataset_description.json");
  std::sort(subjects.begin(), subjects.end(), [](const auto& a, const auto& b) { return a.id < b.id; });
  require_distinct(subjects);
  return subjects;
}

}  // namespace emmetrope::cohort
