#include "raytrace/system/device_surface.hpp"

#include <gtest/gtest.h>

#include "pipeline/eye/model/mesh_shape.hpp"
#include "pipeline/eye/surfaces/shape.hpp"
#include "tests/support/sheet.hpp"

namespace emmetrope::raytrace {
namespace {

// The wavefront and single rays meet the mesh as it says; the picture of the same eye too.
TEST(DeviceSurface, OfAMeshThatIsTrianglesIsTrianglesHoweverItIsAskedFor) {
  const TriangleMesh sheet = testing_eye::jittered_sheet(*make_conic(7.8, -0.2), 5, 565, 1);
  for (const Representation asked :
       {Representation::analytic, Representation::smooth, Representation::fast, Representation::triangles}) {
    SCOPED_TRACE(to_string(asked));
    EXPECT_EQ(
        device_surface(make_mesh_surface("cornea_anterior", sheet, "cornea", MeshInterpolation::triangles),
                       asked, 800)
            .kind,
        Operation::triangles);
    EXPECT_EQ(device_surface(make_mesh_surface("cornea_anterior", sheet, "cornea"), asked, 800).kind,
              asked == Representation::triangles ? Operation::triangles : Operation::patch);
  }
}

}  // namespace
}  // namespace emmetrope::raytrace
