#include <fmt/core.h>

#include <algorithm>
#include <cstdlib>
#include <random>
#include <string>

#include "correction/prescription/prescription.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "raytrace/spectacle/spectacle.hpp"
#include "tests/support/closed_loop.hpp"
#include "tests/support/traced_eyes.hpp"

/// The table of docs/evidence/accuracy-refraction.md: closed-loop-study [EYES] [FIRST]; known eyes with the first
/// only. closed-loop-study images [EYES]: how many retinal images a whole prescription takes
namespace emmetrope::correction {
namespace {

/// Errors of one kind of eyes.
struct Errors {
  std::vector<double> paraxial, spot, sharpness, axis;
  int refused = 0, images = 0;

  void add(const ClosedLoop& loop) {
    paraxial.push_back(loop.paraxial_error_D());
    spot.push_back(loop.spot_error_D());
    images += loop.images;
    if (loop.converged)
      sharpness.push_back(loop.sharpness_error_D());
    else
      ++refused;
    if (loop.cylinder_D() >= 1) axis.push_back(loop.axis_error_deg());
  }
};

std::string figures(std::vector<double> errors) {
  if (errors.empty()) return "-";
  std::sort(errors.begin(), errors.end());
  return fmt::format("{:.4f} / {:.4f} / {:.4f}", errors[errors.size() / 2], errors[errors.size() * 95 / 100],
                     errors.back());
}

void print(const std::string& what, const Errors& errors) {
  fmt::print("| {} | {} | {} | {} | {} | {} | {:.1f} | {} |\n", what, errors.paraxial.size(),
             figures(errors.paraxial), figures(errors.spot), figures(errors.sharpness), figures(errors.axis),
             static_cast<double>(errors.images) / static_cast<double>(errors.paraxial.size()),
             errors.refused);
  std::fflush(stdout);
}

int images_of(const raytrace::Tracer& tracer, const EyeModel& eye) {
  PrescriptionSettings settings;
  settings.verbosity.quiet = true;
  return prescribe(tracer, eye, settings).images();
}

void print_images(const raytrace::Tracer& tracer, int eyes) {
  for (const double ratio : {1.138, 1 / 1.089})
    fmt::print("Fig. 7, {:.3f}: {}\n", ratio, images_of(tracer, figure_seven_eye(ratio)));
  for (const char* name : {"navarro", "atchison:-2", "atchison:-10"})
    fmt::print("{}: {}\n", name, images_of(tracer, make_eye(name)));
  std::vector<int> images;
  for (int i = 1; i <= eyes; ++i) {
    images.push_back(images_of(tracer, random_eye(static_cast<std::uint64_t>(i))));
    std::sort(images.begin(), images.end());
    fmt::print("{} random eyes: median {}, 95th percentile {}, most {}\n", i, images[images.size() / 2],
               images[images.size() * 95 / 100], images.back());
    std::fflush(stdout);
  }
}

}  // namespace
}  // namespace emmetrope::correction

int main(int argc, char** argv) {
  using namespace emmetrope;
  using namespace emmetrope::correction;
  if (argc > 1 && std::string(argv[1]) == "images") {
    print_images(raytrace::Tracer("", 1), argc > 2 ? std::atoi(argv[2]) : 30);
    return 0;
  }
  const int eyes = argc > 1 ? std::atoi(argv[1]) : 200, first = argc > 2 ? std::atoi(argv[2]) : 1;
  const raytrace::Tracer tracer("", 1);
  fmt::print(
      "| eyes | number | paraxial, D | smallest spot, D | sharpest, D | axis at >= 1 D, deg | images | "
      "refused |\n| --- | --- | --- | --- | --- | --- | --- | --- |\n");
  Errors lenses;
  for (int i = 0; i < (first == 1 ? 10 : 0); ++i) {
    const EyeModel eye = behind_known_lens(make_eye("gullstrand-emsley"), known_lens(i));
    ClosedLoop loop = closed_loop(tracer, eye, beyond_known_lens_mm);
    lenses.add(loop);
    const double off_D = (loop.paraxial - refraction_behind(known_lens(i))).norm();
    if (off_D > 0.02) fmt::print("known lens {}: {:.3f} D off the closed form\n", i, off_D);
  }
  Errors atchison;
  if (first == 1) {
    print("a known lens before an emmetropic eye", lenses);
    for (const char* name : {"atchison:-2", "atchison:-4", "atchison:-6", "atchison:-8", "atchison:-10"})
      atchison.add(closed_loop(tracer, make_eye(name), 12));
    print("Atchison, -2 to -10 D", atchison);
  }
  Errors random;
  for (int i = 0; i < eyes; ++i) {
    const ClosedLoop loop = closed_loop(tracer, random_eye(static_cast<std::uint64_t>(first + i)), 12);
    random.add(loop);
    if (!loop.converged || loop.sharpness_error_D() > 0.05 || loop.spot_error_D() > 0.03)
      fmt::print(stderr, "random {}: converged {}, sharpness {:.3f}, spot {:.3f}, M {:.2f} C {:.2f}\n",
                 first + i, loop.converged, loop.sharpness_error_D(), loop.spot_error_D(),
                 loop.smallest_spot[0], loop.cylinder_D());
    if ((i + 1) % 20 == 0) print(fmt::format("random biconic corneas, {}", i + 1), random);
  }
  if (eyes % 20 != 0) print("random biconic corneas", random);
}
