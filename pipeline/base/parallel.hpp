#pragma once
#include <algorithm>
#include <atomic>
#include <cstddef>
#include <exception>
#include <mutex>
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
  const std::size_t most = std::min(static_cast<std::size_t>(std::max(threads, 1)), count);
  workers.reserve(most);
  try {
    for (std::size_t t = 1; t < most; ++t) workers.emplace_back(run);
  } catch (const std::exception&) {  // no more threads, or memory for one: those that there are do the work
  }
  run();
  for (auto& worker : workers) worker.join();
  if (fault) std::rethrow_exception(fault);
}

}  // namespace emmetrope
