#include "pipeline/cohort/sweep/sweep.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>

#include "pipeline/base/case_folder.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/process.hpp"
#include "pipeline/cohort/subjects/stage_end.hpp"
#include "pipeline/cohort/subjects/subject_plan.hpp"
#include "pipeline/cohort/sweep/sweep_results.hpp"
#include "pipeline/cohort/sweep/sweep_run.hpp"

namespace emmetrope::cohort {
namespace {

namespace fs = std::filesystem;

/// What the command says of itself.
Json definition_of(const std::string& command) {
  const ProcessResult said =
      run_process(executable_folder() / ("emmetrope-" + command), {"--definition"}, ChildOutput::capture);
  return parse_json(said.output, "emmetrope " + command + " --definition");
}

/// \throw Error (input_invalid) where an option takes no value, needs one, or takes one alone, and is given otherwise
void require_fitting_values(const Setting& setting, const Json& option, const std::string& place) {
  if (setting.words.empty()) return;  // false: left out
  const bool has_value = setting.words.size() > 1 || setting.words.front() != "--" + setting.option;
  if (option.at("value") == "" && has_value)
    throw input_error(place + " takes no value, found " + setting.text, "write true or false");
  if (option.at("value") != "" && !has_value)
    throw input_error(place + " needs a value, found none", "false leaves it out");
  if (setting.words.size() > 2 && !option.at("takes_many").get<bool>())
    throw input_error(place + " takes one value, found a list of several: " + setting.text,
                      "write a text, as the command line has it");
}

/// An option that the command does not have, or not with such values, would fail every run.
void require_known_options(const Sweep& sweep, const Json& definition, const fs::path& file) {
  std::map<std::string, const Json*> known;
  for (const Json& option : definition.at("options"))
    for (const Json& name : option.at("names")) known.emplace(name.get<std::string>(), &option);
  const auto require = [&](const std::vector<Setting>& settings) {
    for (const Setting& setting : settings) {
      auto found = known.find("--" + setting.option);
      if (found == known.end()) found = known.find(setting.option);
      if (found == known.end())
        throw input_error(
            fmt::format("{}: {} is no option of emmetrope {}", file.string(), setting.option, sweep.command),
            "see emmetrope " + sweep.command + " --help");
      require_fitting_values(setting, *found->second, fmt::format("{}: {}", file.string(), setting.option));
    }
  };
  require(sweep.fixed);
  for (const std::vector<Setting>& settings : sweep.runs) require(settings);
}

/// A column that no result can have would be told after the hours of all runs.
void require_known_columns(const Sweep& sweep, const Json& definition, const fs::path& file) {
  const auto keys = definition.at("result_keys").get<std::vector<std::string>>();
  const auto is_key = [&](const std::string& name) {
    return std::find(keys.begin(), keys.end(), name) != keys.end();
  };
  for (const auto& [column, pointer] : sweep.columns) {
    Json::json_pointer top(pointer);
    while (!top.parent_pointer().empty()) top.pop_back();
    const std::string place = fmt::format("{}: [columns] {}: ", file.string(), column);
    if (!is_key(top.back()))
      throw input_error(
          fmt::format("{}a result of emmetrope {} has no key \"{}\"", place, sweep.command, top.back()),
          fmt::format("its keys are {}", fmt::join(keys, ", ")));
    if (is_key(column) && pointer != "/" + column)
      throw input_error(fmt::format("{}the result has a {} of its own", place, column),
                        "give it another name");
  }
}

/// \return names of the runs, in their order
std::vector<std::string> write_plans(const Sweep& sweep, const SweepFolder& folder,
                                     const CommonOptions& common) {
  fs::create_directories(folder.root / "plans");
  std::vector<std::string> names;
  std::string list;
  for (const std::vector<Setting>& settings : sweep.runs) {
    const Json plan = sweep_plan(sweep, settings, shared_options(common));
    names.push_back(run_name(plan));
    write_if_new(folder.plan(names.back()), plan.dump(2) + "\n");
    list += names.back() + "\n";
  }
  write_if_new(folder.list(), list);
  return names;
}

/// A fault of the machine is tried again by each call.
void forget_faults_of_machine(const SweepFolder& folder, const std::vector<std::string>& names) {
  for (const std::string& name : names)
    if (fs::exists(folder.end(name)) && is_of_the_machine(read_json(folder.end(name)).value("status", 1)))
      fs::remove(folder.end(name));
}

/// Runs that did not begin, or were ended from outside at every attempt, have left no end.
void end_runs_without_one(const SweepFolder& folder, const std::vector<std::string>& names) {
  fs::create_directories(folder.root / "ends");
  for (const std::string& name : names)
    if (!fs::exists(folder.end(name)))
      write_json(folder.end(name), {{"status", static_cast<int>(ExitStatus::fault)},
                                    {"message", why_no_end(folder.log(name))},
                                    {"result", nullptr}});
}

}  // namespace

Answer run_sweep(const SweepOptions& options, const CommonOptions& common) {
  require_engine(options.engine);
  const Sweep sweep = read_sweep(options.table);
  const Json definition = definition_of(sweep.command);
  require_known_options(sweep, definition, options.table);
  require_known_columns(sweep, definition, options.table);
  const SweepFolder folder{fs::absolute(options.output).lexically_normal()};
  const CaseLock lock(folder.root, true);
  const std::vector<std::string> names = write_plans(sweep, folder, common);
  forget_faults_of_machine(folder, names);
  Workflow workflow{data_folder() / "pipeline/cohort/sweep/Snakefile",
                    folder.root,
                    fmt::format("{} runs", names.size()),
                    {}};
  for (const std::string& name : names) workflow.jobs.emplace(folder.end(name), folder.log(name));
  if (!run_workflow(workflow, options.engine, common)) end_runs_without_one(folder, names);
  const SweepResults table = sweep_table(sweep, folder, names);
  write_file(folder.root / "sweep.tsv", table.text);
  if (!table.faults.empty())
    throw input_error(
        fmt::format("{}: {}", options.table.string(), fmt::join(table.faults, "; ")),
        fmt::format("see \"result\" in a file of {}; {} has all else, and the next emmetrope sweep keeps "
                    "the runs",
                    (folder.root / "ends").string(), (folder.root / "sweep.tsv").string()));
  std::size_t failed = 0;
  for (const std::string& name : names)
    failed += gave_result(read_json(folder.end(name)).at("status")) ? 0 : 1;
  Answer answer;
  answer.status = failed == 0             ? ExitStatus::done
                  : failed < names.size() ? ExitStatus::partial
                                          : ExitStatus::no_result;
  answer.json = {{"runs", names.size()}, {"failed", failed}, {"table", (folder.root / "sweep.tsv").string()}};
  answer.text =
      fmt::format("{} runs, {} failed\n{}\n", names.size(), failed, (folder.root / "sweep.tsv").string());
  return answer;
}

}  // namespace emmetrope::cohort
