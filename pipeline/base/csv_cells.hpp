#pragma once
#include <string>
#include <vector>

namespace emmetrope {

/// The cells of a line of a table as spreadsheets write it: between commas, semicolons or tabulators, without quotation
/// marks, and without spaces and carriage returns at their ends.
inline std::vector<std::string> csv_cells(const std::string& line) {
  std::vector<std::string> cells(1);
  for (const char c : line) {
    if (c == ',' || c == ';' || c == '\t')
      cells.emplace_back();
    else if (c != '"')
      cells.back() += c;
  }
  for (std::string& cell : cells) {
    const std::size_t first = cell.find_first_not_of(" \r"), last = cell.find_last_not_of(" \r");
    cell = first == std::string::npos ? "" : cell.substr(first, last - first + 1);
  }
  return cells;
}

/// A text's first line may begin with UTF-8's mark, as spreadsheets write it.
inline std::string without_byte_order_mark(std::string line) {
  if (line.rfind("\xEF\xBB\xBF", 0) == 0) line.erase(0, 3);
  return line;
}

}  // namespace emmetrope
