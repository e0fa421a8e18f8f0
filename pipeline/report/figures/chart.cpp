#include "pipeline/report/figures/chart.hpp"

#include <fmt/format.h>
#include <stdlib.h>

#include <boost/algorithm/string/predicate.hpp>
#include <boost/algorithm/string/replace.hpp>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <cstring>
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
    const char* named = std::getenv("TMPDIR");
    const fs::path parent = named == nullptr || *named == '\0' ? fs::path("/tmp") : fs::path(named);
    std::string name = (parent / "emmetrope-chart-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr)
      throw output_error(fmt::format("cannot make a folder for temporary files in {} (TMPDIR): {}",
                                     parent.string(), std::strerror(errno)),
                         "set TMPDIR to a folder that can be written");
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
  const fs::path script_file = folder.path() / "chart.gp";
  write_file(script_file,
             fmt::format("set encoding utf8\n"
                         "set terminal svg size {},{} dynamic font 'DejaVu Sans,11'\n"
                         "set border 3\nset tics nomirror\nset grid ytics back lw 0.4 lc rgb '#b8c0c8'\n",
                         figure.width_px, figure.height_px) +
                 script);
  // Through a pipe: gnuplot does not notice what it cannot write into a file. In a locale without UTF-8 it complains, on
  // standard error, of its own degree sign.
  const auto result = run_process("/usr/bin/env", {"LC_ALL=C.UTF-8", gnuplot->string(), script_file.string()},
                                  ChildOutput::capture);
  if (result.status != 0 || !boost::contains(result.output, "</svg>")) {
    spdlog::warn("gnuplot could not draw the figure {} (status {})", figure.id, result.status);
    return false;
  }
  figure.svg = for_page(result.output, figure.id);
  return true;
}

std::string examiner_axes(double reach, double step, const std::string& x_label, const std::string& y_label,
                          bool is_right_eye) {
  return fmt::format(
      "unset grid\nset size ratio -1\nset border 0\nset tics scale 0\nset xrange [-{0}:{0}]\nset yrange [-{0}:{0}]\n"
      "set xtics -{1},{2},{1}\nset ytics -{1},{2},{1}\nset xlabel '{3}'\nset ylabel '{4}' offset 1\n"
      "set label 1 '{5}' at -{6},0 center\nset label 2 '{7}' at {6},0 center\n"
      "set label 3 'S' at 0,{6} center\nset label 4 'I' at 0,-{6} center\nunset key\n",
      reach * 1.18, std::floor(reach / step) * step, step, x_label, y_label, is_right_eye ? "T" : "N",
      reach * 1.09, is_right_eye ? "N" : "T");
}

}  // namespace emmetrope::report
