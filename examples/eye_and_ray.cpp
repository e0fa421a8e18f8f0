// Navarro's eye accommodated by 3 D: its power, and one ray from 2 mm above the axis to the retina.
#include <cstdio>

#include "pipeline/eye/model/eye_model.hpp"
#include "pipeline/eye/optics/exact_trace.hpp"
#include "pipeline/eye/optics/paraxial.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"

int main() {
  using namespace emmetrope;
  EyeOptions options;
  options.accommodation_D = 3;
  const EyeModel eye = make_eye("navarro", options);
  const double nm = eye.reference_wavelength_nm;
  std::printf("power %.2f D, refraction %.2f D\n", cardinal_points(eye, nm).power_D,
              paraxial_refraction(eye, nm).M_D);

  const Ray ray{{0, 2, 10}, {0, 0, -1}};  // eye frame, mm: z out of the eye
  const RayPath path = trace_exact(eye, ray, nm);
  for (const RayHit& hit : path.hits)
    std::printf("%-18s x %.4f y %.4f z %.4f mm\n", hit.surface.c_str(), hit.position_mm.x(),
                hit.position_mm.y(), hit.position_mm.z());
  std::printf("%s\n", to_string(path.state));
}
