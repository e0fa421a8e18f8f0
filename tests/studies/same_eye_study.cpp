/// The eyes of real scans again from the same voxels stored otherwise, and from worse images: the tables of
/// docs/evidence/real-scans.md, "One answer". 20 to 90 s of processor time a scan and way.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <random>

#include "pipeline/base/ends_with.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/measured.hpp"
#include "segmentation/intake/nifti.hpp"
#include "tests/studies/judged_scan.hpp"
#include "tests/studies/stated_errors.hpp"
#include "tests/support/stored_otherwise.hpp"
#include "tests/support/temporary_folder.hpp"

using namespace emmetrope;
using namespace emmetrope::segmentation;

namespace {

/// Another image of the same eyes.
struct Way {
  std::string name;
  std::function<Scan(const Scan&)> of;
  bool mirrored = false;  ///< the right eye is the left one
  bool turned = false;    ///< the header has the patient's horizontal elsewhere
};

Scan with_each_stack(const Scan& scan, const std::function<Stack(const Stack&)>& change) {
  Scan other = scan;
  for (Stack& volume : other.volumes) volume = change(volume);
  return other;
}

bool is_even(const Stack& stack) {
  for (int s = 1; s < stack.slices(); ++s) {
    const Eigen::Vector3d step = stack.slice_position[static_cast<std::size_t>(s)] -
                                 stack.slice_position[static_cast<std::size_t>(s) - 1];
    if ((step - stack.slice_spacing_mm() * stack.normal).norm() > 0.02) return false;
  }
  return stack.slices() > 1;
}

/// Slices that were acquired one by one stay slices, and a stack that is no lattice is left alone.
Stack stored(const Stack& stack, Storage storage) {
  if (!is_even(stack)) return stack;
  const bool slices_stay = storage.axis[2] == 2 || storage.axis[2] == ~2;
  if (stack.slices_are_told && !slices_stay) return stack;
  Stack other = stored_otherwise(stack, storage);
  if (slices_stay) other.slice_thickness_mm = stack.slice_thickness_mm;
  return other;
}

Scan mirrored(const Scan& scan) {
  Scan other = with_each_stack(scan, in_mirror);
  for (std::string& tag : other.laterality_tags)
    if (tag == "R" || tag == "L") tag = tag == "R" ? "L" : "R";
  return other;
}

Stack brighter(Stack stack) {
  for (auto& slice : stack.slice_intensity)
    for (float& value : slice) value *= 3.7F;
  return stack;
}

/// The head elsewhere in the scanner, and turned by 5 degrees.
Stack turned(Stack stack) {
  stack = turned_header(std::move(stack), 5 * degree, Eigen::Vector3d(1, 2, 3).normalized());
  for (Eigen::Vector3d& position : stack.slice_position) position += Eigen::Vector3d(5, -20, 30);
  return stack;
}

Scan as_nifti(const Scan& scan) {
  const test::TemporaryFolder folder;
  for (const Stack& volume : scan.volumes) write_nifti(folder.path() / (volume.name + ".nii.gz"), volume);
  Scan other = read_scan(folder.path());
  other.name = scan.name;
  other.age_years = scan.age_years;
  return other;
}

/// Of the stack, where one of its eyes shows it.
double noise_of(const Scan& scan, const FoundEyes& found, std::size_t stack) {
  for (const FoundEye& eye : found.eyes)
    for (std::size_t v = 0; v < eye.views.size(); ++v)
      if (eye.views[v].stack == stack) try {
          EyeStart start = start_of(eye, {});
          start.globe_centre = eye.views[v].globe.centre;
          return vitreous_noise(scan.volumes[stack], start);
        } catch (const Error&) {  // the other eye may tell
        }
  return 0;
}

/// Twice the noise, of a magnitude.
Scan with_twice_the_noise(const Scan& scan, unsigned seed) {
  Scan other = scan;
  const FoundEyes found = scan.find();
  std::mt19937_64 random(seed);
  for (std::size_t s = 0; s < other.volumes.size(); ++s) {
    std::normal_distribution<double> noise(0, std::sqrt(3.0) * noise_of(scan, found, s));
    if (noise.stddev() <= 0) continue;
    for (auto& slice : other.volumes[s].slice_intensity)
      for (float& value : slice) value = static_cast<float>(std::hypot(value + noise(random), noise(random)));
  }
  return other;
}

/// Each two neighbouring slices one of twice the thickness.
Stack with_slices_in_pairs(const Stack& stack) {
  if (!is_even(stack)) return stack;
  Stack other = stack;
  other.slice_thickness_mm = 2 * stack.slice_spacing_mm();
  other.slice_position.clear();
  other.slice_intensity.clear();
  for (std::size_t s = 0; s + 1 < stack.slice_position.size(); s += 2) {
    other.slice_position.push_back((stack.slice_position[s] + stack.slice_position[s + 1]) / 2);
    std::vector<float>& values = other.slice_intensity.emplace_back(stack.slice_intensity[s]);
    for (std::size_t i = 0; i < values.size(); ++i)
      values[i] = (values[i] + stack.slice_intensity[s + 1][i]) / 2;
  }
  return other;
}

/// As far as 45 mm from the eyes, at both ends of each axis alike.
Scan cropped_to_the_eyes(const Scan& scan) {
  constexpr double reach_mm = 45;
  const FoundEyes found = scan.find();
  return with_each_stack(scan, [&](const Stack& stack) {
    const std::array<Eigen::Vector3d, 3> along{stack.along_row, stack.along_column, stack.normal};
    const std::array<double, 3> spacing_mm{stack.column_spacing_mm, stack.row_spacing_mm,
                                           stack.slice_spacing_mm()};
    const std::array<int, 3> count{stack.columns, stack.rows, stack.slices()};
    Storage storage;
    for (std::size_t i = 0; i < 3; ++i) {
      double free_mm = count[i] * spacing_mm[i];
      for (const FoundEye& eye : found.eyes) {
        const double at_mm = (eye.views.front().globe.centre - stack.slice_position.front()).dot(along[i]);
        free_mm = std::min({free_mm, at_mm, (count[i] - 1) * spacing_mm[i] - at_mm});
      }
      storage.cropped[static_cast<Eigen::Index>(i)] =
          static_cast<int>(std::max(0.0, (free_mm - reach_mm) / spacing_mm[i]));
    }
    return stored(stack, storage);
  });
}

const std::vector<Way>& ways_to_store() {
  const auto each = [](Stack (*change)(Stack)) {
    return [change](const Scan& scan) { return with_each_stack(scan, change); };
  };
  const auto stored_as = [](Storage storage) {
    return [storage](const Scan& scan) {
      return with_each_stack(scan, [&](const Stack& stack) { return stored(stack, storage); });
    };
  };
  static const std::vector<Way> ways{{"mirrored", mirrored, true},
                                     {"cropped", cropped_to_the_eyes},
                                     {"flipped", stored_as({{~0, 1, ~2}})},
                                     {"turned-axes", stored_as({{2, ~1, 0}})},
                                     {"brighter", each(brighter)},
                                     {"turned-head", each(turned), false, true},
                                     {"nifti", as_nifti}};
  return ways;
}

const std::vector<Way>& ways_to_worsen() {
  static const std::vector<Way> ways{
      {"noise-1", [](const Scan& scan) { return with_twice_the_noise(scan, 1); }},
      {"noise-2", [](const Scan& scan) { return with_twice_the_noise(scan, 2); }},
      {"pairs", [](const Scan& scan) { return with_each_stack(scan, with_slices_in_pairs); }}};
  return ways;
}

/// What is stated of the eyes: {"od": {"status", "by", "stated", "reasons"}, ...}; kept in the cache.
Json eyes_of(const std::string& name, const std::filesystem::path& cache, const std::function<Scan()>& scan) {
  const std::filesystem::path file = cache / (name + ".json");
  if (std::filesystem::exists(file)) return read_json(file);
  Json eyes;
  for (const char* laterality : {"od", "os"})
    eyes[laterality] = {{"status", "not found"}, {"stated", nullptr}};
  const Scan image = scan();  // which the eyes' stacks are of
  for (const JudgedEye& eye : judge(image))
    eyes[to_string(eye.found.laterality)] = {{"status", eye.status()},
                                             {"by", eye.is_fitted() ? "fit"
                                                    : eye.is_read() ? "edges"
                                                                    : "none"},
                                             {"stated", stated_biometry(eye, 0)},
                                             {"reasons", eye.reasons()}};
  write_json(file, eyes);
  return eyes;
}

std::optional<Measured> quantity_of(const Json& eye, const StatedQuantity& quantity) {
  const Json::json_pointer at(quantity.pointer);
  const Json& stated = eye.at("stated");
  if (stated.is_null() || !stated.contains(at) || is_withheld(stated.at(at))) return std::nullopt;
  return stated.at(at).get<Measured>();
}

/// The largest of one kind, and where.
struct Largest {
  double value = 0;
  std::string of;
  void consider(double other, const std::string& what) {
    if (other <= value) return;
    value = other;
    of = what;
  }
};

/// Whether it is told along the patient's horizontal or upright, which a turned header has elsewhere in the eye.
bool is_told_across(const std::string& quantity) {
  constexpr std::array<const char*, 6> across{"width", "height", "R across", "R upright", "J0", "J45"};
  return std::any_of(across.begin(), across.end(),
                     [&](const char* word) { return quantity.find(word) != std::string::npos; });
}

/// Both eyes of a scan in one way against the way it is.
void print_difference(const std::string& scan, const Way& way, const Json& before, const Json& after) {
  for (const char* laterality : {"od", "os"}) {
    const bool is_right = std::string(laterality) == "od";
    const Json &was = before.at(laterality), &is = after.at(is_right != way.mirrored ? "od" : "os");
    Largest mm, dioptres, interval, across_mm, across_D;
    int withheld = 0;
    for (const StatedQuantity& quantity : stated_quantities) {
      const auto a = quantity_of(was, quantity), b = quantity_of(is, quantity);
      if (a.has_value() != b.has_value()) ++withheld;
      if (!a || !b) continue;
      const std::string name = quantity.name;
      if (way.turned && is_told_across(name)) {
        const double apart = std::abs(a->value - b->value);
        if (ends_with(name, ", mm")) across_mm.consider(apart, name);
        if (ends_with(name, ", D")) across_D.consider(apart, name);
        continue;
      }
      const double sign = way.mirrored && name.find("J45") != std::string::npos ? -1 : 1;
      const double apart = std::abs(a->value - sign * b->value);
      if (ends_with(name, ", mm")) mm.consider(apart, name);
      if (ends_with(name, ", D")) dioptres.consider(apart, name);
      interval.consider(std::abs(b->sigma() / a->sigma() - 1), name);
    }
    fmt::print("| {} | {} | {} | {} | {} | {:.3f} {} | {:.3f} {} | {:.1f} % {} |\n", scan, way.name,
               laterality,
               was.value("by", "none") == is.value("by", "none")
                   ? is.value("by", "none")
                   : was.value("by", "none") + " " + is.value("by", "none"),
               withheld, mm.value, mm.of, dioptres.value, dioptres.of, 100 * interval.value, interval.of);
    if (way.turned)
      fmt::print("| {} | {}, along the header's horizontal | {} | | | {:.3f} {} | {:.3f} {} | |\n", scan,
                 way.name, laterality, across_mm.value, across_mm.of, across_D.value, across_D.of);
  }
}

/// How changes compare with the intervals of the worse images.
struct Changes {
  int covered = 0, of = 0, eyes = 0, lost = 0;

