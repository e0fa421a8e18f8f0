// The lens that makes the retinal image of an eye sharpest.
#include <cstdio>

#include "correction/prescription/prescription.hpp"
#include "pipeline/base/notation.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"

int main() {
  using namespace emmetrope;
  const EyeModel eye = make_eye("atchison:-4");
  const raytrace::Tracer tracer("");
  correction::PrescriptionSettings settings;
  settings.vertex_distance_mm = 12;
  settings.verbosity.quiet = true;
  const correction::SearchResult sharpest = correction::sharpest_lens(tracer, eye, settings);
  const PowerVector lens = sharpest.family.power(sharpest.best.lens);
  std::printf("sharpest image: M %.2f, J0 %.2f, J45 %.2f D\n", lens.M_D, lens.J0_D, lens.J45_D);
  std::printf("dispensed as: %s\n", format_refraction(round_refraction(lens).refraction).c_str());
}
