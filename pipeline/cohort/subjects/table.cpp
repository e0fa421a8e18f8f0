#include "pipeline/cohort/subjects/table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <sstream>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"

namespace emmetrope::cohort {
namespace {

std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> cells(1);
  for (const char c : line) {
    if (c == '\t')
      cells.emplace_back();
    else if (c != '\r')
      cells.back() += c;
  }
  return cells;
}

}  // namespace

std::string one_line(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](char c) { return c == '\t' || c == '\n' || c == '\r'; }, ' ');
  return text;
}

std::string cell_text(const std::string& text) { return text.empty() ? not_available : one_line(text); }

std::string Table::cell(std::size_t row, const std::string& column) const {
  const auto found = columns.find(column);
  if (found == columns.end()) return {};
  const std::string& text = rows.at(row).at(found->second);
  return text == not_available ? "" : text;
}

std::string Table::place(std::size_t row, const std::string& column) const {
  return fmt::format("{}: line {}, column {}", file.string(), lines.at(row), column);
}

Table read_table(const std::filesystem::path& file, const std::vector<std::string>& required) {
  std::istringstream lines(read_file(file));
  std::string line;
  std::getline(lines, line);
  if (line.rfind("\xEF\xBB\xBF", 0) == 0) line.erase(0, 3);
  Table table;
  table.file = file;
  const std::vector<std::string> names = cells_of(line);
  for (std::size_t i = 0; i < names.size(); ++i)
    if (!table.columns.emplace(names[i], i).second)
      throw input_error(fmt::format("{}: two columns are called \"{}\"", file.string(), names[i]));
  for (const std::string& name : required)
    if (table.columns.count(name) == 0)
      throw input_error(fmt::format("{}: the column \"{}\" is missing", file.string(), name),
                        "the first line names the columns, separated by tabs");
  for (std::size_t number = 2; std::getline(lines, line); ++number) {
    if (line.empty() || line == "\r") continue;
    std::vector<std::string> cells = cells_of(line);
    if (cells.size() != names.size())
      throw input_error(fmt::format("{}: line {} has {} cells, the header {}", file.string(), number,
                                    cells.size(), names.size()),
                        "separate cells by one tab, and write n/a where there is nothing");
    table.rows.push_back(std::move(cells));
    table.lines.push_back(number);
  }
  return table;
}

}  // namespace emmetrope::cohort
