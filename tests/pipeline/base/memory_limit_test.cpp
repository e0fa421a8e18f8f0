// Under a limit from outside (ulimit) the commands work or say what they lack.
#include "pipeline/base/memory_limit.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

namespace emmetrope {
namespace {

/// Runs `check` in a process of its own that may have so much address space.
bool holds_under(rlim_t bytes, bool (*check)()) {
  const pid_t child = ::fork();
  if (child == 0) {
    const rlimit limit{bytes, bytes};
    if (::setrlimit(RLIMIT_AS, &limit) != 0) ::_exit(2);
    ::_exit(check() ? 0 : 1);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

TEST(MemoryLimit, IsToldWhereThereIsOne) {
  EXPECT_TRUE(holds_under(2'000'000'000, [] {
    return memory_limit_bytes() == 2'000'000'000U &&
           memory_limit_note() == ": this process may have 2000 MB (ulimit -v)";
  }));
  EXPECT_TRUE(
      holds_under(RLIM_INFINITY, [] { return !memory_limit_bytes() && memory_limit_note().empty(); }));
}

}  // namespace
}  // namespace emmetrope
