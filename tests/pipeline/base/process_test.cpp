#include "pipeline/base/process.hpp"

#include <gtest/gtest.h>

#include "pipeline/base/error.hpp"

namespace emmetrope {
namespace {

TEST(Process, CapturesOutputAndStatus) {
  const ProcessResult result =
      run_process("/bin/sh", {"-c", "printf '%s' \"$1\"; exit 6", "sh", "a b;c"}, ChildOutput::capture);
  EXPECT_EQ(result.status, 6);
  EXPECT_EQ(result.output, "a b;c");
  EXPECT_GT(result.peak_memory_MB, 0.1);
}

TEST(Process, TellsASignalFromAStatus) {
  EXPECT_EQ(run_process("/bin/sh", {"-c", "kill -9 $$"}, ChildOutput::discard).status, 128 + 9);
}

TEST(Process, NamesAProgramThatIsMissing) {
  EXPECT_THROW(run_process("/nowhere/x", {}, ChildOutput::discard), Error);
}

}  // namespace
}  // namespace emmetrope
