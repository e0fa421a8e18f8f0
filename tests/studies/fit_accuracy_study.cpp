/// Fits random phantom eyes, keeps a record of each, and prints errors, coverage and scores:
/// docs/evidence/accuracy.md. Not part of the tests.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <array>
#include <cmath>
#include <map>

#include "meshing/biometry.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/frames.hpp"
#include "tests/studies/stated_errors.hpp"
#include "tests/studies/study_eye.hpp"
#include "tests/support/simulated_keratometry.hpp"

using namespace emmetrope;
using namespace emmetrope::meshing;
using namespace emmetrope::segmentation;

namespace {

/// Errors of one quantity over the eyes, with what was stated of them.
struct Quantity : StatedErrors {
  std::vector<double> bound;

  /// Mean interval score of 95 % intervals (Gneiting and Raftery 2007): width, and 2/0.05 times every miss.
  double score(const std::vector<double>& of) const {
    double sum = 0;
    for (std::size_t i = 0; i < error.size(); ++i) {
      const double half = normal_95 * of[i];
      sum += (2 * half + 40 * std::max(0.0, std::abs(error[i]) - half)) / error.size();
    }
    return sum;
  }
  /// What the score would be on average if errors were normal with the bound's sigma.
  double bound_score() const {
    double sum = 0;
    // E of width + 40 excess for a standard normal error: 3.92 + 80 (phi(z) - z (1 - Phi(z))).
    const double excess = std::exp(-normal_95 * normal_95 / 2) / std::sqrt(2 * pi) - normal_95 * 0.025;
    for (const double b : bound) sum += b * (2 * normal_95 + 80 * excess) / error.size();
    return sum;
  }
};

struct Wanted {
  const char* name;
  std::vector<std::string> path;  ///< in biometry.json and truth
};
const std::vector<Wanted>& quantities() {
  static const std::vector<Wanted> list{{"axial length, mm", {"axial_length_mm"}},
                                        {"anterior chamber depth, mm", {"anterior_chamber_depth_mm"}},
                                        {"lens thickness, mm", {"lens_thickness_mm"}},
                                        {"lens front radius, mm", {"lens_anterior_radius_mm"}},
                                        {"lens back radius, mm", {"lens_posterior_radius_mm"}},
                                        {"corneal thickness, mm", {"corneal_thickness_mm"}},
                                        {"globe width, mm", {"globe_width_mm"}},
                                        {"globe height, mm", {"globe_height_mm"}},
                                        {"globe depth, mm", {"globe_depth_mm"}},
                                        {"retina R across, mm", {"retina", "vertex_radius_mm", "horizontal"}},
                                        {"retina R upright, mm", {"retina", "vertex_radius_mm", "vertical"}},
                                        {"retina Q, 240 degrees", {"retina", "q_240"}},
                                        {"retina Q, 120 degrees", {"retina", "q_120"}},
                                        {"retina tilt across, deg", {"retina", "tilt_deg", "horizontal"}},
                                        {"retina tilt upright, deg", {"retina", "tilt_deg", "vertical"}},
                                        {"vitreous volume, mm3", {"retina", "volume_mm3"}},
                                        {"retinal area, mm2", {"retina", "area_mm2"}},
                                        {"staphyloma index", {"retina", "staphyloma_index"}},
                                        {"corneal power M, D", {"astigmatism", "M_D"}},
                                        {"astigmatism J0, D", {"astigmatism", "J0_D"}},
                                        {"astigmatism J45, D", {"astigmatism", "J45_D"}},
                                        {"corneal asphericity Q", {"keratometry", "asphericity_q"}}};
  return list;
}
/// Told besides, not pooled, of eyes with keratoconus.
const std::vector<Wanted>& quantities_of_cones() {
  static const std::vector<Wanted> list{{"steep K, D", {"keratometry", "steep", "power_D"}},
                                        {"irregularity, um", {"astigmatism", "irregularity_um"}}};
  return list;
}

Json at(const Json& json, const std::vector<std::string>& path) {
  Json found = json;
  for (const std::string& key : path) found = Json(found.at(key));
  return found;
}

ExternalMeasurement keratometry_of(const Json& record) {
  const Json& cornea = record.at("truth").at("astigmatism");
  return simulated_keratometry(
      {cornea.at("M_D").get<double>(), cornea.at("J0_D").get<double>(), cornea.at("J45_D").get<double>()},
      record.at("seed").get<unsigned long long>() * 2 + (record.at("laterality") == "os"));
}

Json biometry_with(const Json& fit, const Json& covariance, double scale_sd,
                   const ExternalMeasurement* keratometry) {
  Json eye = fit;
  if (!covariance.is_null()) eye["covariance"] = covariance;
  UncertainEye estimate = fitted_eye(parametric_eye_from_json(eye));
  estimate.add_scale_prior(scale_sd);
  if (keratometry) estimate.learn(*keratometry);
  return biometry_json(estimate, {});
}

struct Study {
  std::map<std::string, Quantity> by_name;
  Quantity j_vector, retina, cornea;
  std::map<std::string, std::array<std::vector<double>, 2>> bound_if_known;  ///< axial length, M
  int eyes = 0, refused = 0, missed = 0, irregular = 0;
  double fit_s = 0, render_s = 0, chi2 = 0;

