#include "pipeline/base/command_definition.hpp"

#include <CLI/CLI.hpp>

namespace emmetrope {
namespace {

/// CLI11 appends what a check allows to a value's name: "LEVEL:{participant,group}".
Json choices_in(const std::string& type) {
  Json choices = Json::array();
  const std::size_t colon = type.find(':');
  const std::size_t begin = colon == std::string::npos ? colon : type.find('{', colon);
  const std::size_t end = begin == std::string::npos ? begin : type.find('}', begin);
  if (end == std::string::npos) return choices;
  for (const std::string& choice : CLI::detail::split(type.substr(begin + 1, end - begin - 1), ','))
    choices.push_back(choice);
  return choices;
}

Json option_definition(const CLI::Option& option) {
  const bool is_positional = option.get_positional();
  Json names = Json::array();
  if (is_positional) names.push_back(option.get_name(true));
  for (const std::string& name : option.get_snames()) names.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) names.push_back("--" + name);
  const bool is_flag = option.get_type_size() == 0;
  const std::string type = is_flag ? "" : option.get_type_name();
  return {{"names", names},
          {"value", type.substr(0, type.find(':'))},
          {"choices", choices_in(type)},
          {"description", option.get_description()},
          {"is_required", option.get_required()},
          {"is_positional", is_positional},
          {"takes_many", option.get_expected_max() > 1},
          {"is_common", option.get_group() == "Common options"}};
}

}  // namespace

Json command_definition(const CLI::App& app, const Command& command) {
  Json options = Json::array();
  for (const CLI::Option* option : app.get_options())
    if (!option->get_group().empty()) options.push_back(option_definition(*option));
  return {{"name", command.name},
          {"summary", command.summary},
          {"example", command.example},
          {"options", options},
          {"result_keys", command.result_keys}};
}

}  // namespace emmetrope
