// Machines on which PoCL would end the process: another /tmp and /sys than usual, in a mount namespace of the test's own.
#include "raytrace/device/opencl.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>

#include "pipeline/base/process.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope::raytrace {
namespace {

/// `emmetrope devices` after `preparation` (shell), which sees FOLDER as $1; its kernels go to FOLDER/kernels.
ProcessResult devices_after(const std::string& preparation, const test::TemporaryFolder& folder) {
  return run_process(
      "/usr/bin/unshare",
      {"--mount", "/bin/sh", "-c",
       preparation + " && POCL_CACHE_DIR=\"$1/kernels\" exec \"$EMMETROPE_BIN/emmetrope-devices\" 2>&1", "sh",
       folder.path().string()},
      ChildOutput::capture);
}

class OddMachine : public testing::Test {
 protected:
  void SetUp() override {
    if (run_process("/usr/bin/unshare",
                    {"--mount", "/bin/mount", "-t", "tmpfs", "tmpfs", folder_.path().string()},
                    ChildOutput::discard)
            .status != 0)
      GTEST_SKIP() << "mounts of a test's own are not allowed here: run it as root";
  }
  test::TemporaryFolder folder_;
};

TEST_F(OddMachine, AFolderFromWhichNothingMayRunIsRefusedByName) {
  const ProcessResult result = devices_after("mount -t tmpfs -o noexec tmpfs \"$1\"", folder_);
  EXPECT_EQ(result.status, 7) << result.output;
  EXPECT_THAT(result.output, testing::HasSubstr(folder_.path().string() + "/kernels (mounted noexec, say)"));
  EXPECT_THAT(result.output, testing::HasSubstr("set POCL_CACHE_DIR"));
}

TEST_F(OddMachine, WithoutSysTheProcessorIsStillADevice) {
  const ProcessResult result = devices_after("mount -t tmpfs tmpfs /sys", folder_);
  EXPECT_EQ(result.status, 0) << result.output;
  EXPECT_THAT(result.output, testing::HasSubstr("compute units"));
}

}  // namespace
}  // namespace emmetrope::raytrace
