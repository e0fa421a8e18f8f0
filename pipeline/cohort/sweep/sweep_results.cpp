#include "pipeline/cohort/sweep/sweep_results.hpp"
#include "pipeline/cohort/subjects/table.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>

#include "pipeline/base/error.hpp"

namespace emmetrope::cohort {
namespace {

using Cells =
    std::vector<std::pair<std::string, std::string>>;  // column and text, in the order of the result

std::string number_text(const Json& value) {
  if (value.is_boolean()) return value.get<bool>() ? "true" : "false";
  return fmt::format("{:.9g}", value.get<double>());
}

bool is_number(const Json& value) { return value.is_number() || value.is_boolean(); }

void add_numbers(const Json& json, const std::string& prefix, Cells& cells) {
  for (const auto& [key, value] : json.items()) {
    const std::string column = prefix + key;
    if (is_number(value)) {
      if (column != "status") cells.emplace_back(column, number_text(value));
    } else if (value.is_object() && value.contains("value") && is_number(value.at("value"))) {
      cells.emplace_back(column, number_text(value.at("value")));
      if (!value.contains("ci95")) continue;
      cells.emplace_back(column + "_low", number_text(value.at("ci95").at(0)));
      cells.emplace_back(column + "_high", number_text(value.at("ci95").at(1)));
    } else if (value.is_object()) {
      add_numbers(value, column + "_", cells);
    }
  }
}

/// What is asked for by pointer.
/// \param there  cells that the row has already
/// \param faults  by column, of what cannot be a cell
Cells asked_for(const Sweep& sweep, const Json& result, const Cells& there,
                std::map<std::string, std::string>& faults) {
  Cells cells;
  for (const auto& [column, pointer] : sweep.columns) {
    const Json::json_pointer at(pointer);
    if (!result.contains(at)) continue;
    const Json& value = result.at(at);
    if (std::any_of(there.begin(), there.end(),
                    [&, &name = column](const auto& cell) { return cell.first == name; }))
      faults[column] = "the table has that column already, give it another name";
    else if (value.is_object())
      faults[column] = pointer + " is an object, point to one of its values";
    else
      cells.emplace_back(column, is_number(value)    ? number_text(value)
                                 : value.is_string() ? cell_text(value.get<std::string>())
                                                     : cell_text(value.dump()));
  }
  return cells;
}

}  // namespace

SweepResults sweep_table(const Sweep& sweep, const SweepFolder& folder,
                         const std::vector<std::string>& names) {
  std::vector<std::string> columns;
  std::vector<std::map<std::string, std::string>> rows;
  std::map<std::string, std::string> faults;
  bool any_result = false;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const Json end = read_json(folder.end(names[i]));
    try {
      Cells cells{{"run", names[i]},
                  {"status", std::to_string(end.at("status").get<int>())},
                  {"message", cell_text(end.at("message").get<std::string>())}};
      for (const Setting& setting : sweep.runs[i]) cells.emplace_back(setting.option, setting.text);
      const std::size_t given = cells.size();
      if (const Json& result = end.at("result"); result.is_object()) {
        any_result = true;
        add_numbers(result, "", cells);
        const Cells asked = asked_for(sweep, result, cells, faults);
        cells.insert(cells.end(), asked.begin(), asked.end());
      }
      std::map<std::string, std::string> row;
      for (std::size_t c = 0; c < cells.size(); ++c) {
        // A result that is called as a setting is.
        std::string column = cells[c].first;
        if (c >= given && row.count(column) > 0) column += "_result";
        if (std::find(columns.begin(), columns.end(), column) == columns.end()) columns.push_back(column);
        row[column] = cells[c].second;
      }
      rows.push_back(std::move(row));
    } catch (const Json::exception& fault) {
      throw input_error(folder.end(names[i]).string() + ": " + fault.what(),
                        "remove it and run emmetrope sweep again");
    }
  }
  for (const auto& [column, pointer] : sweep.columns)
    if (any_result && std::find(columns.begin(), columns.end(), column) == columns.end())
      faults.emplace(column, "no result has " + pointer);
  SweepResults table;
  for (const auto& [column, fault] : faults)
    table.faults.push_back(fmt::format("[columns] {}: {}", column, fault));
  std::vector<std::string> header;
  for (const std::string& column : columns) header.push_back(cell_text(column));
  table.text = fmt::format("{}\n", fmt::join(header, "\t"));
  for (const auto& row : rows) {
    std::vector<std::string> cells;
    for (const std::string& column : columns) {
      const auto found = row.find(column);
      cells.push_back(found == row.end() ? not_available : cell_text(found->second));
    }
    table.text += fmt::format("{}\n", fmt::join(cells, "\t"));
  }
  return table;
}

}  // namespace emmetrope::cohort
