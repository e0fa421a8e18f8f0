/// Fits that start where no eye is, or not this one, and what the gates say of them: docs/evidence/real-scans.md, "Misled on
/// purpose". About ten seconds of processor time a start in T1.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/parallel.hpp"
#include "tests/studies/judged_scan.hpp"

using namespace emmetrope;
using namespace emmetrope::segmentation;
using Eigen::Vector3d;

namespace {

/// A mistake of the finder's: where the eye, and where it looks. Or of the fit alone, as the finder takes no two globes
/// for one.
struct Mistake {
  std::string name;
  std::function<void(FoundEye& eye, const FoundEye& fellow)> make;
  bool of_the_fit = false;
};

Vector3d centre_of(const FoundEye& eye) { return eye.views.front().globe.centre; }

void move(FoundEye& eye, const Vector3d& by_mm) {
  for (EyeView& view : eye.views) view.globe.centre += by_mm;
}

/// To a place behind (+y) and above (+z) the middle of both eyes.
void move_to_midline(FoundEye& eye, const FoundEye& fellow, double behind_mm, double above_mm) {
  move(eye, (centre_of(fellow) - centre_of(eye)) / 2 + Vector3d(0, behind_mm, above_mm));
}

void look(FoundEye& eye, const Vector3d& away) {
  eye.axis = (eye.axis + away).normalized();
  eye.other_axis.reset();
}

const std::vector<Mistake>& mistakes() {
  static constexpr double half_an_eye_mm = 12;
  const auto off = [](const Vector3d& direction) {
    return [direction](FoundEye& eye, const FoundEye&) { move(eye, half_an_eye_mm * direction); };
  };
  const auto midline = [](double behind_mm, double above_mm) {
    return [=](FoundEye& eye, const FoundEye& fellow) { move_to_midline(eye, fellow, behind_mm, above_mm); };
  };
  static const std::vector<Mistake> list{
      {"to the left", off(Vector3d::UnitX())},
      {"to the right", off(-Vector3d::UnitX())},
      {"behind", off(Vector3d::UnitY())},
      {"before", off(-Vector3d::UnitY())},
      {"above", off(Vector3d::UnitZ())},
      {"below", off(-Vector3d::UnitZ())},
      {"ethmoid cells", midline(5, 0)},
      {"sphenoid sinus", midline(45, -5)},
      {"brain stem", midline(85, -10)},
      {"frontal brain", midline(20, 45)},
      {"fellow's eye",
       [](FoundEye& eye, const FoundEye& fellow) { move(eye, centre_of(fellow) - centre_of(eye)); }, true},
      {"looks up", [](FoundEye& eye, const FoundEye&) { look(eye, 1.2 * Vector3d::UnitZ()); }},
      {"looks aside", [](FoundEye& eye, const FoundEye&) { look(eye, 1.2 * Vector3d::UnitX()); }}};
  return list;
}

/// How far a reading is from the right one, mm.
struct Apart {
  double centre = 0, width = 0, height = 0, length = 0, chamber = 0;
  double largest() const { return std::max({centre, width, height, length, chamber}); }
};
Apart apart(const EyeFit& fit, const EyeFit& right) {
  const auto difference = [&](int parameter) {
    return std::abs(fit.value(parameter) - right.value(parameter));
  };
  Apart of;
  of.centre = (fit.globe_centre_lps() - right.globe_centre_lps()).norm();
  of.width = 2 * difference(globe_x);
  of.height = 2 * difference(globe_y);
  if (right.front_is_blanked()) return of;
  of.length = difference(axial_length);
  of.chamber = difference(anterior_chamber_depth);
  return of;
}

/// By how much the worst gate that withholds a fit is beyond its limit: at most 1 where all pass.
std::pair<double, std::string> worst_gate(const std::vector<QualityGate>& gates) {
  std::pair<double, std::string> worst{0, ""};
  for (const QualityGate& gate : gates) {
    if (gate.withholds != Withholds::fit) continue;
    const bool is_upper_limit = gate.passed == (gate.value <= gate.limit);
    const double over = is_upper_limit   ? gate.value / gate.limit
                        : gate.value > 0 ? gate.limit / gate.value
                                         : std::numeric_limits<double>::max();
    // JSON knows no infinity.
    if (over > worst.first) worst = {std::min(over, std::numeric_limits<double>::max()), gate.name};
  }
  return worst;
}

/// {"scan", "eye", "mistake" (empty: none), "fitted" (withheld or not), "apart_mm", "over", "gate", "edges_apart_mm",
///  "reasons"}
Json record_of(const std::string& scan, const std::string& mistake, const JudgedEye& eye,
               const EyeFit* right) {
  const auto [over, gate] = worst_gate(eye.gates);
  Json record{{"scan", scan},
              {"eye", to_string(eye.found.laterality)},
              {"mistake", mistake},
              {"is_fitted", eye.is_fitted()},
              {"has_front", eye.has_front()},
              {"over", over},
              {"gate", gate},
              {"reasons", eye.reasons()},
              {"is_read", eye.is_read()}};
  if (eye.fit && right != nullptr) {
    const Apart from_right = apart(*eye.fit, *right);
    record["apart_mm"] = from_right.largest();
    record["globe_apart_mm"] = std::max({from_right.centre, from_right.width, from_right.height});
  }
  if (eye.main_edges() && right != nullptr) {
    const ReadEye read = *eye.main_edges();
    const double centre_mm = (read.reading.globe.centre - right->globe_centre_lps()).norm();
    const double width_mm = std::abs(read.biometry.globe_width.value - 2 * right->value(globe_x));
    const double height_mm = std::abs(read.biometry.globe_height.value - 2 * right->value(globe_y));
    record["edges_apart_mm"] = std::max(centre_mm, std::max(width_mm, height_mm));
  }
  return record;
}

std::vector<Json> records_of(const std::filesystem::path& study) {
  const Scan scan = read_scan(study);
  const std::vector<const Stack*> stacks = scan.stacks();
  const std::vector<JudgedEye> eyes = judge(scan);
  std::vector<Json> records;
  for (const JudgedEye& eye : eyes)
    records.push_back(record_of(scan.name, "", eye, eye.fit ? &*eye.fit : nullptr));
  if (eyes.size() != 2) return records;
  struct Start {
    std::size_t eye;
    const Mistake* mistake;
  };
  std::vector<JudgedEye> misled;
  std::vector<Start> starts;
  for (std::size_t e = 0; e < 2; ++e)
    if (eyes[e].is_fitted())
      for (const Mistake& mistake : mistakes()) {
        misled.emplace_back().found = eyes[e].found;
        starts.push_back({e, &mistake});
      }
  on_threads(2, misled.size(), [&](std::size_t i) {
    JudgedEye& eye = misled[i];
    FoundEye wrong = eye.found;
    starts[i].mistake->make(wrong, eyes[1 - starts[i].eye].found);
    if (!starts[i].mistake->of_the_fit) eye.found = wrong;
    try {
      eye.edges = read_edges_of(eye.found, stacks);
      const ViewEdges seen = starts[i].mistake->of_the_fit ? ViewEdges{} : eye.edges;
      fit_and_judge(eye, views_of(wrong, stacks), start_of(wrong, seen, scan.age_years));
    } catch (const Error&) {  // no voxels there
    }
  });
  for (std::size_t i = 0; i < misled.size(); ++i)
    records.push_back(record_of(scan.name, starts[i].mistake->name, misled[i], &*eyes[starts[i].eye].fit));
  return records;
}

/// Farther from the right reading than that a reading is wrong.
constexpr double wrong_mm = 1;

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("What the gates say of fits that start where no eye is, or not this one");
  std::vector<std::filesystem::path> studies;
  std::filesystem::path cache;
  app.add_option("scans", studies, "Studies")->required()->check(CLI::ExistingPath);
  app.add_option("--cache", cache, "Folder of records; those that are there are not made again")->required();
  CLI11_PARSE(app, argc, argv);