  void add(const std::string& scan, const Way& way, const Json& before, const Json& after) {
    for (const char* laterality : {"od", "os"}) {
      const Json &was = before.at(laterality), &is = after.at(laterality);
      if (was.at("stated").is_null()) continue;
      ++eyes;
      const bool is_lost = is.at("stated").is_null();
      lost += is_lost;
      int inside = 0, known = 0, withheld = 0;
      Largest beyond;
      for (const StatedQuantity& quantity : stated_quantities) {
        const auto a = quantity_of(was, quantity), b = quantity_of(is, quantity);
        if (a && !b) ++withheld;
        if (!a || !b) continue;
        ++known;
        const double half = b->value > a->value ? b->value - b->ci95[0] : b->ci95[1] - b->value;
        const double in_halves = std::abs(b->value - a->value) / half;
        if (in_halves <= 1) ++inside;
        if (in_halves > 1) beyond.consider(in_halves, quantity.name);
      }
      covered += inside;
      of += known;
      fmt::print("| {} | {} | {} | {} | {} | {} of {} | {} | {} |\n", scan, way.name, laterality,
                 was.at("by").get<std::string>(), is_lost ? "**lost**" : is.at("by").get<std::string>(),
                 inside, known, withheld,
                 beyond.of.empty() ? "" : fmt::format("{} {:.1f}", beyond.of, beyond.value));
    }
  }
};

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("The eyes of scans again from the same voxels stored otherwise, or from worse images");
  std::vector<std::filesystem::path> studies;
  std::filesystem::path cache;
  bool worse = false;
  std::vector<std::string> only;
  app.add_option("scans", studies, "Studies")->required()->check(CLI::ExistingPath);
  app.add_flag("--worse", worse,
               "Twice the noise, slices averaged in pairs; else: the same voxels seven ways");
  app.add_option("--way", only, "Only these ways: mirrored, turned-head, ...; all if none is given");
  app.add_option("--cache", cache, "Folder of records; those that are there are not made again")->required();
  CLI11_PARSE(app, argc, argv);

