#include "pipeline/base/files.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <csignal>
#include <fstream>

#include "pipeline/base/error.hpp"
#include "pipeline/base/json.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope {
namespace {

TEST(Sha256, MatchesFips180) {
  // FIPS 180-4 examples "abc" and the empty message.
  EXPECT_EQ(sha256_of("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(sha256_of(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
}

TEST(WriteFile, ReplacesWholeFiles) {
  const test::TemporaryFolder folder;
  const auto file = folder.path() / "a.txt";
  write_file(file, "first");
  write_file(file, std::string(100'000, 'x'));
  EXPECT_EQ(read_file(file), std::string(100'000, 'x'));
  EXPECT_EQ(sha256_of_file(file), sha256_of(std::string(100'000, 'x')));
}

TEST(WriteFile, LeavesPipesAndFoldersAsTheyAre) {
  const test::TemporaryFolder folder;
  const auto pipe = folder.path() / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  for (const auto& taken : {pipe, folder.path()}) {
    const auto before = std::filesystem::status(taken).type();
    try {
      write_file(taken, "bytes");
      ADD_FAILURE() << taken;
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::not_writable);
    }
    EXPECT_EQ(std::filesystem::status(taken).type(), before);
  }
}

TEST(WriteFile, LeavesTheOldFileWhenTheDiskIsFull) {
  // A file size limit stands for a full disk: the write fails half way.
  const test::TemporaryFolder folder;
  const auto file = folder.path() / "a.txt";
  write_file(file, "old");
  std::signal(SIGXFSZ, SIG_IGN);
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  rlimit small = before;
  small.rlim_cur = 1000;
  setrlimit(RLIMIT_FSIZE, &small);
  ExitStatus status = ExitStatus::done;
  try {
    write_file(file, std::string(100'000, 'x'));
  } catch (const Error& error) {
    status = error.status();
  }
  setrlimit(RLIMIT_FSIZE, &before);
  EXPECT_EQ(status, ExitStatus::not_writable);
  EXPECT_EQ(read_file(file), "old");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1);
}

TEST(ReadJson, NamesFileAndPlaceOfASyntaxError) {
  const test::TemporaryFolder folder;
  const auto file = folder.path() / "broken.json";
  std::ofstream(file) << "{\"a\": 1,\n \"b\" 2}";
  try {
    read_json(file);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), ExitStatus::input_invalid);
    EXPECT_NE(std::string(error.what()).find("broken.json"), std::string::npos);
    EXPECT_NE(std::string(error.what()).find("line 2"), std::string::npos);
  }
}

TEST(ReadJson, RefusesWhatNoDoubleHoldsAndWhatIsNestedWithoutEnd) {
  const test::TemporaryFolder folder;
  for (const std::string& text : {std::string(R"({"radius_mm": 1e999})"), std::string(200000, '[')}) {
    write_file(folder.path() / "eye.json", text);
    try {
      read_json(folder.path() / "eye.json");
      ADD_FAILURE() << text.substr(0, 30);
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::input_invalid);
      EXPECT_NE(std::string(error.what()).find("eye.json"), std::string::npos);
    }
  }
}

TEST(ReadFile, RefusesFoldersAndFifos) {
  const test::TemporaryFolder folder;
  EXPECT_THROW(read_file(folder.path()), Error);
  EXPECT_THROW(read_file(folder.path() / "missing"), Error);
  // What may never end is not begun, be it read or only hashed, and through a link too.
  const auto fifo = folder.path() / "fifo", link = folder.path() / "link";
  ASSERT_EQ(::mkfifo(fifo.c_str(), 0600), 0);
  std::filesystem::create_symlink("/dev/zero", link);
  for (const auto& endless : {fifo, link, std::filesystem::path("/dev/zero")}) {
    EXPECT_THROW(read_file(endless), Error) << endless;
    EXPECT_THROW(sha256_of_file(endless), Error) << endless;
  }
}

}  // namespace
}  // namespace emmetrope
