#include "pipeline/base/command_definition.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <cstdlib>

#include "pipeline/base/files.hpp"
#include "pipeline/base/process.hpp"

namespace emmetrope {
namespace {

TEST(CommandDefinition, TellsWhatACommandTakes) {
  CLI::App app;
  std::string study, mode, kind;
  std::vector<std::string> labels;
  bool deep = false;
  app.add_option("study", study, "Where")->required()->type_name("STUDY");
  app.add_option("-m,--mode", mode, "How")->check(CLI::IsMember({"fast", "slow"}))->type_name("MODE");
  app.add_option("--label", labels, "Whose")->type_name("LABEL ...");
  app.add_flag("--deep", deep, "Everything")->group("Common options");
  app.add_flag("--secret", deep, "Not shown")->group("");
  const Json definition = command_definition(app, {"look", "Looks.", "look here", {}, {}, {}, {"seen"}});
  EXPECT_EQ(definition.at("name"), "look");
  EXPECT_EQ(definition.at("result_keys"), Json({"seen"}));
  const Json& options = definition.at("options");
  std::vector<std::string> first_names;
  for (const Json& option : options) first_names.push_back(option.at("names").at(0));
  EXPECT_THAT(first_names, testing::ElementsAre("-h", "study", "-m", "--label", "--deep"));
  EXPECT_TRUE(options.at(1).at("is_positional").get<bool>());
  EXPECT_TRUE(options.at(1).at("is_required").get<bool>());
  EXPECT_EQ(options.at(1).at("value"), "STUDY");
  EXPECT_EQ(options.at(2).at("names"), Json({"-m", "--mode"}));
  EXPECT_EQ(options.at(2).at("value"), "MODE");
  EXPECT_EQ(options.at(2).at("choices"), Json({"fast", "slow"}));
  EXPECT_TRUE(options.at(3).at("takes_many").get<bool>());
  EXPECT_EQ(options.at(4).at("value"), "");
  EXPECT_TRUE(options.at(4).at("is_common").get<bool>());
}

/// What the build made of the definitions.
class CommandPages : public testing::Test {
 protected:
  static std::filesystem::path pages() {
    return std::filesystem::path(std::getenv("EMMETROPE_BIN")).parent_path() / "pages";
  }
  static ProcessResult bash(const std::string& script) {
    return run_process("/bin/bash", {"-c", script}, ChildOutput::capture);
  }
  /// What bash offers after these words.
  static std::string offered(const std::string& words) {
    return bash(". '" + (pages() / "bash" / "emmetrope").string() + "'; COMP_WORDS=(" + words +
                "); COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); _emmetrope; echo \"${COMPREPLY[*]}\"")
        .output;
  }
};

TEST_F(CommandPages, BashCompletesCommandsOptionsAndChoices) {
  EXPECT_EQ(offered("emmetrope coh"), "cohort\n");
  EXPECT_EQ(offered("emmetrope cohort --eng"), "--engine\n");
  EXPECT_EQ(offered("emmetrope cohort --engine s"), "slurm\n");
  EXPECT_EQ(offered("emmetrope pacs --study-"), "--study-uid --study-date\n");
}

TEST_F(CommandPages, ManualsAreOfEveryCommandAndFormatWithoutAWarning) {
  for (const auto& entry : std::filesystem::directory_iterator(pages() / "man1")) {
    if (!find_program("groff")) GTEST_SKIP() << "groff is not installed";
    const ProcessResult formatted =
        bash("groff -man -ww -Tutf8 '" + entry.path().string() + "' 2>&1 >/dev/null");
    EXPECT_EQ(formatted.output, "") << entry.path();
    EXPECT_THAT(read_file(entry.path()), testing::HasSubstr("Research use only")) << entry.path();
  }
  EXPECT_TRUE(std::filesystem::exists(pages() / "man1" / "emmetrope-segment.1"));
  EXPECT_TRUE(std::filesystem::exists(pages() / "man1" / "emmetrope.1"));
}

}  // namespace
}  // namespace emmetrope