  void add(const Json& record, bool with_keratometry) {
    ++eyes;
    if (record.at("status") == "not found") ++missed;
    if (record.at("status") == "refused") ++refused;
    if (record.at("status") != "measured") return;
    const ExternalMeasurement keratometry = keratometry_of(record);
    const ExternalMeasurement* given = with_keratometry ? &keratometry : nullptr;
    const bool distorted = record.at("protocol").get<std::string>().find("distorted") != std::string::npos;
    const double scale_sd = distorted ? 0.003 : 0;
    Json stated, bound;
    try {
      stated = biometry_with(record.at("fit"), nullptr, scale_sd, given);
      bound = biometry_with(record.at("fit"), record.at("bound"), scale_sd, given);
    } catch (const Error&) {  // what `emmetrope mesh` refuses
      ++refused;
      return;
    }
    const Json known = record.value("bound_if_known", Json::object());
    for (const auto& [name, sigmas] : known.items())
      for (const std::size_t i : {0, 1}) bound_if_known[name][i].push_back(sigmas.at(i).get<double>());
    fit_s += record.at("fit_s").get<double>();
    render_s += record.at("render_s").get<double>();
    chi2 += record.at("chi2_per_voxel").get<double>();
    std::vector<Wanted> all = quantities();
    if (record.at("protocol").get<std::string>().find("keratoconus") != std::string::npos)
      all.insert(all.end(), quantities_of_cones().begin(), quantities_of_cones().end());
    irregular += record.value("irregular_cornea", false);
    for (const Wanted& wanted : all) {
      const auto measured = at(stated, wanted.path).get<Measured>();
      Quantity& quantity = by_name[wanted.name];
      quantity.add(measured, at(record.at("truth"), wanted.path).get<double>());
      quantity.bound.push_back(at(bound, wanted.path).get<Measured>().sigma());
    }
    j_vector.error.push_back(
        std::hypot(by_name["astigmatism J0, D"].error.back(), by_name["astigmatism J45, D"].error.back()));
    retina.error.push_back(record.at("surface_mm").at("retina").get<double>());
    cornea.error.push_back(record.at("surface_mm").at("cornea").get<double>());
  }

  void print() const {
    const int n = eyes - refused - missed;
    fmt::print(
        "{} eyes: {} measured ({} corneas irregular), {} refused, {} not found; {:.1f} s to fit, {:.1f} s to "
        "render, chi2 {:.3f}\n\n",
        eyes, n, irregular, refused, missed, fit_s / n, render_s / n, chi2 / n);
    fmt::print(
        "| quantity | mean | rms | median | 95th | stated sigma | bound | rms / bound | covered | interval "
        "score / bound's |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n");
    int covered = 0, of = 0;
    double score = 0;
    const auto print_row = [n](const char* name, const Quantity& q) {
      fmt::print(
          "| {} | {:+.3f} | {:.3f} | {:.3f} | {:.3f} | {:.3f} | {:.3f} | {:.2f} | {:.1f} % | {:.2f} |\n",
          name, q.mean(), root_mean_square(q.error), q.median(), q.quantile(0.95), root_mean_square(q.sigma),
          root_mean_square(q.bound), root_mean_square(q.error) / root_mean_square(q.bound),
          100.0 * q.covered() / n, q.score(q.sigma) / q.bound_score());
    };
    for (const Wanted& wanted : quantities()) {
      const Quantity& q = by_name.at(wanted.name);
      covered += q.covered();
      of += n;
      score += q.score(q.sigma) / q.bound_score() / static_cast<double>(quantities().size());
      print_row(wanted.name, q);
    }
    for (const Wanted& wanted : quantities_of_cones())
      if (const auto found = by_name.find(wanted.name); found != by_name.end())
        print_row(wanted.name, found->second);
    fmt::print("| pooled | | | | | | | | {:.1f} % | {:.2f} |\n", 100.0 * covered / of, score);
    fmt::print("| J as a vector, D | | {:.3f} | {:.3f} | {:.3f} | | | | | |\n",
               root_mean_square(j_vector.error), j_vector.median(), j_vector.quantile(0.95));
    fmt::print("| retina, mean distance, mm | {:.3f} | | {:.3f} | {:.3f} | | | | | |\n", retina.mean(),
               retina.median(), retina.quantile(0.95));
    fmt::print("| cornea, mean distance, mm | {:.3f} | | {:.3f} | {:.3f} | | | | | |\n\n", cornea.mean(),
               cornea.median(), cornea.quantile(0.95));
  }

