#pragma once
#include <chrono>
#include <cstddef>
#include <mutex>
#include <string>

namespace emmetrope {

/// How a command speaks while it works; standard error only.
struct Verbosity {
  bool quiet = false;  ///< no progress, no notes; warnings and errors still appear
};

/// Progress of one piece of work: a bar with the time left on a terminal, a line now and then on a pipe,
/// nothing when quiet. Thread-safe.
class Progress {
 public:
  /// \param doing  what is done, in the user's words: "fitting the right eye"
  /// \param total  steps of about equal duration
  Progress(std::string doing, std::size_t total, Verbosity verbosity);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void advance(std::size_t steps = 1);

 private:
  void draw(bool last);

  std::string doing_;
  std::size_t total_;
  std::size_t done_ = 0;
  bool quiet_;
  bool terminal_;
  std::chrono::steady_clock::time_point start_;
  std::chrono::steady_clock::time_point drawn_;
  std::mutex mutex_;
};

}  // namespace emmetrope
