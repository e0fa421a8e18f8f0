#pragma once
#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "pipeline/base/json.hpp"

namespace emmetrope::cohort {

/// One visit of one person: images, and what else is known of the eyes.
struct Subject {
  std::string id;               ///< letters, digits, '-', '_', '.' and '+': names of folders and rows
  std::filesystem::path study;  ///< absolute; a folder of images
  /// Options by the command that they are for: {"mesh": ["--axial-length", "od:23.6"]}.
  std::map<std::string, std::vector<std::string>> options;
  /// Of the study's files, their sizes and last changes: another study under the same name is another subject.
  Json fingerprint;
  std::string age = {};  ///< years, as the table of sessions or of participants has it; empty: not said
  std::string sex = {};  ///< "M", "F" or "O", as the table of participants has it; empty: not said
};
Json to_json(const Subject& subject);
/// \throw Error (input_invalid) naming the file
Subject read_subject(const std::filesystem::path& file, const std::string& id);

/// Of a BIDS dataset: whose images; empty: everybody's, all.
struct BidsChoice {
  std::set<std::string> participants, sessions;  ///< labels without "sub-" and "ses-"
};

/// \throw Error (input_invalid) where the folder is not a BIDS dataset
void require_bids(const std::filesystem::path& dataset);

/// What is in STUDIES, sorted by id:
/// - a BIDS dataset (dataset_description.json): sub-X[/ses-Y]/anat as "sub-X" or "sub-X_ses-Y",
/// - a folder: each folder in it is a study, named by it,
/// - a table (.tsv) with columns `participant_id` and `study`, a path from the table's folder.
/// A `participants.tsv` in the folder, or the table itself, may have `age`, `sex`, and for each eye (`_od`, `_os`)
/// `keratometry`, `axial_length`, `acd`, `lens_thickness` and `refraction`, written as the options of `emmetrope run`
/// without the eye ("43.25@175/44.75@85+-0.25"); "n/a" and an empty cell say nothing. In a BIDS dataset the `age` of a
/// session in sub-X/sub-X_sessions.tsv stands before that of the person.
/// \throw Error (input_invalid) naming file, line and column, or a label of `choice` that nobody has
std::vector<Subject> find_subjects(const std::filesystem::path& studies, const BidsChoice& choice = {});

}  // namespace emmetrope::cohort