  /// What costs the bound: its rms if a group of nuisance parameters were known.
  void print_bound() const {
    fmt::print("| known | bound of axial length, mm | bound of M, D |\n| --- | --- | --- |\n");
    for (const auto& [name, sigmas] : bound_if_known)
      fmt::print("| {} | {:.3f} | {:.3f} |\n", name, root_mean_square(sigmas[0]),
                 root_mean_square(sigmas[1]));
    fmt::print("\n");
  }

  void print_each(const Json& record) const {
    fmt::print("{} {}:", record.at("seed").get<int>(), record.at("laterality").get<std::string>());
    if (record.at("status") == "measured")
      for (const Wanted& wanted : quantities()) {
        const Quantity& q = by_name.at(wanted.name);
        fmt::print(" {} {:+.3f} ({:.3f})", wanted.path.back(), q.error.back(), q.sigma.back());
      }
    fmt::print(" cornea {:.0f} um ({}, {:.1f})",
               1e3 * record.value(Json::json_pointer("/surface_mm/cornea"), 0.0),
               record.value("irregular_cornea", false) ? "irregular" : "biconic",
               record.value("irregularity_chi2", 0.0));
    fmt::print(" chi2 {:.3f} bulge {:.2f} {}\n", record.value("chi2_per_voxel", 0.0),
               record.at("truth").at("geometry").at("bulge_height_mm").get<double>(),
               record.at("reasons").dump());
  }
};

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Accuracy of the fit on random phantom eyes, two a head");
  StudyProtocol protocol;
  unsigned long long first = 1;
  int count = 1;
  std::filesystem::path cache;
  bool score_only = false, images_alone = false, each = false, bound = false;
  app.add_option("--protocol", protocol.name, "surface-coil, head-t2, head-t1");
  app.add_option("--first", first, "Seed of the first head");
  app.add_option("--count", count, "Heads");
  app.add_flag("--keratoconus", protocol.keratoconus, "A cone on each cornea");
  app.add_flag("--distorted", protocol.distorted, "Scale error of 0.3 %, fat shifted by a pixel");
  app.add_option("--turn-deg", protocol.turn_deg, "The head turns by this (rms per axis) between stacks");
  app.add_flag("--bound", bound, "What the bound would be if something else were known");
  app.add_option("--snr", protocol.snr, "Instead of the protocol's");
  app.add_option("--cache", cache, "Folder of records; those that are there are not made again")->required();
  app.add_flag("--score-only", score_only, "Score the records that are there");
  app.add_flag("--images-alone", images_alone, "Without the table of what keratometry makes of it");
  app.add_flag("--each", each, "A line for every eye");
  CLI11_PARSE(app, argc, argv);

  Study images, keratometry;
  for (unsigned long long seed = first; seed < first + count; ++seed)
    for (const Json& record : cached_head(cache, protocol, seed, !score_only)) {
      images.add(record, false);
      if (each) images.print_each(record);
      if (!images_alone) keratometry.add(record, true);
    }
  fmt::print("\n{}, images alone: ", protocol.label());
  images.print();
  if (!images_alone) {
    fmt::print("{}, keratometry of 0.25 D given: ", protocol.label());
    keratometry.print();
  }
  if (bound) images.print_bound();
  return 0;
}
