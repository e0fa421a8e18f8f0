#include "pipeline/cohort/sweep/sweep_run.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/process.hpp"
#include "pipeline/base/version.hpp"

namespace emmetrope::cohort {
namespace {

namespace fs = std::filesystem;

/// The eye of `emmetrope eye` has no option.
std::vector<std::string> words_of(const std::string& command, const Setting& setting) {
  if (command == "eye" && setting.option == "eye") return {setting.text};
  return setting.words;
}

/// The command's result as JSON: a file that it wrote, or its answer.
Json result_of(const std::string& command, const fs::path& folder, const std::string& answer) {
  if (command == "eye") return Json::parse(answer);
  return read_json(folder / (command == "trace" ? "wavefront.json" : "prescription.json"));
}

}  // namespace

Json sweep_plan(const Sweep& sweep, const std::vector<Setting>& settings,
                const std::vector<std::string>& shared) {
  std::vector<std::string> words;
  Json files = Json::object();
  const auto add = [&](const Setting& setting) {
    const std::vector<std::string> own = words_of(sweep.command, setting);
    words.insert(words.end(), own.begin(), own.end());
    std::error_code unreadable;
    if (fs::path(setting.text).is_absolute() && fs::is_regular_file(setting.text, unreadable))
      files[setting.text] = sha256_of_file(setting.text);
  };
  std::for_each(sweep.fixed.begin(), sweep.fixed.end(), add);
  std::for_each(settings.begin(), settings.end(), add);
  words.insert(words.end(), shared.begin(), shared.end());
  return {{"command", sweep.command}, {"words", words}, {"files", files}, {"version", version()}};
}

std::string run_name(const Json& plan) {
  constexpr std::size_t digits = 12;
  return sha256_of(plan.dump()).substr(0, digits);
}

int run_of_sweep(const SweepFolder& folder, const std::string& run, const Attempt& attempt) {
  const Json plan = read_json(folder.plan(run));
  const std::string command = plan.at("command");
  std::vector<std::string> words = plan.at("words");
  fs::remove_all(folder.results(run));
  if (command != "eye") {
    fs::create_directories(folder.results(run));
    words.insert(words.end(), {"-o", folder.results(run).string(), "--force"});
  }
  words.insert(words.end(), {"--json", "--quiet", "--threads", std::to_string(attempt.threads)});
  const ProcessResult ended =
      run_process(executable_folder() / ("emmetrope-" + command), words, ChildOutput::capture);
  if (was_interrupted(ended.status)) return ended.status;
  if (is_of_the_machine(ended.status) && attempt.number < attempt.of) return ended.status;
  Json end{{"status", ended.status}, {"message", ""}, {"result", nullptr}};
  if (gave_result(ended.status))
    end["result"] = result_of(command, folder.results(run), ended.output);
  else
    end["message"] = message_of_failure(ended);
  fs::create_directories(folder.end(run).parent_path());
  write_json(folder.end(run), end);
  return 0;
}

}  // namespace emmetrope::cohort
