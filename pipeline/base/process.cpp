#include "pipeline/base/process.hpp"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <sstream>
#include <system_error>

#include "pipeline/base/error.hpp"
#include "pipeline/base/interrupt.hpp"

namespace emmetrope {
namespace {

[[noreturn]] void execute(const std::vector<char*>& words, ChildOutput output, int pipe_end) {
  restore_signals_in_child();
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);  // a stage never outlives a driver that was killed
  const int target = output == ChildOutput::capture   ? pipe_end
                     : output == ChildOutput::discard ? ::open("/dev/null", O_WRONLY)
                                                      : STDOUT_FILENO;
  if (target != STDOUT_FILENO) ::dup2(target, STDOUT_FILENO);
  ::execv(words[0], words.data());
  ::_exit(127);
}

/// \return 0, or errno where the end was not reached
int read_all(int descriptor, std::string& bytes) {
  std::array<char, 65536> buffer{};
  for (;;) {
    const ssize_t count = ::read(descriptor, buffer.data(), buffer.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return count < 0 ? errno : 0;
    bytes.append(buffer.data(), static_cast<std::size_t>(count));
  }
}

}  // namespace

ProcessResult run_process(const std::filesystem::path& program, const std::vector<std::string>& arguments,
                          ChildOutput output) {
  // All that allocates happens before the fork: another thread may hold the allocator's lock then.
  std::vector<std::string> words{program.string()};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> pointers;
  for (auto& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  if (::access(program.c_str(), X_OK) != 0)
    throw Error(ExitStatus::fault, "cannot run " + program.string() + ": " + std::strerror(errno),
                "install Emmetrope again: its commands belong in one folder");

  std::array<int, 2> ends{-1, -1};
  if (output == ChildOutput::capture && ::pipe2(ends.data(), O_CLOEXEC) != 0)
    throw Error(ExitStatus::fault, std::string("cannot make a pipe: ") + std::strerror(errno));
  const auto start = std::chrono::steady_clock::now();
  auto together = hold_interrupts();
  const pid_t child = ::fork();
  if (child == 0) execute(pointers, output, ends[1]);
  if (child < 0)
    throw Error(ExitStatus::fault, std::string("cannot start a process: ") + std::strerror(errno));
  const EndOnInterrupt guard(child);
  together.unlock();

  ProcessResult result;
  int unread = 0;
  if (output == ChildOutput::capture) {
    ::close(ends[1]);
    unread = read_all(ends[0], result.output);
    ::close(ends[0]);
  }
  int status = 0;
  rusage usage{};
  while (::wait4(child, &status, 0, &usage) < 0 && errno == EINTR) {
  }
  if (unread != 0)
    throw Error(ExitStatus::fault,
                "cannot read what " + program.string() + " says: " + std::strerror(unread));
  result.status = WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
  result.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  result.peak_memory_MB = static_cast<double>(usage.ru_maxrss) / 1024;
  return result;
}

std::optional<std::filesystem::path> find_program(const std::string& name) {
  const char* path = std::getenv("PATH");
  std::istringstream folders(path == nullptr ? "/usr/bin:/bin" : path);
  for (std::string folder; std::getline(folders, folder, ':');) {
    const std::filesystem::path program = std::filesystem::path(folder) / name;
    std::error_code unreadable;
    if (!folder.empty() && std::filesystem::is_regular_file(program, unreadable) &&
        ::access(program.c_str(), X_OK) == 0)
      return program;
  }
  return std::nullopt;
}

}  // namespace emmetrope
