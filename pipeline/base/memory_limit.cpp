#include "pipeline/base/memory_limit.hpp"

#include <fmt/format.h>
#include <sys/resource.h>

namespace emmetrope {

std::optional<std::uint64_t> memory_limit_bytes() {
  rlimit limit{};
  if (::getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return std::nullopt;
  return limit.rlim_cur;
}

std::string memory_limit_note() {
  const auto limit = memory_limit_bytes();
  return limit ? fmt::format(": this process may have {} MB (ulimit -v)", *limit / 1'000'000) : "";
}

}  // namespace emmetrope
