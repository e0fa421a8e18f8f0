#pragma once
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pipeline/base/files.hpp"
#include "pipeline/base/process.hpp"
#include "pipeline/report/stage.hpp"
#include "tests/support/fixture_case.hpp"

namespace emmetrope::report {

namespace fs = std::filesystem;

/// A case of its own for one test, removed afterwards.
class ReportTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ =
        fs::path(::testing::TempDir()) /
        (std::string("emmetrope-report-") + ::testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::remove_all(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  Answer report(const fs::path& study = {}, bool identified = false) const {
    CommonOptions common;
    common.verbosity.quiet = true;
    return write_report({folder_, study, identified}, common);
  }
  std::string output(const std::string& name) const { return read_file(folder_ / "report" / name); }
  std::string pdf_text() const {
    return output_of("/usr/bin/pdftotext", {"-layout", (folder_ / "report" / "report.pdf").string(), "-"});
  }
  std::string dump(const std::string& name) const {
    return output_of("/usr/bin/dcmdump", {"+L", (folder_ / "report" / name).string()});
  }
  static std::string output_of(const fs::path& program, const std::vector<std::string>& arguments) {
    return run_process(program, arguments, ChildOutput::capture).output;
  }

  fs::path folder_;
};

/// The words of a page without its markup, scripts and pictures.
inline std::string visible_text(const std::string& html) {
  std::string text = html.substr(html.find("<body>"));
  std::string out;
  for (std::size_t at = 0; at < text.size();) {
    if (text.compare(at, 7, "<script") == 0) {
      at = text.find("</script>", at) + 9;
    } else if (text[at] == '<') {
      at = text.find('>', at) + 1;
      out += ' ';
    } else {
      out += text[at++];
    }
  }
  return out;
}

}  // namespace emmetrope::report
