#include "pipeline/cohort/sweep/sweep_table.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope::cohort {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;

class SweepTable : public testing::Test {
 protected:
  Sweep read(const std::string& text) const {
    write_file(file(), text);
    return read_sweep(file());
  }
  std::string refusal(const std::string& text) const {
    try {
      read(text);
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::input_invalid);
      return error.what();
    }
    return "none";
  }
  fs::path file() const { return temporary_.path() / "sweep.toml"; }
  test::TemporaryFolder temporary_;
};

TEST_F(SweepTable, HasEveryCombinationInTheOrderOfTheFile) {
  const Sweep sweep = read(
      "command = 'trace'\n[all]\nsamples = 64\ndiffraction = true\nilluminance = false\n"
      "[vary]\npupil = [2, 4.5]\neye = ['navarro', 'le-grand', 'arizona']\n");
  EXPECT_EQ(sweep.command, "trace");
  ASSERT_EQ(sweep.fixed.size(), 3U);
  EXPECT_THAT(sweep.fixed[0].words, ElementsAre("--samples=64"));
  EXPECT_THAT(sweep.fixed[1].words, ElementsAre("--diffraction"));
  EXPECT_TRUE(sweep.fixed[2].words.empty());
  ASSERT_EQ(sweep.runs.size(), 6U);
  EXPECT_EQ(sweep.runs[0][0].text, "2");
  EXPECT_EQ(sweep.runs[0][1].text, "navarro");
  EXPECT_EQ(sweep.runs[1][1].text, "le-grand");
  EXPECT_THAT(sweep.runs[5][0].words, ElementsAre("--pupil=4.5"));
}

TEST_F(SweepTable, AFileIsFoundFromTheTable) {
  write_file(temporary_.path() / "my.json", "{}");
  const Sweep sweep = read("command = 'trace'\n[vary]\neye = ['my.json', 'navarro']\n");
  EXPECT_EQ(sweep.runs[0][0].text, (temporary_.path() / "my.json").string());
  EXPECT_EQ(sweep.runs[1][0].text, "navarro");
}

TEST_F(SweepTable, AListInAListIsSeveralWords) {
  const Sweep sweep = read("command = 'trace'\n[vary]\ndisc = [['od:4,0', 'os:-4,0']]\n");
  EXPECT_THAT(sweep.runs[0][0].words, ElementsAre("--disc", "od:4,0", "os:-4,0"));
}

/// toml++ 3.3 nests the tables of a dotted key as deep as it is long, beyond the stack (found by fuzzing).
TEST_F(SweepTable, AKeyOfManyPartsIsRefused) {
  std::string key = "a", numbers = "0.5";
  for (int i = 0; i < 100'000; ++i) key += ".a";
  for (int i = 1; i < 400; ++i) numbers += fmt::format(", {}.5", i);
  EXPECT_THAT(refusal(key + " = 1\n"), HasSubstr("line 1: a key of more than 100 parts"));
  EXPECT_THAT(refusal("command = 'trace'\n[" + key + "]\n"),
              HasSubstr("line 2: a key of more than 100 parts"));
  EXPECT_EQ(read("command = 'trace'\n[vary]\npupil = [" + numbers + "]\n").runs.size(), 400U);
}

/// On U+0150 outside a text toml++ 3.3 is undefined (found by fuzzing).
TEST_F(SweepTable, LettersBeyondAsciiStandInTextsAndComments) {
  for (const char* quote : {"'", "\"", "'''", "\"\"\""}) {
    const Sweep sweep =
        read(fmt::format("command = 'trace' # \u0150's \"\n[vary]\neye = [{0}\u0150{0}]\n", quote));
    EXPECT_EQ(sweep.runs[0][0].text, "\u0150") << quote;
  }
  EXPECT_EQ(read("command = 'trace'\n[vary]\neye = [\"\\\"\u0150\"]\n").runs[0][0].text, "\"\u0150");
  EXPECT_EQ(read("command = 'trace'\n[vary]\neye = ['''\u0150'''', '\u0150']\n").runs[0][0].text, "\u0150'");
  EXPECT_EQ(read("\xEF\xBB\xBF"
                 "command = 'trace'\n[vary]\neye = ['a']\n")
                .runs[0][0]
                .text,
            "a");
  EXPECT_THAT(refusal("\u0150"), HasSubstr("line 1: a letter beyond ASCII"));
  EXPECT_THAT(refusal(std::string("command = 6t\0 2B)\"b\u01FD)\"", 19)), HasSubstr("line 1, column"));
  EXPECT_EQ(read("\xEF\xBB\xBF\"command\" = 'trace'\n[vary]\neye = ['a', '\u0150', '\u0151']\n").runs.size(),
            3U);
  EXPECT_THAT(refusal("command = 'trace'\n[vary]\n\u0150 = [1]\n"),
              HasSubstr("line 3: a letter beyond ASCII"));
}

TEST_F(SweepTable, SaysWhereItIsWrong) {
  EXPECT_THAT(refusal("command = 'trace'\n[vary]\npupil = [2,\n"), HasSubstr("line"));
  EXPECT_THAT(refusal("command = 'report'\n"), HasSubstr("command is \"report\""));
  EXPECT_THAT(refusal("[vary]\npupil = [2]\n"), HasSubstr("command is \"\""));
  EXPECT_THAT(refusal("command = 'trace'\n[vary]\npupil = 2\n"), HasSubstr("line 3, pupil"));
  EXPECT_THAT(refusal("command = 'trace'\n[vary]\npupil = []\n"), HasSubstr("line 3, pupil"));
  EXPECT_THAT(refusal("command = 'trace'\n[all]\noutput = 'x'\n"), HasSubstr("sets this itself"));
  EXPECT_THAT(refusal("command = 'eye'\n[all]\nversion = true\n"), HasSubstr("sets this itself"));
  EXPECT_THAT(refusal("command = 'trace'\n[all]\npupil = 2\n[vary]\npupil = [1]\n"),
              HasSubstr("in [all] too"));
  EXPECT_THAT(refusal("command = 'trace'\n[vary]\npupil = [2, 3,\n3.0]\n"),
              HasSubstr("line 4, pupil: 3 is there twice"));
  EXPECT_THAT(refusal("command = 'trace'\n[vary]\npupil = ['3', 3]\n"), HasSubstr("3 is there twice"));
  EXPECT_THAT(refusal("command = 'trace'\n[columns]\ncoma = '/a~x'\n"), HasSubstr("JSON pointer"));
  EXPECT_THAT(refusal("command = 'trace'\n[very]\npupil = [1]\n"), HasSubstr("line 2, very"));
  EXPECT_THAT(refusal("command = 'trace'\n[all]\npupil = 2001-01-01\n"), HasSubstr("expected a number"));
  EXPECT_THAT(refusal("command = 'trace'\n[columns]\ncoma = 'x'\n"), HasSubstr("JSON pointer"));
  for (const char* column : {"pupil", "run", "status", "message"})
    EXPECT_THAT(
        refusal(fmt::format("command = 'trace'\n[vary]\npupil = [2]\n[columns]\n{} = '/rms_um'\n", column)),
        HasSubstr(fmt::format("line 5, {}: the table has that column already", column)));
  std::string many = "command = 'trace'\n[vary]\n";
  for (const char* key : {"a", "b", "c", "d", "e", "f"})
    many += std::string(key) + " = [0,1,2,3,4,5,6,7,8,9]\n";
  EXPECT_THAT(refusal(many), HasSubstr("more than 100000"));
}

}  // namespace
}  // namespace emmetrope::cohort
