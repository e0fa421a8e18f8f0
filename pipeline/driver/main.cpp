// emmetrope NAME ... runs emmetrope-NAME ... beside it.
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <iostream>
#include <string>
#include <vector>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/version.hpp"
#include "pipeline/driver/commands.hpp"

namespace {

using emmetrope::ExitStatus;

std::string overview() {
  std::string text =
      "Emmetrope: from an orbit MRI to what the eye sees and the lens that sharpens it.\n\n"
      "Usage: emmetrope COMMAND [OPTIONS]\n\nCommands:\n";
  for (const auto& command : emmetrope::driver::commands)
    text += fmt::format("  {:<11}{}\n", command.name, command.summary);
  return text + "\nExample: emmetrope run study -o case\n" + emmetrope::research_notice + "\n";
}

/// Whether it is a command of the overview, or a lesser program beside them.
bool is_known(const std::string& name, const std::string& program) {
  for (const auto& command : emmetrope::driver::commands)
    if (name == command.name) return true;
  return name.find('/') == std::string::npos && ::access(program.c_str(), X_OK) == 0;
}

int fail(ExitStatus status, const std::string& message) {
  std::cerr << "emmetrope: error: " << message << "\n";
  return static_cast<int>(status);
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<std::string> words(argv + 1, argv + argc);
  if (words.empty()) {
    std::cerr << overview();
    return static_cast<int>(ExitStatus::usage);
  }
  if (words[0] == "--version") {
    std::cout << "emmetrope " << emmetrope::version() << "\n";
    return 0;
  }
  if (words[0] == "help" && words.size() > 1) words = {words[1], "--help"};
  if (words[0] == "help" || words[0] == "--help" || words[0] == "-h") {
    std::cout << overview();
    return 0;
  }
  const std::string program = (emmetrope::executable_folder() / ("emmetrope-" + words[0])).string();
  if (!is_known(words[0], program))
    return fail(ExitStatus::usage,
                "unknown command \"" + words[0] + "\"\n  remedy: emmetrope --help lists them");

  std::vector<char*> arguments{const_cast<char*>(program.c_str())};
  for (std::size_t i = 1; i < words.size(); ++i) arguments.push_back(words[i].data());
  arguments.push_back(nullptr);
  ::execv(program.c_str(), arguments.data());
  return fail(ExitStatus::fault,
              "cannot run " + program + ": " + std::strerror(errno) +
                  "\n  remedy: install Emmetrope again; its commands belong in one folder");
}
