#include "pipeline/base/interrupt.hpp"

#include <pthread.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <system_error>
#include <thread>
#include <vector>

namespace emmetrope {
namespace {

struct Registered {
  std::recursive_mutex mutex;
  std::vector<std::filesystem::path> paths;
  std::vector<pid_t> children;
};

/// Never destroyed: the waiting thread may use it while the program ends.
Registered& registered() {
  static auto* instance = new Registered;
  return *instance;
}

sigset_t interrupt_signals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  return signals;
}

void end_child(pid_t child, int signal) {
  ::kill(child, signal);
  for (int tries = 0; tries < 100; ++tries) {
    const pid_t ended = ::waitpid(child, nullptr, WNOHANG);
    if (ended == child || ended < 0) return;
    ::usleep(10'000);
  }
  ::kill(child, SIGKILL);
}

void wait_for_signal() {
  const sigset_t signals = interrupt_signals();
  int signal = 0;
  if (sigwait(&signals, &signal) != 0) return;
  auto& state = registered();
  const std::lock_guard lock(state.mutex);
  for (const pid_t child : state.children) end_child(child, signal);
  std::error_code ignored;
  for (const auto& path : state.paths) std::filesystem::remove_all(path, ignored);
  ::_exit(128 + signal);
}

}  // namespace

void handle_interrupts() {
  const sigset_t signals = interrupt_signals();
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
  try {
    std::thread(wait_for_signal).detach();
  } catch (const std::system_error&) {  // no thread to be had: a signal ends the process as it is
    pthread_sigmask(SIG_UNBLOCK, &signals, nullptr);
  }
}

RemoveOnInterrupt::RemoveOnInterrupt(std::filesystem::path path) : path_(std::move(path)) {
  const std::lock_guard lock(registered().mutex);
  registered().paths.push_back(path_);
}

RemoveOnInterrupt::~RemoveOnInterrupt() {
  const std::lock_guard lock(registered().mutex);
  auto& paths = registered().paths;
  paths.erase(std::find(paths.begin(), paths.end(), path_));
}

EndOnInterrupt::EndOnInterrupt(pid_t child) : child_(child) {
  const std::lock_guard lock(registered().mutex);
  registered().children.push_back(child_);
}

EndOnInterrupt::~EndOnInterrupt() {
  const std::lock_guard lock(registered().mutex);
  auto& children = registered().children;
  children.erase(std::find(children.begin(), children.end(), child_));
}

std::unique_lock<std::recursive_mutex> hold_interrupts() { return std::unique_lock(registered().mutex); }

void restore_signals_in_child() {
  const sigset_t signals = interrupt_signals();
  sigprocmask(SIG_UNBLOCK, &signals, nullptr);
  std::signal(SIGPIPE, SIG_DFL);
  std::signal(SIGXFSZ, SIG_DFL);
}

}  // namespace emmetrope
