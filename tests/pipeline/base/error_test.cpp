#include <gtest/gtest.h>

#include <regex>
#include <set>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"

namespace emmetrope {
namespace {

std::set<int> numbers_in(const std::string& text, const std::regex& pattern) {
  std::set<int> numbers;
  for (std::sregex_iterator match(text.begin(), text.end(), pattern), end; match != end; ++match)
    numbers.insert(std::stoi((*match)[1]));
  return numbers;
}

TEST(ExitStatus, PageForUsersListsWhatTheProgramKnows) {
  const std::string header = read_file(data_folder() / "pipeline/base/error.hpp");
  const std::string page = read_file(data_folder() / "docs/use/exit-status.md");
  const auto in_program = numbers_in(header, std::regex(R"(\n  \w+ = (\d+),)"));
  EXPECT_EQ(in_program.size(), 11U);
  EXPECT_EQ(numbers_in(page, std::regex(R"(\n\| (\d+) \|)")), in_program);
}

}  // namespace
}  // namespace emmetrope
