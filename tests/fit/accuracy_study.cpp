/// Fits random phantom eyes and prints the errors against the truth: docs/accuracy.md. Not part of the tests.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <chrono>

#include "pipeline/base/frames.hpp"
#include "tests/fit/phantom_eyes.hpp"

using namespace emmetrope;
using namespace emmetrope::segmentation;

namespace {

struct Score {
  double sum2 = 0, z2 = 0;
  int n = 0;
  std::vector<double> absolute;
  void add(double error, double sigma) {
    sum2 += error * error;
    z2 += error * error / (sigma * sigma);
    ++n;
    absolute.push_back(std::abs(error));
  }
};

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Accuracy of the fit on random phantom eyes");
  std::string protocol_name = "surface-coil";
  unsigned long long first = 1;
  int count = 1;
  double motion_mm = 0.3;
  app.add_option("--protocol", protocol_name);
  app.add_option("--first", first);
  app.add_option("--count", count);
  app.add_option("--motion", motion_mm);
  std::string cache;
  app.add_option("--cache", cache, "folder that keeps rendered stacks");
  CLI11_PARSE(app, argc, argv);

  std::map<std::string, Score> scores;
  for (unsigned long long seed = first; seed < first + count; ++seed) {
    const phantom::HeadGeometry head = phantom::random_head(seed);
    const phantom::Anatomy anatomy(head);
    phantom::Protocol protocol = phantom::make_protocol(protocol_name, anatomy);
    protocol.disturbances.motion_mm = motion_mm;
    protocol.disturbances.seed = seed;
    const Laterality laterality = seed % 2 ? Laterality::od : Laterality::os;
    const auto t0 = std::chrono::steady_clock::now();
    const PhantomEye eye = render_eye(head, protocol, laterality, 1, cache);
    const auto t1 = std::chrono::steady_clock::now();

    std::vector<std::string> hints(eye.stacks.size(), to_string(laterality) == std::string("od") ? "R" : "L");
    const FoundEyes found_eyes = find_eyes(eye.views(), hints);
    const auto one = std::find_if(found_eyes.eyes.begin(), found_eyes.eyes.end(),
                                  [&](const FoundEye& f) { return f.laterality == laterality; });
    if (one == found_eyes.eyes.end()) {
      fmt::print("seed {}: eye not found\n", seed);
      continue;
    }
    const EyeStart start = start_of(*one);
    const auto t3 = std::chrono::steady_clock::now();
    fmt::print(
        "  found in {:.1f} s: centre off {:.2f} mm, axis off {:.1f} deg, radius {:.2f}, lens contrast "
        "{:.2f}\n",
        std::chrono::duration<double>(t3 - t1).count(),
        (start.globe_centre - eye.truth.globe_centre_lps()).norm(),
        std::acos(std::min(1.0, start.axis.dot(eye.truth.lps_from_eye.linear().col(2)))) / degree,
        one->radius_mm, one->lens_contrast);
    EyeFit fit = fit_eye(views_of(*one, eye.views()), start, one->contrast);
    const auto t2 = std::chrono::steady_clock::now();

    const phantom::EyeGeometry& g = eye.truth.geometry;
    const ParametricEye found = to_parametric_eye(fit, laterality);
    const double al_sigma = fit.pole_depth_sigma_mm();
    const auto report = [&](const char* name, double error, double sigma) {
      scores[name].add(error, sigma);
      fmt::print("  {} {:+.3f} ({:.3f})", name, error, sigma);
    };
    fmt::print(
        "seed {} {}: {} voxels, chi2 {:.3f} [{:.2f} {:.2f} {:.2f}], {} iterations{}, render {:.1f} s, fit "
        "{:.1f} s; starts",
        seed, to_string(laterality), fit.samples.size(), fit.chi2_per_voxel, fit.regions[0].chi2,
        fit.regions[1].chi2, fit.regions[2].chi2, fit.iterations, fit.converged ? "" : " NOT CONVERGED",
        std::chrono::duration<double>(t1 - t0).count(), std::chrono::duration<double>(t2 - t1).count());
    for (const double cost : fit.start_costs) fmt::print(" {:.0f}", cost);
    fmt::print("\n");
    const double k_flat = 337.5 / phantom::keratometric_radius_mm(g, g.cornea_axis_deg);
    const double k_steep = 337.5 / phantom::keratometric_radius_mm(g, g.cornea_axis_deg + 90);
    const double j = (k_steep - k_flat) / 2, axis = 2 * g.cornea_axis_deg * pi / 180;
    // Central powers: what the parameters say before the conic constant enters at 1.5 mm.
    report("K",
           337.5 * fit.value(cornea_c) - 337.5 * (1 / g.cornea_radius_x_mm + 1 / g.cornea_radius_y_mm) / 2,
           337.5 * fit.sigma(cornea_c));
    // Curvature matrix: the flat meridian at a has power c - |j|: j0 = -|j| cos 2a in the curvature's sign.
    report("J0", -337.5 * fit.value(cornea_j0) - j * std::cos(axis), 337.5 * fit.sigma(cornea_j0));
    report("J45", -337.5 * fit.value(cornea_j45) - j * std::sin(axis), 337.5 * fit.sigma(cornea_j45));
    report("AL", found.pole_depth_mm() - phantom::pole_depth_mm(g), al_sigma);
    report("ACD", fit.value(anterior_chamber_depth) - g.anterior_chamber_depth_mm,
           fit.sigma(anterior_chamber_depth));
    report("LT", fit.value(lens_thickness) - g.lens_thickness_mm, fit.sigma(lens_thickness));
    report("Ra", fit.value(lens_anterior_radius) - g.lens_anterior_radius_mm,
           fit.sigma(lens_anterior_radius));
    report("Rp", fit.value(lens_posterior_radius) - g.lens_posterior_radius_mm,
           fit.sigma(lens_posterior_radius));
    report("apex",
           (eye.truth.lps_from_eye.inverse() * Eigen::Vector3d(fit.parameters.segment<3>(apex_x))).z(),
           fit.sigma(apex_y));
    report("ratio", fit.value(cornea_back_ratio) - g.cornea_back_ratio, fit.sigma(cornea_back_ratio));
    report("thick", fit.value(cornea_thickness) - g.cornea_thickness_mm, fit.sigma(cornea_thickness));
    report("Q", fit.value(cornea_q) - (g.cornea_q_x + g.cornea_q_y) / 2, fit.sigma(cornea_q));
    fmt::print("\n  intensities");
    for (int i = vitreous; i <= surround; ++i) fmt::print(" {:.3f}", fit.value(i));
    fmt::print("  wall {:.2f} {:.2f} iris {:.2f} {:.2f} {:.2f} {:.2f} lid {:.2f} sharp",
               fit.value(wall_lateral), fit.value(wall_axial), fit.value(iris_depth), fit.value(iris_slope),
               fit.value(iris_half_thickness), fit.value(pupil_radius), fit.value(lid_thickness));
    for (int s = 0; s < fit.layout.stacks; ++s)
      fmt::print(" {:.3f}", fit.value(fit.layout.stack(s) + log_sharpness));
    fmt::print("\n");
    std::fflush(stdout);
  }
  fmt::print("{:6} {:>3} {:>8} {:>8} {:>8} {:>6}\n", "", "n", "rms", "median", "p95", "rms z");
  for (auto& [name, score] : scores) {
    std::sort(score.absolute.begin(), score.absolute.end());
    fmt::print("{:6} {:3} {:8.4f} {:8.4f} {:8.4f} {:6.2f}\n", name, score.n, std::sqrt(score.sum2 / score.n),
               score.absolute[score.absolute.size() / 2],
               score.absolute[static_cast<std::size_t>(0.95 * (score.absolute.size() - 1))],
               std::sqrt(score.z2 / score.n));
  }
  return 0;
}
