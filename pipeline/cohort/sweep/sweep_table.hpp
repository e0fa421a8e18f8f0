#pragma once
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace emmetrope::cohort {

/// One setting of a parameter study: an option and what it is given.
struct Setting {
  std::string option;              ///< without dashes: "pupil"
  std::string text;                ///< as the table of results has it: "3.5"
  std::vector<std::string> words;  ///< for the command: {"--pupil", "3.5"}
};

/// A parameter study: one command, what all its runs share, and every combination of what varies.
struct Sweep {
  std::string command;         ///< "trace", "correct" or "eye"
  std::vector<Setting> fixed;  ///< of all runs
  /// Of each run, in the order of the file; the last option varies fastest.
  std::vector<std::vector<Setting>> runs;
  /// Column of the table of results, and JSON pointer into the command's result: what is not there by itself.
  std::vector<std::pair<std::string, std::string>> columns;
};

/// Reads a TOML file:
///
///     command = "trace"
///     [all]                     # options without their dashes; true is a flag, a list an option's several words
///     rays = 64
///     [vary]                    # every combination
///     eye = ["navarro", "my.json"]
///     pupil = [2, 4, 6]
///     [columns]                 # optional
///     coma_um = "/zernike_um/8"
///
/// A text that names a file from the table's folder is that file.
/// \throw Error (input_invalid) naming file, line and key
Sweep read_sweep(const std::filesystem::path& file);

}  // namespace emmetrope::cohort
