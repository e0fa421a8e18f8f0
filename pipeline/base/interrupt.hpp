#pragma once
#include <filesystem>
#include <functional>
#include <mutex>

#include <sys/types.h>

/// Ctrl-C and SIGTERM end a command within a moment and leave nothing behind: one thread waits for the
/// signals, kills registered children, removes registered folders and leaves with status 130 or 143. No stage
/// has to poll.
namespace emmetrope {

/// Blocks SIGINT and SIGTERM in all threads and starts the waiting thread; ignores SIGPIPE and SIGXFSZ, so
/// that they become write errors. To be called first in main; `run_command` does.
void handle_interrupts();

/// While it lives, an interrupt removes this folder (or file).
class RemoveOnInterrupt {
 public:
  explicit RemoveOnInterrupt(std::filesystem::path path);
  ~RemoveOnInterrupt();
  RemoveOnInterrupt(const RemoveOnInterrupt&) = delete;
  RemoveOnInterrupt& operator=(const RemoveOnInterrupt&) = delete;

 private:
  std::filesystem::path path_;
};

/// While it lives, an interrupt is passed on to this child process and waits up to a second for its end.
class EndOnInterrupt {
 public:
  explicit EndOnInterrupt(pid_t child);
  ~EndOnInterrupt();
  EndOnInterrupt(const EndOnInterrupt&) = delete;
  EndOnInterrupt& operator=(const EndOnInterrupt&) = delete;

 private:
  pid_t child_;
};

/// While it is held, an interrupt waits: for the few renames that must happen together.
std::unique_lock<std::recursive_mutex> hold_interrupts();

/// In a child made by fork: signals act as usual again.
void restore_signals_in_child();

}  // namespace emmetrope
