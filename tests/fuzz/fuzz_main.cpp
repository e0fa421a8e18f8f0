// Breaks inputs at random and gives them to a door: emmetrope-fuzz DOOR|all [--runs N | --seconds S] [--seed K]
// [--corpus FOLDER]. An input that is a fault stays in the working folder and is named; status 1.
#include <fmt/format.h>
#include <sys/time.h>
#include <unistd.h>

#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <csignal>
#include <fstream>
#include <iostream>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "tests/fuzz/doors.hpp"

namespace emmetrope::fuzz {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

struct Plan {
  std::string door;
  std::uint64_t runs = 0;
  double seconds = 0;
  std::uint64_t seed = 1;
  fs::path corpus;
};

struct Outcome {
  std::uint64_t runs = 0, read = 0, refused = 0, faults = 0;
  double longest_s = 0;
};

/// What ends a hanging input: so much processor time, or ten times that of waiting, as machines are shared.
constexpr unsigned longest_run_s = 20;

void limit_run(unsigned seconds) {
  ::itimerval timer{};
  timer.it_value.tv_sec = seconds;
  ::setitimer(ITIMER_PROF, &timer, nullptr);
  ::alarm(10 * seconds);
}

/// Where the input lies that is being read, for say_which.
std::string reading;

/// A crash or a hang is named by its input, which stays.
extern "C" void say_which(int signal) {
  const ssize_t ignored = ::write(STDERR_FILENO, reading.data(), reading.size());
  static_cast<void>(ignored);
  std::signal(signal, SIG_DFL);
  std::raise(signal);
}

void try_one(const Door& door, const fs::path& file, const std::string& input, Outcome& outcome) {
  // Not by write_file(), nor over the old one: both wait for the disk.
  fs::remove(file);
  std::ofstream(file, std::ios::binary) << input;
  const auto start = Clock::now();
  limit_run(longest_run_s);
  try {
    door.open(file);
    ++outcome.read;
  } catch (const Error& refusal) {
    if (refusal.status() == ExitStatus::fault) throw;
    ++outcome.refused;
  }
  limit_run(0);
  ++outcome.runs;
  outcome.longest_s =
      std::max(outcome.longest_s, std::chrono::duration<double>(Clock::now() - start).count());
}

std::vector<std::string> inputs_of(const Door& door, const Plan& plan, const fs::path& place) {
  fs::create_directories(place / "seeds");
  std::vector<std::string> inputs = door.seeds(place / "seeds");
  fs::remove_all(place / "seeds");
  if (!plan.corpus.empty() && fs::is_directory(plan.corpus / door.name))
    for (const auto& entry : fs::directory_iterator(plan.corpus / door.name))
      inputs.push_back(read_file(entry.path()));
  return inputs;
}

Outcome try_door(const Door& door, const Plan& plan) {
  const fs::path place = fs::temp_directory_path() / fmt::format("fuzz-{}-{}", door.name, ::getpid());
  fs::create_directories(place);
  const std::vector<std::string> inputs = inputs_of(door, plan, place);
  const fs::path file = place / door.file;
  Outcome outcome;
  Random random(plan.seed);
  const auto start = Clock::now();
  reading = fmt::format("{}: crashed or hung, {}\n", door.name, file.string());
  for (const int signal : {SIGALRM, SIGPROF, SIGSEGV, SIGABRT, SIGFPE, SIGBUS, SIGILL})
    std::signal(signal, say_which);
  for (const std::string& input : inputs) try_one(door, file, input, outcome);
  if (outcome.refused > 0) throw std::runtime_error(door.name + " refuses a whole input");
  const auto goes_on = [&] {
    return plan.seconds > 0 ? std::chrono::duration<double>(Clock::now() - start).count() < plan.seconds
                            : outcome.runs < plan.runs;
  };
  while (goes_on()) {
    std::string input = inputs[std::uniform_int_distribution<std::size_t>(0, inputs.size() - 1)(random)];
    for (std::size_t changes = 1 + random() % 3; changes > 0; --changes) input = door.mutate(input, random);
    try {
      try_one(door, file, input, outcome);
    } catch (const std::exception& fault) {
      ++outcome.faults;
      const fs::path kept = fs::current_path() / fmt::format("fault-{}-{}", outcome.faults, door.file);
      write_file(kept, input);
      std::cerr << fmt::format("{}: {} ({})\n", door.name, fault.what(), kept.string());
    }
  }
  fs::remove_all(place);
  return outcome;
}

int run(const Plan& plan) {
  spdlog::set_level(spdlog::level::off);
  Outcome all;
  bool is_known = false;
  for (const Door& door : doors()) {
    if (plan.door != "all" && plan.door != door.name) continue;
    is_known = true;
    const Outcome outcome = try_door(door, plan);
    std::cout << fmt::format("{:<16} {:>8} inputs, {:>8} read, {:>8} refused, {} faults, longest {:.2f} s\n",
                             door.name, outcome.runs, outcome.read, outcome.refused, outcome.faults,
                             outcome.longest_s)
              << std::flush;
    all.runs += outcome.runs;
    all.faults += outcome.faults;
  }
  if (!is_known) {
    std::cerr << "no such door: " << plan.door << "\n";
    return 2;
  }
  return all.faults == 0 && all.runs > 0 ? 0 : 1;
}

}  // namespace
}  // namespace emmetrope::fuzz

int main(int argc, char** argv) {
  emmetrope::fuzz::Plan plan;
  CLI::App app("Breaks inputs at random and gives them to the readers of files and options.");
  app.add_option("DOOR", plan.door, "which, or all")->required();
  auto* runs = app.add_option("--runs", plan.runs, "inputs a door");
  app.add_option("--seconds", plan.seconds, "a door")->excludes(runs);
  app.add_option("--seed", plan.seed);
  app.add_option("--corpus", plan.corpus, "folder with a folder of inputs a door");
  CLI11_PARSE(app, argc, argv);
  return emmetrope::fuzz::run(plan);
}
