#include "pipeline/cohort/subjects/readings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <map>
#include <regex>
#include <set>

#include "pipeline/base/error.hpp"
#include "pipeline/base/json.hpp"
#include "pipeline/base/laterality.hpp"
#include "pipeline/base/log.hpp"
#include "pipeline/base/notation.hpp"
#include "pipeline/base/typed_number.hpp"
#include "pipeline/eye/instruments/instruments.hpp"
#include "pipeline/eye/population/limits.hpp"

namespace emmetrope::cohort {
namespace {

constexpr const char* session_column = "session_id";

/// A reading that a table may hold for each eye, and the command that takes it.
struct Reading {
  const char* column;
  const char* option;
  const char* command;
  std::vector<std::string> InstrumentFlags::*flag;  ///< a refraction has none
};
const Reading readings[] = {{"keratometry", "--keratometry", "mesh", &InstrumentFlags::keratometry},
                            {"axial_length", "--axial-length", "mesh", &InstrumentFlags::axial_length},
                            {"acd", "--acd", "mesh", &InstrumentFlags::anterior_chamber_depth},
                            {"lens_thickness", "--lens-thickness", "mesh", &InstrumentFlags::lens_thickness},
                            {"refraction", "--refraction", "correct", nullptr}};

bool is_plain(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '-' || c == '_' || c == '.' || c == '+';
}

/// Who a row of the table speaks of, as subjects are called by person_of; of a BIDS dataset with or without "sub-".
std::string person_named(const std::string& participant, bool bids) {
  if (!bids) return plain_name(participant);
  return plain_name(participant.rfind("sub-", 0) == 0 ? participant : "sub-" + participant);
}

/// A row of a person of a BIDS dataset holds for each of the person's sessions.
std::string person_of(const Subject& subject, bool bids) {
  return bids ? subject.id.substr(0, subject.id.find("_ses-")) : subject.id;
}

/// The unit of a table's ages.
struct AgeUnit {
  const char* name = "years";
  double years = 1;
};

/// A unit as people write it: "Year(s)", "[months]", " yrs old"; nothing where none is named.
std::optional<AgeUnit> unit_named(const std::string& text, const std::string& place) {
  std::string letters;
  for (const char c : text)
    if (std::isalpha(static_cast<unsigned char>(c)) != 0)
      letters += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  if (letters.empty() || letters == "na") return {};
  struct Named {
    AgeUnit unit;
    std::set<std::string> abbreviations;
    std::vector<const char*> words;
  };
  static const std::vector<Named> units{{{}, {"y", "a", "yo"}, {"year", "yr"}},
                                        {{"months", 1.0 / 12}, {"mo", "mos", "mth", "mths"}, {"month"}},
                                        {{"weeks", 7 / 365.25}, {"w"}, {"week", "wk"}},
                                        {{"days", 1 / 365.25}, {"d"}, {"day"}}};
  std::vector<AgeUnit> named;
  for (const Named& one : units)
    if (one.abbreviations.count(letters) > 0 ||
        std::any_of(one.words.begin(), one.words.end(),
                    [&](const char* word) { return letters.find(word) != std::string::npos; }))
      named.push_back(one.unit);
  if (named.size() == 1) return named.front();
  throw input_error(fmt::format("{}: the ages' Units are \"{}\"", place, text),
                    "year, month, week and day are read");
}

/// What a table's sidecar says of its column of ages (BIDS: JSON of the table's name; inherited by tables of sessions).
/// \param sidecars  the nearest first
AgeUnit age_unit(const Table& table, const std::vector<std::filesystem::path>& sidecars) {
  if (table.columns.count("age") == 0) return {};
  for (const std::filesystem::path& sidecar : sidecars) {
    if (!std::filesystem::exists(sidecar)) continue;
    Json told;
    try {
      told = read_json(sidecar);
    } catch (const Error& error) {
      spdlog::warn("{}; ages are taken for years", error.what());
      continue;
    }
    const Json column = told.is_object() ? told.value("age", Json()) : Json();
    Json units = column.is_object() ? column.value("Units", Json()) : Json();
    if (units.is_array() && units.size() == 1) units = Json(units[0]);
    if (units.is_null()) continue;
    if (const auto unit =
            unit_named(units.is_string() ? units.get<std::string>() : units.dump(), sidecar.string()))
      return *unit;
  }
  return {};
}

std::filesystem::path sidecar_of(const std::filesystem::path& table) {
  return std::filesystem::path(table).replace_extension(".json");
}

/// Years; BIDS has "89+" for all who are older.
std::string age_in(const Table& table, std::size_t row, const AgeUnit& unit) {
  std::string age = table.cell(row, "age");
  if (!age.empty() && age.back() == '+') age.pop_back();
  if (age.empty()) return age;
  const auto number = typed_number(age);
  if (!number || !human_age_years.contains(*number * unit.years))
    throw input_error(fmt::format("{}: \"{}\" is no age", table.place(row, "age"), table.cell(row, "age")),
                      fmt::format("{} from {:g} to {:g}, or n/a", unit.name, human_age_years.low / unit.years,
                                  human_age_years.high / unit.years));
  return unit.years == 1 ? age : fmt::format("{:.6g}", *number * unit.years);
}

/// "M", "F" or "O", as DICOM has it, of a letter or the word, as BIDS has them; empty of all else.
std::string sex_in(const Table& table, std::size_t row) {
  std::string sex = table.cell(row, "sex");
  for (char& c : sex) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  for (const auto& [letter, word] : {std::pair("m", "male"), {"f", "female"}, {"o", "other"}})
    if (sex == letter || sex == word) return std::string(1, static_cast<char>(std::toupper(*letter)));
  return {};
}

/// Years, and where they stand.
struct SaidAge {
  std::string years;  ///< empty: not said
  std::string place = {};
};

/// Of a visit "sub-X_ses-Y" in sub-X/sub-X_sessions.tsv.
SaidAge age_at_session(const std::filesystem::path& dataset, const std::string& visit) {
  const std::string person = visit.substr(0, visit.find("_ses-"));
  const std::filesystem::path file = dataset / person / (person + "_sessions.tsv");
  if (person == visit || !std::filesystem::exists(file)) return {};
  const Table table = read_table(file, {session_column});
  const AgeUnit unit = age_unit(table, {sidecar_of(file), dataset / "sessions.json"});
  SaidAge said;
  for (std::size_t row = 0; row < table.rows.size(); ++row) {
    if (person + "_" + table.cell(row, session_column) != visit) continue;
    if (!said.place.empty())
      throw input_error(table.place(row, session_column) + ": the session has a row already",
                        "give each one row");
    said = {age_in(table, row, unit), table.place(row, "age")};
  }
  return said;
}

/// Whether a column is called nearly as one that is read: it would be passed over. "Age", "Axial length OD (mm)"
bool is_nearly_known(const std::string& column) {
  for (const char* known : {id_column, "study", "age", "sex"})
    if (column == known) return false;
  for (const Reading& reading : readings)
    for (const Laterality eye : both_eyes)
      if (column == fmt::format("{}_{}", reading.column, to_string(eye))) return false;
  std::string plain;
  for (const char c : column)
    if (std::isalnum(static_cast<unsigned char>(c)) != 0)
      plain += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  static const std::regex known(
      "participantid|study|age(years)?|sex|"
      "(od|os|right|left|re|le)?(keratometry|axiallength|acd|anteriorchamberdepth|lensthickness|refraction)"
      "(mm|d)?(od|os|right|left|re|le|r|l)?(mm|d)?");
  return std::regex_match(plain, known);
}

/// In a table of our own such a column is a slip; that of a BIDS dataset is its owner's.
void require_known_columns(const Table& table, bool bids) {
  for (const auto& [column, place] : table.columns) {
    if (!is_nearly_known(column)) continue;
    const std::string what = fmt::format("{}: the column \"{}\" is called nearly as one that is read",
                                         table.file.string(), column);
    if (!bids)
      throw input_error(
          what,
          "what is read is called participant_id, study, age, sex, keratometry_od, axial_length_od, acd_od, "
          "lens_thickness_od, refraction_od, and the same with _os");
    spdlog::warn("{}", what);
  }
}

/// As the stages will read it.
void require_reading(const Reading& reading, const std::string& text, const std::string& place) {
  try {
    InstrumentFlags flags;
    if (reading.flag == nullptr) {
      parse_eye_refraction(text);
    } else {
      flags.*reading.flag = {text};
      parse_instruments(flags, 0);
    }
  } catch (const Error& error) {
    throw input_error(fmt::format("{}: {}", place, error.what()), error.remedy());
  }
}

/// What a row says is put into a subject and its options.
void add_readings_of_row(Subject& subject, const Table& table, std::size_t row, const AgeUnit& unit) {
  const auto add = [&](const char* command, const char* option, const std::string& value) {
    std::vector<std::string>& words = subject.options[command];
    words.insert(words.end(), {option, value});
  };
  subject.age = age_in(table, row, unit);
  subject.sex = sex_in(table, row);
  for (const Reading& reading : readings)
    for (const Laterality eye : both_eyes)
      if (const std::string column = fmt::format("{}_{}", reading.column, to_string(eye)),
          value = table.cell(row, column);
          !value.empty()) {
        const std::string text = fmt::format("{}:{}", to_string(eye), value);
        require_reading(reading, text, table.place(row, column));
        add(reading.command, reading.option, text);
      }
}

/// The row of each person.
std::map<std::string, std::size_t> rows_of_persons(const Table& table, bool bids) {
  std::map<std::string, std::size_t> row_of;
  for (std::size_t row = 0; row < table.rows.size(); ++row)
    row_of.emplace(person_named(table.cell(row, id_column), bids), row);
  return row_of;
}

}  // namespace

std::string plain_name(std::string name) {
  std::replace_if(
      name.begin(), name.end(), [](char c) { return !is_plain(c); }, '_');
  // A file that is hidden, an option, a spreadsheet's formula.
  const bool begins_ill = name.empty() || std::string(".-+").find(name.front()) != std::string::npos;
  return begins_ill ? "_" + name : name;
}

void require_distinct_rows(const Table& table, bool bids) {
  std::set<std::string> seen;
  for (std::size_t row = 0; row < table.rows.size(); ++row) {
    const std::string participant = table.cell(row, id_column);
    if (participant.empty()) throw input_error(table.place(row, id_column) + ": names nobody");
    if (!seen.insert(person_named(participant, bids)).second)
      throw input_error(table.place(row, id_column) + ": \"" + participant + "\" has a row already",
                        "give each participant one row");
  }
}

void add_readings(std::vector<Subject>& subjects, const Table& table, bool bids, bool all_are_here) {
  require_distinct_rows(table, bids);
  require_known_columns(table, bids);
  const AgeUnit unit = age_unit(table, {sidecar_of(table.file)});
  std::map<std::string, std::vector<Subject*>> of_person;
  for (Subject& subject : subjects) of_person[person_of(subject, bids)].push_back(&subject);
  for (std::size_t row = 0; row < table.rows.size(); ++row) {
    const std::string participant = table.cell(row, id_column);
    const auto found = of_person.find(person_named(participant, bids));
    if (found == of_person.end()) {
      if (all_are_here)
        spdlog::warn("{}: there is no study of \"{}\"", table.place(row, id_column), participant);
      continue;
    }
    if (const std::string sex = table.cell(row, "sex"); !sex.empty() && sex_in(table, row).empty())
      spdlog::warn("{}: \"{}\" is none of M, F, O, male, female, other and n/a: no sex is taken from it",
                   table.place(row, "sex"), sex);
    for (Subject* subject : found->second) add_readings_of_row(*subject, table, row, unit);
  }
}

void add_ages_of_sessions(std::vector<Subject>& subjects, const std::filesystem::path& dataset) {
  for (Subject& subject : subjects)
    if (const SaidAge said = age_at_session(dataset, subject.id); !said.years.empty())
      subject.age = said.years;
}

void add_ages_to_options(std::vector<Subject>& subjects) {
  for (Subject& subject : subjects) {
    if (subject.age.empty()) continue;
    for (const char* command : {"segment", "trace", "correct"}) {
      std::vector<std::string>& words = subject.options[command];
      words.insert(words.begin(), {"--age", subject.age});
    }
  }
}

std::vector<std::string> contradictions(const std::vector<Subject>& subjects, const Table& table) {
  const std::map<std::string, std::size_t> row_of = rows_of_persons(table, true);
  const std::filesystem::path dataset = table.file.parent_path();
  const AgeUnit unit = age_unit(table, {sidecar_of(table.file)});
  std::vector<std::string> sentences;
  for (const Subject& subject : subjects) {
    const auto found = row_of.find(person_of(subject, true));
    if (found == row_of.end()) {
      sentences.push_back(fmt::format("{}: {} has no row in it", table.file.string(), subject.id));
      continue;
    }
    SaidAge said = age_at_session(dataset, subject.id);
    if (said.years.empty()) said = {age_in(table, found->second, unit), table.place(found->second, "age")};
    // The tables of sessions lie among the images, which may have been taken away.
    const std::string person = person_of(subject, true);
    const bool may_be_the_sessions = person != subject.id && !std::filesystem::exists(dataset / person);
    if (typed_number(said.years) != typed_number(subject.age) && !may_be_the_sessions)
      sentences.push_back(
          fmt::format("{}: \"{}\"; {} was measured as of \"{}\" years: run its participant level again",
                      said.place, said.years, subject.id, subject.age));
    if (const std::string sex = sex_in(table, found->second); sex != subject.sex)
      sentences.push_back(fmt::format(
          "{}: \"{}\"; {} was measured as of sex \"{}\": run its participant level again",
          table.place(found->second, "sex"), table.cell(found->second, "sex"), subject.id, subject.sex));
  }
  return sentences;
}

}  // namespace emmetrope::cohort
