#include "pipeline/report/figures/chart.hpp"

#include <fmt/format.h>
#include <stdlib.h>

#include <boost/algorithm/string/replace.hpp>
#include <cstdlib>
#include <filesystem>
#include <sstream>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/interrupt.hpp"
#include "pipeline/base/log.hpp"
#include "pipeline/base/process.hpp"

namespace emmetrope::report {
namespace {

namespace fs = std::filesystem;

/// A private folder for one gnuplot run, removed at the end and on an interrupt.
class TemporaryFolder {
 public:
  TemporaryFolder() : path_(make()), on_interrupt_(path_) {}
  ~TemporaryFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  const fs::path& path() const { return path_; }

 private:
  static fs::path make() {
    std::string name = (fs::temp_directory_path() / "emmetrope-chart-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) throw output_error("cannot make a folder like " + name);
    return name;
  }
  fs::path path_;
  RemoveOnInterrupt on_interrupt_;
};

/// Several charts share one page: identifiers get the figure's id in front, and the page's colour is the ink.
std::string for_page(std::string svg, const std::string& id) {
  svg.erase(0, svg.find("<svg"));
  for (const char* name : {"gpDot", "gpPt", "textbox", "greybox", "gnuplot_"})
    for (const char* before : {"id='", "id=\"", "'#", "\"#", "(#"})
      boost::replace_all(svg, std::string(before) + name, before + id + "-" + name);
  for (const char* black : {"'black'", "\"black\"", "'rgb(  0,   0,   0)'", "\"rgb(0,0,0)\""})
    boost::replace_all(svg, black, "\"currentColor\"");
  return svg;
}

}  // namespace

bool draw_chart(Figure& figure, const std::string& script) {
  const auto gnuplot = find_program("gnuplot");
  if (!gnuplot) return false;
  const TemporaryFolder folder;
  const fs::path script_file = folder.path() / "chart.gp", svg_file = folder.path() / "chart.svg";
  write_file(script_file,
             fmt::format("set encoding utf8\n"
                         "set terminal svg size {},{} dynamic font 'DejaVu Sans,11'\n"
                         "set output '{}'\n"
                         "set border 3\nset tics nomirror\nset grid ytics back lw 0.4 lc rgb '#b8c0c8'\n",
                         figure.width_px, figure.height_px, svg_file.string()) +
                 script);
  // In a locale without UTF-8 gnuplot complains of its own degree sign.
  const auto result = run_process("/usr/bin/env", {"LC_ALL=C.UTF-8", gnuplot->string(), script_file.string()},
                                  ChildOutput::discard);
  if (result.status != 0 || !fs::exists(svg_file)) {
    spdlog::warn("gnuplot could not draw the figure {} (status {})", figure.id, result.status);
    return false;
  }
  figure.svg = for_page(read_file(svg_file), figure.id);
  return !figure.svg.empty();
}

}  // namespace emmetrope::report
