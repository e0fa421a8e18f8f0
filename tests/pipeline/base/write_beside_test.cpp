#include "pipeline/base/write_beside.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope {
namespace {

namespace fs = std::filesystem;

bool put(const fs::path& file, const char* text) { return static_cast<bool>(std::ofstream(file) << text); }

TEST(WriteBeside, TakesTheTargetsPlaceOrLeavesIt) {
  const test::TemporaryFolder folder;
  const fs::path file = folder.path() / "movie.mp4";
  write_beside(file, [&](const fs::path& part) {
    EXPECT_EQ(part.extension(), ".mp4");
    EXPECT_NE(part, file);
    return put(part, "first");
  });
  EXPECT_EQ(read_file(file), "first");
  EXPECT_THROW(write_beside(file, [](const fs::path& part) { return put(part, "half") && false; }), Error);
  EXPECT_THROW(write_beside(file, [](const fs::path&) { return true; }), Error);  // that wrote nothing
  EXPECT_THROW(write_beside(file,
                            [](const fs::path& part) -> bool {
                              put(part, "x");
                              throw std::runtime_error("");
                            }),
               std::runtime_error);
  EXPECT_EQ(read_file(file), "first");
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), fs::directory_iterator()), 1);
  try {
    write_beside(folder.path() / "none" / "a.mat", [](const fs::path& part) { return put(part, "x"); });
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), ExitStatus::not_writable);
  }
}

}  // namespace
}  // namespace emmetrope
