#include "pipeline/base/command_line.hpp"

#include <fmt/format.h>
#include <signal.h>
#include <spdlog/sinks/ringbuffer_sink.h>
#include <unistd.h>

#include <CLI/CLI.hpp>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <iostream>
#include <new>
#include <string_view>
#include <thread>

#include "pipeline/base/command_definition.hpp"
#include "pipeline/base/interrupt.hpp"
#include "pipeline/base/log.hpp"
#include "pipeline/base/memory_limit.hpp"
#include "pipeline/base/sanitizers.hpp"
#include "pipeline/base/version.hpp"

namespace emmetrope {
namespace {

std::string quoted(const std::string& word) {
  std::string text = "'";
  for (const char c : word) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return text + "'";
}

/// Command line as one string that a shell would read back.
std::string joined(int argc, char** argv) {
  std::string line;
  for (int i = 0; i < argc; ++i) {
    const std::string word = i == 0 ? std::filesystem::path(argv[0]).filename().string() : argv[i];
    const bool plain =
        !word.empty() && word.find_first_of(" \t\n'\"\\$*?;&|<>()[]{}#~`!") == std::string::npos;
    line += i == 0 ? "" : " ";
    line += plain ? word : quoted(word);
  }
  return line;
}

[[noreturn]] void refuse_empty_value(const std::string& name) {
  throw CLI::ValidationError(name, "is given an empty value");
}

/// CLI11 would take the next word for the value of "--option=".
void require_values(int argc, char** argv) {
  for (int i = 1; i < argc; ++i) {
    const std::string_view word = argv[i];
    if (word.rfind("--", 0) == 0 && word.find('=') == word.size() - 1)
      refuse_empty_value(std::string(word.substr(0, word.size() - 1)));
  }
}

/// An empty value, of a shell's variable that is not set, would be read as none. "nan" and "inf" are read as numbers by
/// the C library, and pass every range check.
void require_usable_values(const CLI::App& app) {
  for (const CLI::Option* option : app.get_options())
    for (const std::string& value : option->results()) {
      if (value.empty()) refuse_empty_value(option->get_name());
      if (option->get_positional()) continue;
      char* end = nullptr;
      const double number = std::strtod(value.c_str(), &end);
      if (end != value.c_str() && *end == '\0' && !std::isfinite(number))
        throw CLI::ValidationError(option->get_name(), value + " is no finite number");
    }
}

/// CLI11 takes the value of an option that it does not know for a positional, which others may exclude, and counts the
/// values of an option that is given more than once.
std::string told(const CLI::App& app, const CLI::ParseError& fault) {
  for (const std::string& word : app.remaining())
    if (word.rfind('-', 0) == 0 && word != "--") return word + " is no option of " + app.get_name();
  for (const CLI::Option* option : app.get_options()) {
    const int most = option->get_items_expected_max();  // 0: a flag
    if (!option->get_positional() && most > 0 && option->results().size() > static_cast<std::size_t>(most))
      return option->get_name() + " is given more than once";
  }
  return fault.what();
}

std::uint64_t whole_number(const std::string& flag, const std::string& text) {
  std::uint64_t number = 0;
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (fault != std::errc() || end != text.data() + text.size())
    throw CLI::ValidationError(flag, text + " is no whole number from 0 to 2^64 - 1");
  return number;
}

LateralityChoice eyes_of(const std::string& flag, const std::string& text) {
  if (text == "od") return LateralityChoice::od;
  if (text == "os") return LateralityChoice::os;
  if (text == "both") return LateralityChoice::both;
  throw CLI::ValidationError(flag, text + " is none of od, os, both");
}

void declare_common(CLI::App& app, CommonOptions& common) {
  const std::string group = "Common options";
  app.add_flag("--json", common.json, "The answer on standard output as one JSON document")->group(group);
  app.add_flag("--quiet", common.verbosity.quiet, "No progress and no notes")->group(group);
  app.add_flag("--force", common.force, "Redo what is up to date")->group(group);
  app.add_option("--device", common.device, "OpenCL device by index or name (see emmetrope devices)")
      ->group(group);
  app.add_option("--threads", common.threads, "CPU threads; 0: all cores")
      ->check(CLI::Range(0, 1024))
      ->group(group);
  app.add_option_function<std::string>(
         "--seed", [&](const std::string& text) { common.seed = whole_number("--seed", text); },
         "Seed of all random numbers")
      ->type_name("UINT")
      ->default_str("1")
      ->group(group);
  app.add_option_function<std::string>(
         "--laterality", [&](const std::string& text) { common.laterality = eyes_of("--laterality", text); },
         "od, os or both")
      ->type_name("EYE")
      ->group(group);
}

constexpr std::size_t most_warnings = 100;

/// What was told on standard error, for programs that read the answer alone, beside what the answer says itself.
void add_warnings(Json& answer, spdlog::sinks::ringbuffer_sink_mt& sink) {
  std::vector<std::string> all = answer.value("warnings", std::vector<std::string>());
  for (const auto& told : sink.last_raw()) {
    std::string sentence(told.payload.data(), told.payload.size());
    if (std::find(all.begin(), all.end(), sentence) == all.end()) all.push_back(std::move(sentence));
  }
  if (!all.empty()) answer["warnings"] = std::move(all);
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

void say(const char* text) {
  const ssize_t ignored = ::write(STDERR_FILENO, text, std::strlen(text));
  static_cast<void>(ignored);  // there is nobody left to tell
}

/// Of what nobody caught, in another thread or before run_command could: says it without taking memory.
[[noreturn]] void end_with_a_word() noexcept {
  try {
    if (const std::exception_ptr fault = std::current_exception()) std::rethrow_exception(fault);
    say("emmetrope: error: unexpected end\n");
  } catch (const std::bad_alloc&) {
    say("emmetrope: error: out of memory\n  remedy: give it more memory\n");
  } catch (const std::exception& fault) {
    say("emmetrope: error: unexpected fault: ");
    say(fault.what());
    say("\n");
  } catch (...) {
    say("emmetrope: error: unexpected fault\n");
  }
  ::_exit(static_cast<int>(ExitStatus::fault));
}

/// From before main on, as main makes its command before run_command can catch anything.
[[maybe_unused]] const std::terminate_handler handler_before = std::set_terminate(end_with_a_word);

const char* name_of(int signal) {
  switch (signal) {
    case SIGSEGV:
    case SIGBUS:
      return "a memory fault";
    case SIGFPE:
      return "an arithmetic fault";
    case SIGILL:
      return "an instruction that this processor does not know";
    default:
      return "an assertion that failed";
  }
}

extern "C" void end_with_the_signals_name(int signal) {
  say("emmetrope: error: ended by ");
  say(name_of(signal));
  say(", here or in a library\n  remedy: try again; if it comes again, please report it with the command line\n");
  ::_exit(static_cast<int>(ExitStatus::fault));
}

/// That a fault of a library, too, ends with a word and a status that is documented. A sanitizer says more.
void say_what_ends_it() {
#ifndef EMMETROPE_UNDER_SANITIZER
  static std::array<char, 16384> room;  // the stack may be what is full
  stack_t stack{};
  stack.ss_sp = room.data();
  stack.ss_size = room.size();
  ::sigaltstack(&stack, nullptr);
  struct sigaction action {};
  action.sa_handler = end_with_the_signals_name;
  action.sa_flags = static_cast<int>(SA_RESETHAND | SA_ONSTACK);
  for (const int signal : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT}) ::sigaction(signal, &action, nullptr);
#endif
}

}  // namespace

int CommonOptions::thread_count() const {
  return threads > 0 ? threads : static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
}

int run_command(int argc, char** argv, const Command& command) {
  handle_interrupts();
  say_what_ends_it();
  CommonOptions common;
  common.command_line = joined(argc, argv);

  CLI::App app(command.summary, "emmetrope " + command.name);
  app.set_version_flag("--version", "emmetrope " + command.name + " " + version());
  app.get_formatter()->column_width(36);
  app.footer("Example: " + command.example + "\n" + research_notice);
  command.declare(app);
  declare_common(app, common);
  bool only_checks = false;
  app.add_flag("--check-options", only_checks)->group("");
  app.add_flag_callback("--definition",
                        [&] {
                          throw CLI::CallForVersion(command_definition(app, command).dump(2),
                                                    0);  // printed as --version is
                        })
      ->group("");
  try {
    require_values(argc, argv);
    app.parse(argc, argv);
    require_usable_values(app);
  } catch (const CLI::Success& asked) {  // --help, --version
    return app.exit(asked);
  } catch (const CLI::ParseError& fault) {
    common.json = std::find(argv, argv + argc, std::string_view("--json")) != argv + argc;
    return report_failure(
        command.name, common,
        Error(ExitStatus::usage, told(app, fault), "see emmetrope " + command.name + " --help"));
  }
  log_to_stderr(command.name, common.verbosity);
  const auto warnings = std::make_shared<spdlog::sinks::ringbuffer_sink_mt>(most_warnings);
  warnings->set_level(spdlog::level::warn);
  spdlog::default_logger()->sinks().push_back(warnings);

  try {
    if (only_checks) {
      if (command.check) command.check(common);
      return static_cast<int>(ExitStatus::done);
    }
    Answer answer = command.run(common);
    if (answer.json.is_object()) {
      answer.json["status"] = static_cast<int>(answer.status);
      add_warnings(answer.json, *warnings);
    }
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
    return report_failure(
        command.name, common,
        Error(ExitStatus::fault, "out of memory", "give it more memory" + memory_limit_note()));
  } catch (const std::filesystem::filesystem_error& fault) {
    return report_failure(command.name, common, output_error(fault.what()));
  } catch (const std::exception& fault) {
    return report_failure(command.name, common,
                          Error(ExitStatus::fault, std::string("unexpected fault: ") + fault.what(),
                                "this is a defect of the program; please report it with the command line"));
  }
}

}  // namespace emmetrope
