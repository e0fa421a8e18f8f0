#include "segmentation/intake/process_limits.hpp"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>

#include "pipeline/base/sanitizers.hpp"

namespace emmetrope::segmentation {
namespace {

rlimit limits_of(decltype(RLIMIT_AS) what) {
  rlimit value{};
  if (::getrlimit(what, &value) != 0) ::_exit(1);
  return value;
}

void set(decltype(RLIMIT_AS) what, const rlimit& value) {
  if (::setrlimit(what, &value) != 0) ::_exit(1);
}

/// No higher than what the system already allows: a lower limit from outside stands.
void limit(decltype(RLIMIT_AS) what, rlim_t most) {
  const rlimit now = limits_of(what);
  set(what, {std::min(now.rlim_cur, most), std::min(now.rlim_max, most)});
}

/// Processor time used so far by this process.
double cpu_seconds() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

}  // namespace

void limit_process([[maybe_unused]] std::uint64_t memory_bytes) {
#ifndef EMMETROPE_UNDER_SANITIZER
  limit(RLIMIT_AS, memory_bytes);
#endif
  limit(RLIMIT_CORE, 0);
  limit(RLIMIT_FSIZE, 0);
  limit(RLIMIT_NOFILE, 32);
}

void limit_processor_time(double further_s) {
  const rlim_t most = limits_of(RLIMIT_CPU).rlim_max;
  set(RLIMIT_CPU, {std::min(most, static_cast<rlim_t>(std::ceil(cpu_seconds() + further_s))), most});
}

}  // namespace emmetrope::segmentation