  std::filesystem::create_directories(cache);
  fmt::print(
      worse ? "| scan | way | eye | by | then by | within the interval | withheld | beyond, in intervals |\n"
              "| --- | --- | --- | --- | --- | --- | --- | --- |\n"
            : "| scan | way | eye | by | not in both | largest, mm | D | interval |\n"
              "| --- | --- | --- | --- | --- | --- | --- | --- |\n");
  Changes changes;
  for (const std::filesystem::path& study : studies) {
    const std::string name = study.filename().string();
    try {
      const Scan scan = read_scan(study);
      const Json before = eyes_of(name, cache, [&]() -> const Scan& { return scan; });
      for (const Way& way : worse ? ways_to_worsen() : ways_to_store()) {
        if (!only.empty() && std::find(only.begin(), only.end(), way.name) == only.end()) continue;
        const Json after = eyes_of(name + "-" + way.name, cache, [&] { return way.of(scan); });
        if (worse)
          changes.add(name, way, before, after);
        else
          print_difference(name, way, before, after);
        std::fflush(stdout);
      }
    } catch (const Error& error) {
      fmt::print("{}: {}\n", name, error.what());
    }
  }
  if (worse)
    fmt::print("\n{} of {} changes within the interval; {} of {} eyes lost\n", changes.covered, changes.of,
               changes.lost, changes.eyes);
  return 0;
}
