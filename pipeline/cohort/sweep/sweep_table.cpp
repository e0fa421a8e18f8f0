#include "pipeline/cohort/sweep/sweep_table.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <toml++/toml.h>
#include <algorithm>
#include <array>
#include <optional>
#include <set>
#include <string_view>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/json.hpp"

namespace emmetrope::cohort {
namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, 3> commands{"trace", "correct", "eye"};
/// What the runs themselves need.
constexpr std::array<std::string_view, 10> reserved{
    "output", "case", "json", "quiet", "force", "threads", "version", "help", "definition", "check-options"};
constexpr std::size_t most_runs = 100000;

std::string place(const fs::path& file, const toml::node& node, std::string_view key) {
  return fmt::format("{}: line {}, {}", file.string(), node.source().begin.line, key);
}

/// A number, a text or a truth value as a command line has it.
std::string word_of(const fs::path& file, const toml::node& node, std::string_view key) {
  if (const auto* text = node.as_string()) {
    const fs::path named = file.parent_path() / text->get();
    std::error_code unreadable;
    return !text->get().empty() && fs::is_regular_file(named, unreadable)
               ? fs::absolute(named).lexically_normal().string()
               : text->get();
  }
  if (const auto* number = node.as_integer()) return std::to_string(number->get());
  if (const auto* number = node.as_floating_point()) return fmt::format("{}", number->get());
  throw input_error(place(file, node, key) + ": expected a number, a text, true or false");
}

Setting setting_of(const fs::path& file, const toml::node& node, std::string_view key) {
  Setting setting{std::string(key), "", {}};
  const std::string flag = fmt::format("--{}", key);
  if (const auto* truth = node.as_boolean()) {
    setting.text = truth->get() ? "true" : "false";
    if (truth->get()) setting.words = {flag};
    return setting;
  }
  setting.words = {flag};
  if (const toml::array* several = node.as_array())
    for (const toml::node& one : *several) setting.words.push_back(word_of(file, one, key));
  else
    setting.words.push_back(word_of(file, node, key));
  setting.text = fmt::format("{}", fmt::join(setting.words.begin() + 1, setting.words.end(), " "));
  // A negative number after a space would be taken for an option.
  if (setting.words.size() == 2) setting.words = {flag + "=" + setting.words[1]};
  return setting;
}

void require_open(const fs::path& file, const toml::node& node, std::string_view key) {
  if (std::find(reserved.begin(), reserved.end(), key) != reserved.end())
    throw input_error(place(file, node, key) + ": the sweep sets this itself", "leave it out");
}

void require_once(const fs::path& file, const Sweep& sweep, const std::string& key, const toml::node& node) {
  if (std::any_of(sweep.fixed.begin(), sweep.fixed.end(),
                  [&](const Setting& setting) { return setting.option == key; }))
    throw input_error(place(file, node, key) + ": is in [all] too", "leave it in one of them");
}

/// \throw Error (input_invalid) where it is no JSON pointer
void require_pointer(const fs::path& file, const toml::node& node, const std::string& key,
                     const std::optional<std::string>& pointer) {
  try {
    if (pointer && !pointer->empty() && !Json::json_pointer(*pointer).empty()) return;
  } catch (const Json::exception&) {  // told below
  }
  throw input_error(place(file, node, key) + ": expected a JSON pointer", key + " = \"/zernike_um/8\"");
}

/// \throw Error (input_invalid) where the table has a column of that name by itself
void require_free(const fs::path& file, const toml::node& node, const std::string& key, const Sweep& sweep) {
  const std::vector<Setting>& varied = sweep.runs.front();
  if (key == "run" || key == "status" || key == "message" ||
      std::any_of(varied.begin(), varied.end(),
                  [&](const Setting& setting) { return setting.option == key; }))
    throw input_error(place(file, node, key) + ": the table has that column already", "give it another name");
}

const toml::table* table_in(const fs::path& file, const toml::table& root, std::string_view name) {
  const toml::node* node = root.get(name);
  if (node == nullptr) return nullptr;
  if (!node->is_table())
    throw input_error(place(file, *node, name) + ": expected a table [" + std::string(name) + "]");
  return node->as_table();
}

/// Keys in the order of the file; toml++ sorts them by name.
std::vector<std::pair<std::string, const toml::node*>> in_order(const toml::table& table) {
  std::vector<std::pair<std::string, const toml::node*>> entries;
  for (const auto& [key, node] : table) entries.emplace_back(std::string(key.str()), &node);
  std::sort(entries.begin(), entries.end(), [](const auto& a, const auto& b) {
    const auto &one = a.second->source().begin, &other = b.second->source().begin;
    return std::pair(one.line, one.column) < std::pair(other.line, other.column);
  });
  return entries;
}

void add_variation(const fs::path& file, Sweep& sweep, const std::string& key, const toml::node& node) {
  require_open(file, node, key);
  const toml::array* values = node.as_array();
  if (values == nullptr || values->empty())
    throw input_error(place(file, node, key) + ": expected a list of values", key + " = [1, 2, 3]");
  if (sweep.runs.size() * values->size() > most_runs)
    throw input_error(fmt::format("{}: more than {} combinations", place(file, node, key), most_runs));
  std::vector<Setting> settings;
  std::set<std::vector<std::string>> seen;
  for (const toml::node& value : *values) {
    settings.push_back(setting_of(file, value, key));
    if (!seen.insert(settings.back().words).second)
      throw input_error(fmt::format("{}: {} is there twice", place(file, value, key), settings.back().text),
                        "give each value once");
  }
  std::vector<std::vector<Setting>> runs;
  for (const std::vector<Setting>& run : sweep.runs)
    for (const Setting& setting : settings) {
      runs.push_back(run);
      runs.back().push_back(setting);
    }
  sweep.runs = std::move(runs);
}

std::string command_in(const fs::path& file, const toml::table& root) {
  const auto command = root["command"].value<std::string>();
  if (!command || std::find(commands.begin(), commands.end(), *command) == commands.end())
    throw input_error(fmt::format("{}: command is \"{}\"", file.string(), command.value_or("")),
                      fmt::format("write command = \"...\" with one of {}", fmt::join(commands, ", ")));
  return *command;
}

constexpr std::string_view byte_order_mark = "\xEF\xBB\xBF";

/// TOML has letters beyond ASCII in texts and comments alone; on some of them elsewhere toml++ 3.3 is undefined. Keys of
/// tens of thousands of parts (a.a.a...) it nests as deep, beyond the stack.
/// \throw Error (input_invalid) with the line
void require_readable(const fs::path& file, const std::string& toml) {
  const auto starts = [&](std::size_t at, std::string_view with) {
    return toml.compare(at, with.size(), with) == 0;
  };
  constexpr int most_parts_of_a_key = 100;
  int dots = 0;
  std::string closing;  // of the text or comment that we are in
  std::size_t line = 1;
  const std::size_t begin = starts(0, byte_order_mark) ? byte_order_mark.size() : 0;
  for (std::size_t i = begin; i < toml.size(); ++i) {
    const char c = toml[i];
    line += c == '\n' ? 1 : 0;
    if (!closing.empty()) {
      if (c == '\\' && closing.front() == '"') {
        ++i;
        line += i < toml.size() && toml[i] == '\n' ? 1 : 0;
      } else if (starts(i, closing)) {
        i += closing.size() - 1;
        while (closing.size() > 1 && i + 1 < toml.size() && toml[i + 1] == c)
          ++i;  // quotes before the last three
        closing.clear();
      }
      continue;
    }
    if (static_cast<unsigned char>(c) > 127)
      throw input_error(fmt::format("{}: line {}: a letter beyond ASCII outside a text", file.string(), line),
                        "write texts in quotes");
    if (std::string_view("\n,={[").find(c) != std::string_view::npos) dots = 0;
    if (c == '.' && ++dots >= most_parts_of_a_key)
      throw input_error(
          fmt::format("{}: line {}: a key of more than {} parts", file.string(), line, most_parts_of_a_key),
          "a key has the names that docs/use/sweep.md tells");
    if (c == '#') closing = "\n";
    for (const char* quotes : {"\"\"\"", "'''", "\"", "'"})
      if (closing.empty() && starts(i, quotes)) closing = quotes;
    if (closing.size() > 1) i += closing.size() - 1;
  }
}

toml::table parsed(const fs::path& file, const std::string& text) {
  try {
    return toml::parse(text, file.string());
  } catch (const toml::parse_error& fault) {
    throw input_error(fmt::format("{}: line {}, column {}: {}", file.string(), fault.source().begin.line,
                                  fault.source().begin.column, fault.description()));
  }
}

toml::table parsed(const fs::path& file) {
  const std::string text = read_file(file);
  require_readable(file, text);
  // What is a text to us, and none to toml++ as something is wrong before it, is refused here without those letters.
  std::string ascii;
  for (const char c : text)
    if (const auto byte = static_cast<unsigned char>(c); byte > 127)
      ascii += fmt::format("z{:02x}", byte);
    else
      ascii += c;
  if (text.rfind(byte_order_mark, 0) == 0) ascii.erase(0, 3 * byte_order_mark.size());
  parsed(file, ascii);
  return parsed(file, text);
}

}  // namespace

Sweep read_sweep(const fs::path& file) {
  const toml::table root = parsed(file);
  for (const auto& [key, node] : root)
    if (key != "command" && key != "all" && key != "vary" && key != "columns")
      throw input_error(place(file, node, key.str()) + ": unknown",
                        "expected command, [all], [vary] and [columns]");
  Sweep sweep;
  sweep.command = command_in(file, root);
  if (const toml::table* all = table_in(file, root, "all"))
    for (const auto& [key, node] : in_order(*all)) {
      require_open(file, *node, key);
      sweep.fixed.push_back(setting_of(file, *node, key));
    }
  sweep.runs.emplace_back();
  if (const toml::table* vary = table_in(file, root, "vary"))
    for (const auto& [key, node] : in_order(*vary)) {
      require_once(file, sweep, key, *node);
      add_variation(file, sweep, key, *node);
    }
  if (const toml::table* columns = table_in(file, root, "columns"))
    for (const auto& [key, node] : in_order(*columns)) {
      const auto pointer = node->value<std::string>();
      require_pointer(file, *node, key, pointer);
      require_free(file, *node, key, sweep);
      sweep.columns.emplace_back(key, *pointer);
    }
  return sweep;
}

}  // namespace emmetrope::cohort
