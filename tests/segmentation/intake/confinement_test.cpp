#include "segmentation/intake/confinement.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/ptrace.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <initializer_list>
#include <string>

namespace emmetrope::segmentation {
namespace {

namespace fs = std::filesystem;

/// Exit status of a child that is confined and then tries something; 0 where it was refused, 1 where it could, 2 where
/// the kernel grants no confinement.
template <typename Attempt>
int confined(
    const Attempt& attempt, bool (*confine)() = [] {
      const Confinement confinement = confine_process();
      return confinement.system_calls && confinement.files;
    }) {
  const pid_t child = ::fork();
  if (child == 0) {
    if (!confine()) ::_exit(2);
    ::_exit(attempt() ? 1 : 0);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

class ConfinementTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (confined([] { return false; }) == 2) GTEST_SKIP() << "this kernel has neither seccomp nor Landlock";
    fs::create_directories(folder_);
    std::ofstream(file_) << "kept";
  }
  void TearDown() override { fs::remove_all(folder_); }

  const fs::path folder_ = fs::temp_directory_path() / ("confinement-" + std::to_string(::getpid()));
  const fs::path file_ = folder_ / "file", other_ = folder_ / "other";
};

TEST_F(ConfinementTest, FilesAreRead) {
  EXPECT_EQ(confined([&] {
              std::ifstream stream(file_);
              std::string word;
              return stream >> word && word == "kept";
            }),
            1);
}

// Each part by itself, so that neither hides that the other does nothing.
TEST_F(ConfinementTest, NothingIsWrittenMadeRemovedOrRenamed) {
  for (const auto part : {forbid_changes_of_files, forbid_system_calls}) {
    EXPECT_EQ(confined([&] { return ::open(file_.c_str(), O_WRONLY) >= 0; }, part), 0);
    EXPECT_EQ(confined([&] { return ::open(file_.c_str(), O_RDWR) >= 0; }, part), 0);
    EXPECT_EQ(confined([&] { return ::open(other_.c_str(), O_WRONLY | O_CREAT, 0600) >= 0; }, part), 0);
    EXPECT_EQ(confined([&] { return ::unlink(file_.c_str()) == 0; }, part), 0);
    EXPECT_EQ(confined([&] { return ::rename(file_.c_str(), other_.c_str()) == 0; }, part), 0);
    EXPECT_EQ(confined([&] { return ::mkdir(other_.c_str(), 0700) == 0; }, part), 0);
    EXPECT_EQ(confined([&] { return ::symlink(file_.c_str(), other_.c_str()) == 0; }, part), 0);
    EXPECT_EQ(confined([] { return ::execl("/bin/true", "true", nullptr) == 0; }, part), 0);
  }
  for (const auto& change : std::initializer_list<std::function<bool()>>{
           [&] { return ::open(file_.c_str(), O_RDONLY | O_TRUNC) >= 0; },
           [&] { return ::truncate(file_.c_str(), 0) == 0; },
           [&] { return ::chmod(file_.c_str(), 0777) == 0; }})
    EXPECT_EQ(confined(change, forbid_system_calls), 0);
  std::string left;
  std::ifstream(file_) >> left;
  EXPECT_EQ(left, "kept");
  EXPECT_FALSE(fs::exists(other_));
}

TEST_F(ConfinementTest, NoNetworkAndNoOtherProcess) {
  EXPECT_EQ(confined([] { return ::socket(AF_INET, SOCK_STREAM, 0) >= 0; }), 0);
  EXPECT_EQ(confined([] { return ::socket(AF_UNIX, SOCK_STREAM, 0) >= 0; }), 0);
  EXPECT_EQ(confined([] {
              const pid_t child = ::fork();
              if (child == 0) ::_exit(0);
              return child > 0;
            }),
            0);
  EXPECT_EQ(confined([parent = ::getpid()] { return ::kill(parent, 0) == 0; }), 0);
  EXPECT_EQ(
      confined([parent = ::getpid()] { return ::ptrace(PTRACE_ATTACH, parent, nullptr, nullptr) == 0; }), 0);
  // A signal by way of a file's owner
  EXPECT_EQ(confined([parent = ::getpid()] { return ::fcntl(STDIN_FILENO, F_SETOWN, parent) == 0; }), 0);
}

TEST_F(ConfinementTest, WhatIsWrittenIsNotExecuted) {
  const auto mapped = [](int protection) {
    return ::mmap(nullptr, 4096, protection, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  };
  EXPECT_EQ(confined([&] { return mapped(PROT_READ | PROT_WRITE) != MAP_FAILED; }), 1);
  EXPECT_EQ(confined([&] { return mapped(PROT_READ | PROT_WRITE | PROT_EXEC) != MAP_FAILED; }), 0);
  EXPECT_EQ(
      confined([&] { return ::mprotect(mapped(PROT_READ | PROT_WRITE), 4096, PROT_READ | PROT_EXEC) == 0; }),
      0);
}

TEST_F(ConfinementTest, EndsByItsOwnFaults) {
  EXPECT_EQ(confined([]() -> bool { ::abort(); }), 128 + SIGABRT);
}

TEST_F(ConfinementTest, IsNamed) {
  EXPECT_EQ((Confinement{true, true}.in_words()), "seccomp and Landlock");
  EXPECT_EQ((Confinement{false, true}.in_words()), "Landlock");
  EXPECT_EQ((Confinement{}.in_words()), "nothing");
}

}  // namespace
}  // namespace emmetrope::segmentation
