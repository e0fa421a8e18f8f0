/// What the program states of eyes in a world that its model does not know (docs/method/phantom.md), or in heads without
/// their faces, against the truth: the tables of docs/evidence/worlds.md. About ten seconds of processor time an eye.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "data_samples/phantom/world.hpp"
#include "pipeline/base/measured.hpp"
#include "tests/studies/stated_errors.hpp"
#include "tests/studies/study_eye.hpp"

using namespace emmetrope;
using namespace emmetrope::segmentation;

namespace {

struct Study {
  std::map<std::string, int> verdicts;
  std::map<std::string, int> by;  ///< "fit", "edges"
  std::array<StatedErrors, stated_quantities.size()> errors;
  int irregular = 0;

  void add(const Json& record) {
    ++verdicts[record.at("verdict")];
    const Json stated = record.value("stated", Json());
    if (stated.is_null()) return;
    bool by_edges = false;
    for (std::size_t i = 0; i < stated_quantities.size(); ++i) {
      const Json::json_pointer at(stated_quantities[i].pointer);
      if (!stated.contains(at) || is_withheld(stated.at(at))) continue;
      const auto measured = stated.at(at).get<Measured>();
      errors[i].add(measured, record.at("truth").at(at).get<double>());
      by_edges = by_edges || measured.method == "edges";
    }
    ++by[by_edges ? "edges" : "fit"];
    if (!by_edges && record.value("irregular_cornea", false)) ++irregular;
  }

  void print() const {
    for (const auto& [verdict, count] : verdicts) fmt::print("{} {}; ", count, verdict);
    for (const auto& [method, count] : by) fmt::print("by {} {}; ", method, count);
    fmt::print("irregular corneas {}\n\n", irregular);
    fmt::print(
        "| quantity | eyes | mean | rms | median | stated sigma | covered | largest, sd |\n"
        "| --- | --- | --- | --- | --- | --- | --- | --- |\n");
    int covered = 0;
    std::size_t of = 0;
    for (std::size_t i = 0; i < stated_quantities.size(); ++i) {
      const StatedErrors& e = errors[i];
      const std::size_t n = e.error.size();
      if (n == 0) continue;
      covered += e.covered();
      of += n;
      fmt::print("| {} | {} | {:+.2f} | {:.2f} | {:.2f} | {:.2f} | {:.0f} % | {:.1f} |\n",
                 stated_quantities[i].name, n, e.mean(), root_mean_square(e.error), e.median(),
                 root_mean_square(e.sigma), 100.0 * e.covered() / static_cast<double>(n),
                 e.largest_in_sigmas());
    }
    if (of > 0)
      fmt::print("| pooled | {} | | | | | {:.1f} % | |\n", of, 100.0 * covered / static_cast<double>(of));
  }
};

/// What was stated beyond so many standard deviations, and of which eye.
void print_worst(const Json& record, double beyond_sigmas) {
  const Json stated = record.value("stated", Json());
  if (stated.is_null()) return;
  for (const StatedQuantity& quantity : stated_quantities) {
    const Json::json_pointer at(quantity.pointer);
    if (!stated.contains(at) || is_withheld(stated.at(at))) continue;
    const auto measured = stated.at(at).get<Measured>();
    const double error = measured.value - record.at("truth").at(at).get<double>();
    if (std::abs(error) > beyond_sigmas * measured.sigma())
      fmt::print("{} {} {} {}: {:+.2f}, {:.1f} sd\n", record.at("seed").get<int>(),
                 record.at("laterality").get<std::string>(), quantity.name,
                 measured.method == "edges" ? "by edges" : "by fit", error,
                 std::abs(error) / measured.sigma());
  }
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("What is stated of eyes in a world that the model does not know, two eyes a head");
  StudyProtocol protocol;
  unsigned long long first = 1;
  int count = 1;
  std::filesystem::path cache;
  double worst = 3;
  app.add_option("--protocol", protocol.name, "surface-coil, head-t2, head-t1");
  app.add_option("--world", protocol.world, "Of the phantom")->check(CLI::IsMember(phantom::world_names()));
  app.add_flag("--defaced", protocol.defaced, "Nothing is left before a plane 4 to 10 mm behind the apices");
  app.add_option("--first", first, "Seed of the first head");
  app.add_option("--count", count, "Heads");
  app.add_option("--worst", worst, "Errors beyond so many standard deviations are told one by one");
  app.add_option("--cache", cache, "Folder of records; those that are there are not made again")->required();
  CLI11_PARSE(app, argc, argv);

  Study study;
  for (unsigned long long seed = first; seed < first + count; ++seed)
    for (const Json& record : cached_head(cache, protocol, seed)) {
      study.add(record);
      print_worst(record, worst);
    }
  fmt::print("\n{}: ", protocol.label());
  study.print();
  return 0;
}
