#pragma once
#include <atomic>
#include <cstddef>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

namespace emmetrope {

/// Calls work(k) for k = 0 ... count - 1, each once, on so many threads, or as many as the system gives; when all have
/// ended, rethrows what one of them threw.
template <typename Work>
void on_threads(int threads, std::size_t count, const Work& work) {
  std::atomic<std::size_t> next{0};
  std::mutex mutex;
  std::exception_ptr fault;
  const auto run = [&] {
    try {
      for (std::size_t k = next++; k < count; k = next++) work(k);
    } catch (...) {
      const std::lock_guard<std::mutex> lock(mutex);
      fault = std::current_exception();
      next = count;
    }
  };
  std::vector<std::thread> workers;
  try {
    for (int t = 1; t < threads; ++t) workers.emplace_back(run);
  } catch (const std::system_error&) {  // no more threads: those that there are do the work
  }
  run();
  for (auto& worker : workers) worker.join();
  if (fault) std::rethrow_exception(fault);
}

}  // namespace emmetrope
