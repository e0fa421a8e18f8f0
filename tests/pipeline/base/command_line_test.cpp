#include "pipeline/base/command_line.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>
#include <CLI/CLI.hpp>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <new>
#include <thread>

#include "pipeline/base/sanitizers.hpp"

namespace emmetrope {
namespace {

using testing::HasSubstr;

Command command() {
  return {"try",
          "Tries.",
          "emmetrope try --radius 7.8",
          [](CLI::App& app) {
            app.add_option("--radius", "Radius in mm")->check(CLI::PositiveNumber);
            app.add_option("--eye", "Eye")->excludes(app.add_option("CASE", "Case"));
            app.add_option("--lens", "Lens");
          },
          [](const CommonOptions& common) -> Answer {
            if (common.seed == 3) throw input_error("a.dcm lacks (0020,0032)", "export the series again");
            if (common.seed == 4) throw std::runtime_error("surprise");
            if (common.seed == 5) std::thread([] { throw std::bad_alloc(); }).join();
            if (common.seed == 6) std::abort();  // as a library does
            if (common.seed == 7) ::raise(SIGSEGV);
            std::cerr << "laterality " << static_cast<int>(common.laterality) << " threads " << common.threads
                      << "\n";
            return {common.seed == 8 ? ExitStatus::partial : ExitStatus::done, Json{{"value", 1}}, "text\n"};
          },
          [](const CommonOptions& common) {
            if (common.seed == 9) throw usage_error("--seed 9 is none");
          }};
}

struct Ended {
  int status;
  std::string out, err;
};

std::string rest_of(std::FILE* file) {
  std::rewind(file);
  std::string text;
  for (int c = std::fgetc(file); c != EOF; c = std::fgetc(file)) text += static_cast<char>(c);
  std::fclose(file);
  return text;
}

/// run_command starts a thread and blocks signals: each call gets a process of its own.
Ended run(std::vector<std::string> words) {
  std::FILE* out = std::tmpfile();
  std::FILE* err = std::tmpfile();
  const pid_t child = ::fork();
  if (child == 0) {
    ::dup2(::fileno(out), STDOUT_FILENO);
    ::dup2(::fileno(err), STDERR_FILENO);
    words.insert(words.begin(), "emmetrope-try");
    std::vector<char*> pointers;
    for (auto& word : words) pointers.push_back(word.data());
    const int status = run_command(static_cast<int>(pointers.size()), pointers.data(), command());
    std::cout.flush();
    ::_exit(status);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  return {WEXITSTATUS(status), rest_of(out), rest_of(err)};
}

TEST(CommandLine, ReturnsTheCommandsStatusAndAnswer) {
  const Ended plain = run({"--laterality", "os", "--threads", "2"});
  EXPECT_EQ(plain.status, 0);
  EXPECT_EQ(plain.out, "text\n");
  EXPECT_THAT(plain.err, HasSubstr("laterality 1 threads 2"));
  const Ended partial = run({"--seed", "8", "--json"});
  EXPECT_EQ(partial.status, 8);
  EXPECT_EQ(Json::parse(partial.out)["value"], 1);
  EXPECT_EQ(Json::parse(partial.out)["status"], 8);
}

TEST(CommandLine, TurnsWrongUsageIntoStatus2) {
  for (const auto& words : std::vector<std::vector<std::string>>{{"--radius", "-1"},
                                                                 {"--nonsense"},
                                                                 {"--laterality", "left"},
                                                                 {"--laterality", "1"},
                                                                 {"--threads", "-3"},
                                                                 {"--radius", "nan"},
                                                                 {"--radius", "inf"},
                                                                 {"--lens", ""},
                                                                 {"--device", ""},
                                                                 {"--seed", "-1"},
                                                                 {"--seed", "18446744073709551616"}}) {
    const Ended ended = run(words);
    EXPECT_EQ(ended.status, 2) << words[0];
    EXPECT_EQ(ended.out, "") << words[0];
    EXPECT_THAT(ended.err, HasSubstr(words[0]));
  }
}

TEST(CommandLine, SaysWhatIsEmptyAndWhatIsGivenTwice) {
  EXPECT_THAT(run({"--lens=", "--quiet"}).err, HasSubstr("--lens: is given an empty value"));
  const Ended twice = run({"--quiet", "--quiet", "--lens", "a", "--lens", "b"});
  EXPECT_EQ(twice.status, 2);
  EXPECT_THAT(twice.err, HasSubstr("error: --lens is given more than once"));
}

TEST(CommandLine, NamesTheUnknownOptionWhoseValueCouldBeAPositional) {
  const Ended ended = run({"--eye", "navarro", "--pupl", "3"});
  EXPECT_EQ(ended.status, 2);
  EXPECT_THAT(ended.err, HasSubstr("error: --pupl is no option of emmetrope try\n"));
  EXPECT_THAT(run({"--eye", "navarro", "--", "case"}).err, HasSubstr("excludes"));
}

TEST(CommandLine, WrongUsageIsJsonToo) {
  const Ended ended = run({"--json", "--nonsense"});
  EXPECT_EQ(ended.status, 2);
  EXPECT_EQ(Json::parse(ended.out)["status"], 2);
}

TEST(CommandLine, ASeedMayBeAnyWholeNumber) { EXPECT_EQ(run({"--seed", "18446744073709551615"}).status, 0); }

TEST(CommandLine, PrintsErrorAndRemedyAndKeepsJsonValid) {
  const Ended refused = run({"--seed", "3", "--json"});
  EXPECT_EQ(refused.status, 3);
  EXPECT_THAT(refused.err, HasSubstr("(0020,0032)\n  remedy: export"));
  EXPECT_EQ(Json::parse(refused.out)["error"]["remedy"], "export the series again");
  const Ended fault = run({"--seed", "4"});
  EXPECT_EQ(fault.status, 1);
  EXPECT_THAT(fault.err, HasSubstr("surprise"));
}

TEST(CommandLine, ChecksOptionsWithoutRunning) {
  const Ended accepted = run({"--check-options", "--seed", "3"});
  EXPECT_EQ(accepted.status, 0);
  EXPECT_EQ(accepted.out, "");
  EXPECT_EQ(run({"--check-options", "--seed", "9"}).status, 2);
  EXPECT_EQ(run({"--check-options", "--radius", "-1"}).status, 2);
  EXPECT_EQ(run({"--seed", "9"}).status, 0);
}

TEST(CommandLine, AnswersHelpAndVersionOnStandardOutput) {
  const Ended help = run({"--help"});
  EXPECT_EQ(help.status, 0);
  EXPECT_THAT(help.out, HasSubstr("emmetrope try --radius 7.8"));
  EXPECT_THAT(help.out, HasSubstr("Research use only"));
  EXPECT_THAT(run({"--version"}).out, HasSubstr("emmetrope try "));
}

TEST(CommandLine, AFaultThatNobodyCaughtIsSaid) {
  const Ended ended = run({"--seed", "5"});
  EXPECT_EQ(ended.status, 1);
  EXPECT_THAT(ended.err, HasSubstr("emmetrope: error: out of memory"));
}

#ifndef EMMETROPE_UNDER_SANITIZER
TEST(CommandLine, ASignalThatEndsItIsSaid) {
  for (const auto& [seed, word] : {std::pair{"6", "assertion"}, std::pair{"7", "memory fault"}}) {
    const Ended ended = run({"--seed", seed});
    EXPECT_EQ(ended.status, 1);
    EXPECT_THAT(ended.err, HasSubstr(word));
    EXPECT_THAT(ended.err, HasSubstr("remedy"));
  }
}
#endif

}  // namespace
}  // namespace emmetrope
