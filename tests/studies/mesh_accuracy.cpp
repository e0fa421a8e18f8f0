// Prints how meshes approach the surface they were made from: exit direction and preparation time against
// vertices. Not part of the default tests; docs/evidence/mesh-accuracy.md shows its output.
#include <fmt/format.h>

#include <chrono>
#include <cstdio>

#include "pipeline/eye/optics/exact_trace.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "tests/support/meshed_eye.hpp"

int main() {
  using namespace emmetrope;
  EyeModel irregular = make_eye("navarro");
  std::vector<double> terms(10, 0.0);
  terms[6] = terms[7] = 5;
  irregular.surface("cornea_anterior").shape = make_zernike(7.95, 7.7, -0.23, -0.2, 15, 5, terms);
  fmt::print(
      "eye,vertices,triangles_own_normals_arcmin,triangles_estimated_normals_arcmin,smooth_arcmin,patch_s\n");
  for (const auto& [name, eye] : {std::pair{"navarro", make_eye("navarro")}, {"irregular", irregular}})
    for (const int vertices : {565, 800, 1516, 3200, 12800, 51200}) {
      const auto error = [&, &exact = eye](MeshInterpolation interpolation, bool own_normals) {
        return testing_eye::exit_error_arcmin(
            exact, testing_eye::meshed(exact, vertices, interpolation, own_normals));
      };
      const TriangleMesh cornea =
          testing_eye::jittered_sheet(*eye.surface("cornea_anterior").shape, 5, vertices, 1);
      const auto start = std::chrono::steady_clock::now();
      const bool fitted = HeightField::fit(cornea).has_value();
      const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
      fmt::print("{},{},{:.4f},{:.4f},{:.5f},{:.3f}\n", name, vertices,
                 error(MeshInterpolation::triangles, true), error(MeshInterpolation::triangles, false),
                 error(MeshInterpolation::smooth, true), fitted ? seconds : -1);
      std::fflush(stdout);
    }
}
