#include "pipeline/base/progress.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace emmetrope {
namespace {

std::string describe_seconds(double seconds) {
  const auto whole = std::lround(seconds);
  return whole < 60 ? fmt::format("{} s", whole) : fmt::format("{} min {:02} s", whole / 60, whole % 60);
}

}  // namespace

Progress::Progress(std::string doing, std::size_t total, Verbosity verbosity)
    : doing_(std::move(doing)),
      total_(std::max<std::size_t>(total, 1)),
      quiet_(verbosity.quiet),
      terminal_(::isatty(STDERR_FILENO) == 1),
      start_(std::chrono::steady_clock::now()),
      drawn_(start_) {
  if (!quiet_ && terminal_) draw(false);
}

Progress::~Progress() {
  if (quiet_) return;
  const std::lock_guard lock(mutex_);
  draw(true);
}

void Progress::advance(std::size_t steps) {
  const std::lock_guard lock(mutex_);
  done_ = std::min(total_, done_ + steps);
  if (quiet_ || done_ == total_) return;  // the last line is the destructor's
  const auto now = std::chrono::steady_clock::now();
  const auto interval = terminal_ ? std::chrono::milliseconds(100) : std::chrono::seconds(10);
  if (now - drawn_ < interval) return;
  drawn_ = now;
  draw(false);
}

void Progress::draw(bool last) {
  const double elapsed_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  const double fraction = static_cast<double>(done_) / static_cast<double>(total_);
  const std::string time = last              ? describe_seconds(elapsed_s)
                           : fraction > 0.02 ? describe_seconds(elapsed_s / fraction - elapsed_s) + " left"
                                             : std::string();
  if (terminal_) {
    constexpr int width = 30;
    const int filled = static_cast<int>(fraction * width);
    const std::string bar = std::string(filled, '#') + std::string(width - filled, '.');
    std::fputs(
        fmt::format("\r\x1b[K{:<34} [{}] {:3.0f} % {}{}", doing_, bar, 100 * fraction, time, last ? "\n" : "")
            .c_str(),
        stderr);
  } else {
    std::fputs(fmt::format("{}: {:.0f} % {}\n", doing_, 100 * fraction, time).c_str(), stderr);
  }
  std::fflush(stderr);
}

}  // namespace emmetrope
