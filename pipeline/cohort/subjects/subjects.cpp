#include "pipeline/cohort/subjects/subjects.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <chrono>
#include <fstream>
#include <set>
#include <sstream>

#include "pipeline/base/clean_text.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/laterality.hpp"
#include "pipeline/base/log.hpp"
#include "pipeline/base/version.hpp"
#include "pipeline/cohort/subjects/table.hpp"

namespace emmetrope::cohort {
namespace {

namespace fs = std::filesystem;

constexpr const char* id_column = "participant_id";

/// A reading that a table may hold for each eye, and the command that takes it.
struct Reading {
  const char* column;
  const char* option;
  const char* command;
};
constexpr Reading readings[] = {{"keratometry", "--keratometry", "mesh"},
                                {"axial_length", "--axial-length", "mesh"},
                                {"acd", "--acd", "mesh"},
                                {"lens_thickness", "--lens-thickness", "mesh"},
                                {"refraction", "--refraction", "correct"}};

bool is_plain(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '-' || c == '_' || c == '.';
}

/// A name that is one of a folder everywhere.
std::string plain_name(std::string name) {
  std::replace_if(
      name.begin(), name.end(), [](char c) { return !is_plain(c); }, '_');
  return name.empty() || name.front() == '.' || name.front() == '-' ? "_" + name : name;
}

/// What cannot be read is left out: the study's own reader tells of it.
Json fingerprint_of(const fs::path& study) {
  std::size_t files = 0;
  std::uintmax_t bytes = 0;
  fs::file_time_type last = fs::file_time_type::min();
  std::error_code unreadable;
  fs::recursive_directory_iterator entry(study, fs::directory_options::skip_permission_denied, unreadable);
  for (; !unreadable && entry != fs::recursive_directory_iterator(); entry.increment(unreadable)) {
    std::error_code gone;
    if (!entry->is_regular_file(gone)) continue;
    ++files;
    bytes += entry->file_size(gone);
    last = std::max(last, entry->last_write_time(gone));
  }
  return {{"files", files},
          {"bytes", bytes},
          {"last_change", std::chrono::duration_cast<std::chrono::seconds>(last.time_since_epoch()).count()}};
}

Subject make_subject(const std::string& name, const fs::path& study) {
  if (clean_utf8(study.string()) != study.string())
    throw input_error("the name of the folder " + clean_utf8(study.string()) + " is not UTF-8", "rename it");
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

std::vector<Subject> of_bids(const fs::path& dataset) {
  std::vector<Subject> subjects;
  for (const fs::path& person : folders_in(dataset)) {
    if (!starts_with(person, "sub-")) continue;
    const std::string name = person.filename().string();
    if (is_folder(person / "anat")) subjects.push_back(make_subject(name, person / "anat"));
    for (const fs::path& session : folders_in(person))
      if (starts_with(session, "ses-") && is_folder(session / "anat"))
        subjects.push_back(make_subject(name + "_" + session.filename().string(), session / "anat"));
  }
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
  for (std::size_t row = 0; row < table.rows.size(); ++row) {
    const std::string named = table.cell(row, "study");
    const fs::path study = file.parent_path() / named;
    if (named.empty() || !is_folder(study))
      throw input_error(table.place(row, "study") + ": \"" + named + "\" is no folder",
                        "give the study's folder as a path from the table");
    subjects.push_back(make_subject(table.cell(row, id_column), study));
  }
  return subjects;
}

/// A row of a person of a BIDS dataset, written with or without "sub-", holds for each of the person's sessions.
bool is_of(const Subject& subject, const std::string& participant, bool bids) {
  if (!bids) return subject.id == plain_name(participant);
  const std::string name = participant.rfind("sub-", 0) == 0 ? participant : "sub-" + participant;
  return subject.id == name || subject.id.rfind(name + "_ses-", 0) == 0;
}

void require_distinct_rows(const Table& table) {
  std::set<std::string> seen;
  for (std::size_t row = 0; row < table.rows.size(); ++row) {
    const std::string participant = table.cell(row, id_column);
    if (participant.empty()) throw input_error(table.place(row, id_column) + ": names nobody");
    if (!seen.insert(participant).second)
      throw input_error(table.place(row, id_column) + ": \"" + participant + "\" has a row already",
                        "give each participant one row");
  }
}

void add_readings(std::vector<Subject>& subjects, const Table& table, bool bids) {
  require_distinct_rows(table);
  for (std::size_t row = 0; row < table.rows.size(); ++row) {
    bool is_known = false;
    for (Subject& subject : subjects) {
      if (!is_of(subject, table.cell(row, id_column), bids)) continue;
      is_known = true;
      if (const std::string age = table.cell(row, "age"); !age.empty())
        for (const char* command : {"segment", "trace", "correct"})
          subject.options[command].insert(subject.options[command].end(), {"--age", age});
      for (const Reading& reading : readings)
        for (const Laterality eye : both_eyes)
          if (const std::string value = table.cell(row, fmt::format("{}_{}", reading.column, to_string(eye)));
              !value.empty())
            subject.options[reading.command].insert(
                subject.options[reading.command].end(),
                {reading.option, fmt::format("{}:{}", to_string(eye), value)});
    }
    if (!is_known)
      spdlog::warn("{}: there is no study of \"{}\"", table.place(row, id_column),
                   table.cell(row, id_column));
  }
}

void require_distinct(const std::vector<Subject>& subjects) {
  for (std::size_t i = 1; i < subjects.size(); ++i)
    if (subjects[i].id == subjects[i - 1].id)
      throw input_error(fmt::format("two studies have the name \"{}\": {} and {}", subjects[i].id,
                                    subjects[i - 1].study.string(), subjects[i].study.string()),
                        "rename one; characters other than letters, digits, '-', '_' and '.' become '_'");
}

}  // namespace

Json to_json(const Subject& subject) {
  return {{"study", subject.study.string()},
          {"options", subject.options},
          {"fingerprint", subject.fingerprint},
          {"version", version()}};  // another version measures anew
}

Subject read_subject(const fs::path& file, const std::string& id) {
  const Json json = read_json(file);
  try {
    return {id, json.at("study").get<std::string>(),
            json.at("options").get<std::map<std::string, std::vector<std::string>>>(),
            json.at("fingerprint")};
  } catch (const Json::exception& fault) {
    throw input_error(file.string() + ": " + fault.what(), "run emmetrope cohort again: it writes this file");
  }
}

std::vector<Subject> find_subjects(const fs::path& studies) {
  std::vector<Subject> subjects;
  if (studies.extension() == ".tsv") {
    const Table table = read_table(studies, {id_column, "study"});
    require_distinct_rows(table);
    subjects = of_table(studies, table);
    add_readings(subjects, table, false);
  } else if (fs::is_directory(studies)) {
    const bool bids = fs::exists(studies / "dataset_description.json");
    subjects = bids ? of_bids(studies) : of_folder(studies);
    if (const fs::path file = studies / "participants.tsv"; fs::exists(file))
      add_readings(subjects, read_table(file, {id_column}), bids);
  } else {
    throw input_error(studies.string() + " is neither a folder nor a .tsv table",
                      "name a folder of studies, a BIDS dataset or a participants.tsv");
  }
  if (subjects.empty())
    throw input_error("no study in " + studies.string(),
                      "expected folders of images, or sub-*/[ses-*/]anat beside dataset_description.json");
  std::sort(subjects.begin(), subjects.end(), [](const auto& a, const auto& b) { return a.id < b.id; });
  require_distinct(subjects);
  return subjects;
}

}  // namespace emmetrope::cohort