  std::filesystem::create_directories(cache);
  std::vector<Json> right, misled, wrong;
  int came_back = 0, no_fit = 0;
  for (const std::filesystem::path& study : studies) {
    const std::filesystem::path file = cache / (study.filename().string() + ".json");
    if (!std::filesystem::exists(file)) {
      try {
        write_json(file, records_of(study));
      } catch (const Error& error) {
        fmt::print("{}: {}\n", study.filename().string(), error.what());
        continue;
      }
    }
    for (const Json& record : read_json(file)) {
      if (record.at("mistake").get<std::string>().empty()) {
        right.push_back(record);
        continue;
      }
      misled.push_back(record);
      if (!record.contains("apart_mm"))
        ++no_fit;
      else if (record.at("apart_mm").get<double>() > wrong_mm)
        wrong.push_back(record);
      else
        ++came_back;
    }
  }
  fmt::print("{} readings as found; misled: {} came to the right eye, {} found no fit, {} are wrong\n\n",
             right.size(), came_back, no_fit, wrong.size());
  fmt::print("Wrong and not withheld:\n");
  for (const Json& record : wrong)
    if (record.at("is_fitted").get<bool>())
      fmt::print("{} {} {}: {:.1f} mm off (globe {:.1f}), {} {:.2f}, front {}\n",
                 record.at("scan").get<std::string>(), record.at("eye").get<std::string>(),
                 record.at("mistake").get<std::string>(), record.at("apart_mm").get<double>(),
                 record.at("globe_apart_mm").get<double>(), record.at("gate").get<std::string>(),
                 record.at("over").get<double>(), record.at("has_front").get<bool>());
  fmt::print("Edges of a wrong place, told instead of a fit:\n");
  for (const Json& record : misled)
    if (record.at("is_read").get<bool>() && record.at("edges_apart_mm").get<double>() > 2 * wrong_mm)
      fmt::print("{} {} {}: {:.1f} mm off\n", record.at("scan").get<std::string>(),
                 record.at("eye").get<std::string>(), record.at("mistake").get<std::string>(),
                 record.at("edges_apart_mm").get<double>());
  fmt::print("\n| limits times | wrong readings withheld | right ones lost |\n| --- | --- | --- |\n");
  const auto share_beyond = [](const std::vector<Json>& records, double limit) {
    const auto beyond = std::count_if(records.begin(), records.end(), [&](const Json& record) {
      return record.at("over").get<double>() > limit;
    });
    return fmt::format("{} of {}", beyond, records.size());
  };
  for (const double times : {0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.25, 1.5, 2.0, 3.0, 5.0})
    fmt::print("| {} | {} | {} |\n", times, share_beyond(wrong, times), share_beyond(right, times));
  return 0;
}
