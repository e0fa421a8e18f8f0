#include "raytrace/mat_file.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope::raytrace {
namespace {

TEST(WriteMat, LeavesTheOldFileWhenTheDiskIsFull) {
  const test::TemporaryFolder folder;
  const auto file = folder.path() / "a.mat";
  write_file(file, "old");
  std::vector<MatVariable> variables;
  for (const char* name : {"a", "b"})
    variables.emplace_back(name, std::vector<std::size_t>{1, 100}, std::vector<double>(100, 1.0));
  // The tag of a variable, its flags, size and name, the tag of its numbers, and these.
  constexpr rlim_t header = 128, one = 8 + 16 + 16 + 8 + 8 + 100 * 8;
  // A file size limit stands for a full disk.
  std::signal(SIGXFSZ, SIG_IGN);
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  for (const rlim_t room : {rlim_t{0}, header + one / 2, header + one, header + 2 * one - 1}) {
    rlimit small = before;
    small.rlim_cur = room;
    setrlimit(RLIMIT_FSIZE, &small);
    ExitStatus status = ExitStatus::done;
    try {
      write_mat(file, variables);
    } catch (const Error& error) {
      status = error.status();
    }
    setrlimit(RLIMIT_FSIZE, &before);
    EXPECT_EQ(status, ExitStatus::not_writable) << room;
    EXPECT_EQ(read_file(file), "old") << room;
  }
  write_mat(file, variables);
  EXPECT_EQ(std::filesystem::file_size(file), header + 2 * one);
}

}  // namespace
}  // namespace emmetrope::raytrace
