#pragma once
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace emmetrope::cohort {

/// A cell that says nothing, as BIDS has it.
inline constexpr const char* not_available = "n/a";

/// Without tabs and line ends, which no cell has.
std::string one_line(std::string text);
/// The same, "n/a" where it is empty.
std::string cell_text(const std::string& text);

/// A table of tab-separated values with a header, as BIDS has them.
struct Table {
  std::map<std::string, std::size_t> columns;
  std::vector<std::vector<std::string>> rows;
  std::vector<std::size_t> lines;  ///< of each row in the file, from 1
  std::filesystem::path file;

  /// Empty where the column is not there or the cell is "n/a".
  std::string cell(std::size_t row, const std::string& column) const;
  /// "people.tsv: line 3, column age"
  std::string place(std::size_t row, const std::string& column) const;
};

/// \throw Error (input_invalid) naming file and line where a column of `required` is missing or a row has not as many
///   cells as the header
Table read_table(const std::filesystem::path& file, const std::vector<std::string>& required);

}  // namespace emmetrope::cohort
