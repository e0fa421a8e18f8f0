#include "pipeline/base/scratch_folder.hpp"

#include <gtest/gtest.h>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope {
namespace {

namespace fs = std::filesystem;

TEST(ScratchFolder, IsEmptyAtFirstAndGoneAtTheEnd) {
  const test::TemporaryFolder place;
  const fs::path path = place.path() / "deep" / ".writing";
  fs::create_directories(path);
  write_file(path / "left over", "from a run that was killed");
  {
    const ScratchFolder scratch(path);
    EXPECT_TRUE(fs::is_empty(scratch.path()));
    write_file(scratch.path() / "part", "half");
  }
  EXPECT_FALSE(fs::exists(path));
  EXPECT_TRUE(fs::exists(path.parent_path()));
}

TEST(ScratchFolder, SaysThatItCannotBeMade) {
  const test::TemporaryFolder place;
  write_file(place.path() / "file", "in the way");
  try {
    const ScratchFolder scratch(place.path() / "file" / "below");
    ADD_FAILURE() << "a folder below a file";
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), ExitStatus::not_writable);
  }
}

}  // namespace
}  // namespace emmetrope
