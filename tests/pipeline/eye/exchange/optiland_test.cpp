#include "pipeline/eye/exchange/optiland.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/eye/optics/exact_trace.hpp"
#include "pipeline/eye/optics/paraxial.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope {
namespace {

using test::TemporaryFolder;

std::string surface(const std::string& geometry, double z_mm, double index, bool stop, const char* comment) {
  return fmt::format(
      R"({{"type": "Surface", "geometry": {{{}, "cs": {{"x": 0.0, "y": 0.0, "z": {}, "rx": 0.0, "ry": 0.0, "rz": 0.0,
      "reference_cs": null}}}}, "material_post": {{"type": "IdealMaterial", "index": {}, "absorp": 0.0}},
      "is_stop": {}, "is_reflective": false, "comment": "{}"}})",
      geometry, z_mm, index, stop, comment);
}

std::string standard(double radius, double conic) {
  return fmt::format(R"("type": "StandardGeometry", "radius": {}, "conic": {})", radius, conic);
}

/// Navarro's eye as Optiland saves it; infinite numbers are no JSON.
std::string lens(const std::string& cornea = standard(7.72, -0.26)) {
  const std::string plane = R"("type": "Plane", "radius": Infinity)";
  return R"({"version": 1.0, "aperture": {"type": "float_by_stop_size", "value": 2.7},
 "wavelengths": {"wavelengths": [{"value": 0.5893, "is_primary": true, "unit": "um"}]},
 "surface_group": {"surfaces": [{"type": "ObjectSurface", "geometry": {"type": "Plane", "cs": {"z": -Infinity}}},)" +
         surface(cornea, 0, 1.376, false, "cornea front") + "," +
         surface(standard(6.5, 0), 0.55, 1.3374, false, "cornea back / aqueous") + "," +
         surface(plane, 3.6, 1.3374, true, "pupil") + "," +
         surface(standard(10.2, -3.1316), 3.6, 1.42, false, "lens front") + "," +
         surface(standard(-6, -1), 7.6, 1.336, false, "lens back / vitreous") + "," +
         surface(standard(-12, 0), 24.00398, 1.336, false, "retina") + "]}}";
}

TEST(Optiland, AVisisipyEyeIsNavarros) {
  const TemporaryFolder folder;
  write_file(folder.path() / "model.json", lens());
  const EyeModel eye = make_eye((folder.path() / "model.json").string());
  const EyeModel known = make_eye("navarro", {0, {}, 2.7, Laterality::od});
  for (std::size_t k = 0; k < known.surfaces.size(); ++k)
    EXPECT_EQ(eye.surfaces[k].name, known.surfaces[k].name);
  EXPECT_EQ(eye.stop()->stop_diameter_mm, 2.7);
  const double nm = known.reference_wavelength_nm;
  EXPECT_NEAR(eye.reference_wavelength_nm, nm, 1e-9);
  EXPECT_NEAR(paraxial_refraction(eye, nm).M_D, paraxial_refraction(known, nm).M_D, 1e-9);
  const Ray ray{{0.8, 0.4, 5}, Eigen::Vector3d(0.1, -0.2, -1).normalized()};
  EXPECT_LT((trace_exact(eye, ray, nm).hits.back().position_mm -
             trace_exact(known, ray, nm).hits.back().position_mm)
                .norm(),
            1e-9);
}

std::string fault_of(const std::string& text) {
  try {
    eye_from_optiland(parse_json(without_infinities(text), "model.json"));
  } catch (const Error& error) {
    return error.what();
  }
  return "none";
}

TEST(Optiland, WhatEyesDoNotNeedIsRefusedByName) {
  EXPECT_THAT(fault_of(lens(R"("type": "BiconicGeometry", "radius_x": 8)")),
              testing::HasSubstr("surfaces[1]: a geometry of type BiconicGeometry"));
  EXPECT_THAT(fault_of(lens(R"("type": "StandardGeometry", "conic": 0)")), testing::HasSubstr("\"radius\""));
  EXPECT_THAT(fault_of(R"({"surface_group": {"surfaces": []}})"),
              testing::HasSubstr("wavelengths: none is primary"));
  EXPECT_THAT(fault_of(R"({"surface_group": {"surfaces": [1, 2, 3]}, "wavelengths": 3})"),
              testing::HasSubstr("no lens of Optiland"));
  EXPECT_EQ(without_infinities("{\"Infinity\": -Infinity, \"b\":NaN, \"c\": \"NaN\"}"),
            "{\"Infinity\": null, \"b\":null, \"c\": \"NaN\"}");
  EXPECT_THAT(fault_of(R"({"surface_group": 3})"), testing::HasSubstr("surface_group"));
}

}  // namespace
}  // namespace emmetrope
