#include "pipeline/base/command_line.hpp"

#include <fmt/format.h>

#include <iostream>
#include <new>
#include <thread>

#include "pipeline/base/interrupt.hpp"
#include "pipeline/base/log.hpp"
#include "pipeline/base/version.hpp"

namespace emmetrope {
namespace {

/// Command line as one string that a shell would read back.
std::string joined(int argc, char** argv) {
  std::string line;
  for (int i = 0; i < argc; ++i) {
    const std::string word = i == 0 ? std::filesystem::path(argv[0]).filename().string() : argv[i];
    const bool plain =
        !word.empty() && word.find_first_of(" \t\n'\"\\$*?;&|<>()[]{}#~`!") == std::string::npos;
    line += (i == 0 ? "" : " ") + (plain ? word : "'" + word + "'");
  }
  return line;
}

void declare_common(CLI::App& app, CommonOptions& common) {
  const std::map<std::string, LateralityChoice> eyes{
      {"od", LateralityChoice::od}, {"os", LateralityChoice::os}, {"both", LateralityChoice::both}};
  const std::string group = "Common options";
  app.add_flag("--json", common.json, "The answer on standard output as one JSON document")->group(group);
  app.add_flag("--quiet", common.verbosity.quiet, "No progress and no notes")->group(group);
  app.add_flag("--force", common.force, "Redo what is up to date")->group(group);
  app.add_option("--device", common.device, "OpenCL device by index or name (see emmetrope devices)")
      ->group(group);
  app.add_option("--threads", common.threads, "CPU threads; 0: all cores")
      ->check(CLI::Range(0, 1024))
      ->group(group);
  app.add_option("--seed", common.seed, "Seed of all random numbers")->capture_default_str()->group(group);
  app.add_option("--laterality", common.laterality, "od, os or both")
      ->transform(CLI::CheckedTransformer(eyes, CLI::ignore_case).description(""))
      ->type_name("EYE")
      ->group(group);
}

int report_failure(const std::string& command, const CommonOptions& common, const Error& error) {
  std::cerr << "emmetrope " << command << ": error: " << error.what() << "\n";
  for (const auto& doing : error.context()) std::cerr << "  while " << doing << "\n";
  if (!error.remedy().empty()) std::cerr << "  remedy: " << error.remedy() << "\n";
  if (common.json) {
    const Json answer{
        {"status", static_cast<int>(error.status())},
        {"error", {{"message", error.what()}, {"context", error.context()}, {"remedy", error.remedy()}}}};
    std::cout << answer.dump(2, ' ', false, Json::error_handler_t::replace) << std::endl;
  }
  return static_cast<int>(error.status());
}

}  // namespace

int CommonOptions::thread_count() const {
  return threads > 0 ? threads : static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
}

int run_command(int argc, char** argv, const Command& command) {
  handle_interrupts();
  CommonOptions common;
  common.command_line = joined(argc, argv);

  CLI::App app(command.summary, "emmetrope " + command.name);
  app.set_version_flag("--version", "emmetrope " + command.name + " " + version());
  app.get_formatter()->column_width(36);
  app.footer("Example: " + command.example + "\n" + research_notice);
  command.declare(app);
  declare_common(app, common);
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& asked) {  // --help, --version
    return app.exit(asked);
  } catch (const CLI::ParseError& fault) {
    std::cerr << "emmetrope " << command.name << ": error: " << fault.what() << "\n  remedy: see emmetrope "
              << command.name << " --help\n";
    return static_cast<int>(ExitStatus::usage);
  }
  log_to_stderr(command.name, common.verbosity);

  try {
    const Answer answer = command.run(common);
    if (common.json)
      std::cout << answer.json.dump(2, ' ', false, Json::error_handler_t::replace) << "\n";
    else
      std::cout << answer.text;
    std::cout.flush();
    if (!std::cout) throw output_error("cannot write the answer to standard output");
    return static_cast<int>(answer.status);
  } catch (const Error& error) {
    return report_failure(command.name, common, error);
  } catch (const std::bad_alloc&) {
    return report_failure(command.name, common,
                          Error(ExitStatus::fault, "out of memory", "use a machine with more memory"));
  } catch (const std::filesystem::filesystem_error& fault) {
    return report_failure(command.name, common, output_error(fault.what()));
  } catch (const std::exception& fault) {
    return report_failure(command.name, common,
                          Error(ExitStatus::fault, std::string("unexpected fault: ") + fault.what(),
                                "this is a defect of the program; please report it with the command line"));
  }
}

}  // namespace emmetrope
