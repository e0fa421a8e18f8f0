// Spectacle lenses against closed forms: vertex power, prism, Prentice's rule, thickness, gaze.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/optics/exact_trace.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "raytrace/spectacle/spectacle.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope::raytrace {
namespace {

using test::TemporaryFolder;

EyeModel bare() { return make_eye("navarro", {}); }

/// Direction behind the spectacle of a ray that comes in parallel to the axis at (x, y).
Eigen::Vector3d behind(const EyeModel& eye, double x, double y, double nm = 589.3) {
  const RayPath path = trace_exact(eye, {{x, y, 60}, -Eigen::Vector3d::UnitZ()}, nm);
  for (const auto& hit : path.hits)
    if (hit.surface == "spectacle_back") return hit.direction;
  ADD_FAILURE() << "the ray never met spectacle_back";
  return {};
}
/// Back vertex power in the meridian at `angle_deg`, from a ray 0.02 mm off the axis and where it leaves the
/// back.
double vertex_power_D(const EyeModel& eye, double angle_deg, double nm = 589.3) {
  const Eigen::Vector2d u(std::cos(angle_deg * degree), std::sin(angle_deg * degree));
  const RayPath path = trace_exact(eye, {{0.02 * u.x(), 0.02 * u.y(), 60}, -Eigen::Vector3d::UnitZ()}, nm);
  const auto& hit = path.hits.at(1);
  return -1000 * hit.direction.head<2>().dot(u) / -hit.direction.z() / hit.position_mm.head<2>().dot(u);
}

TEST(Meniscus, HasItsBackVertexPowerWhateverItsBaseThicknessAndIndex) {
  for (const double base : {0.0, 4.0, 8.0})
    for (const double index : {1.5, 1.74})
      for (const double sphere : {-6.0, 0.5, 5.0}) {
        Meniscus lens;
        lens.power = to_power_vector({sphere, -1.5, 30});
        lens.base_D = base;
        lens.index = index;
        lens.semi_diameter_mm = 20;
        const EyeModel eye = with_meniscus(bare(), lens);
        EXPECT_NEAR(vertex_power_D(eye, 30), sphere, 2e-4) << base << " " << index;
        EXPECT_NEAR(vertex_power_D(eye, 120), sphere - 1.5, 2e-4) << base << " " << index;
        EXPECT_NEAR(eye.surface("spectacle_back").position_mm, -12, 1e-12);
        EXPECT_NEAR(1000 * (index - 1) * eye.surface("spectacle_front").shape->vertex_curvature()(0, 0), base,
                    1e-6);
      }
}

// Both would stand in one place, and the first be made of the second's glass.
TEST(Spectacle, OfAnEyeThatWearsOneIsRefused) {
  const EyeModel worn = with_spectacle(bare(), parse_spectacle("-2/0x0@12"));
  for (const char* lens : {"-3/0x0@12", "-3/0x0@20,index=1.6"})
    EXPECT_THROW(with_spectacle(worn, parse_spectacle(lens)), Error) << lens;
}

TEST(Meniscus, DispersesByItsAbbeNumber) {
  Meniscus lens;
  lens.power = {-6, 0, 0};
  lens.abbe = 32;
  const EyeModel eye = with_meniscus(bare(), lens);
  // chromatic aberration of a lens: power over Abbe number, between the F and C lines
  EXPECT_NEAR(vertex_power_D(eye, 0, 486.13) - vertex_power_D(eye, 0, 656.27), -6.0 / 32, 3e-3);
}

TEST(Meniscus, IsThickEnoughForItsRim) {
  Meniscus lens;
  lens.power = {6, 0, 0};
  lens.base_D = 8;
  const EyeModel plus = with_meniscus(bare(), lens);
  const Surface &front = plus.surface("spectacle_front"), &back = plus.surface("spectacle_back");
  const double centre = back.position_mm - front.position_mm;
  EXPECT_GT(centre, 4);
  EXPECT_NEAR(centre + *back.shape->depth_mm(30, 0) - *front.shape->depth_mm(30, 0), least_edge_mm, 1e-3);
  lens.power = {-6, 0, 0};
  const EyeModel minus = with_meniscus(bare(), lens);
  EXPECT_NEAR(minus.surface("spectacle_back").position_mm - minus.surface("spectacle_front").position_mm, 2,
              1e-12);
  lens.power = {6, 0, 0};
  lens.centre_thickness_mm = 2;
  EXPECT_THROW(with_meniscus(bare(), lens), Error);
}

TEST(Prism, TurnsTheLineOfSightTowardsTheBaseByItsPower) {
  for (const double base : {0.0, 90.0, 215.0}) {
    Meniscus lens;
    lens.power = {-3, 0, 0};
    lens.prism = {6, base};
    for (const EyeModel& eye :
         {with_thin_lens(bare(), lens.power, 12, lens.prism), with_meniscus(bare(), lens)}) {
      // from the eye outward along the axis: met at right angles by the back, deviated by the front
      const RayPath path = trace_exact(eye, {{0, 0, 11}, Eigen::Vector3d::UnitZ()}, 589.3);
      ASSERT_EQ(path.state, RayState::reached);
      const Eigen::Vector3d out = path.hits.back().direction;
      EXPECT_NEAR(out.x() / out.z(), 0.06 * std::cos(base * degree), 1e-9);
      EXPECT_NEAR(out.y() / out.z(), 0.06 * std::sin(base * degree), 1e-9);
    }
  }
}

TEST(Prism, FollowsPrentice) {
  // decentring a lens of F dioptres by c cm acts as F c prism dioptres
  const EyeModel eye = with_thin_lens(bare(), {-4, 0, 0}, 12);
  const Eigen::Vector3d d = behind(eye, 5, 0);
  EXPECT_NEAR(100 * d.x() / -d.z(), 4 * 0.5, 0.02);  // minus lens: base at the rim, light goes there
}

/// The wedge of a prism takes glass from the apex and gives it to the base: a minus lens, thick at its rim, bears one.
TEST(Spectacle, APrismThinsTheLensAtItsApexAlone) {
  const auto centre_of = [](const EyeModel& eye) {
    return eye.surface("spectacle_back").position_mm - eye.surface("spectacle_front").position_mm;
  };
  for (const double base_deg : {0.0, 200.0}) {
    const std::string prism = fmt::format("prism=4@{:g}", base_deg);
    EXPECT_NO_THROW(
        with_spectacle(bare(), parse_spectacle("-6/-2x30@14,base_D=3,index=1.6,thickness_mm=1.5," + prism)));
    EXPECT_NEAR(centre_of(with_spectacle(bare(), parse_spectacle("-6/-2x30@14,base_D=3,index=1.6," + prism))),
                2, 1e-9);
    // Of a plate the apex lies 30 mm from the centre: 4 cm/m over n - 1 times that is lost.
    const double plate =
        centre_of(with_spectacle(bare(), parse_spectacle("0@14,base_D=0,index=1.6," + prism)));
    EXPECT_NEAR(plate, std::max(2.0, least_edge_mm + 30 * 0.04 / 0.6), 0.02);
  }
  EXPECT_THROW(with_spectacle(bare(), parse_spectacle("0@14,base_D=0,index=1.6,thickness_mm=1.5,prism=4@90")),
               Error);
}

TEST(Spectacle, StaysWithTheHeadWhenTheEyeTurns) {
  // The same ray of the head's frame through the lens, before and after the eye has turned.
  const EyeModel eye = with_spectacle(bare(), parse_spectacle("-4/-2x20@12,base_D=5,index=1.6,prism=3@45"));
  const Eigen::Vector3d centre(0, 0, -13.5);
  const Eigen::Isometry3d eye_from_head =
      Eigen::Translation3d(centre) *
      Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), Eigen::Vector3d(0.4, -0.2, 1)).inverse() *
      Eigen::Translation3d(-centre);
  const EyeModel turned = fixed_to_head(eye, eye_from_head);
  const Ray ray{{3, -2, 60}, Eigen::Vector3d(0.1, 0.05, -1).normalized()};
  const auto at_back = [](const EyeModel& e, const Ray& r) { return trace_exact(e, r, 589.3).hits.at(1); };
  const auto before = at_back(eye, ray);
  const auto after = at_back(turned, {eye_from_head * ray.origin, eye_from_head.linear() * ray.direction});
  EXPECT_LT((after.position_mm - eye_from_head * before.position_mm).norm(), 1e-9);
  EXPECT_LT((after.direction - eye_from_head.linear() * before.direction).norm(), 1e-10);
}

TEST(Spectacle, WithoutPowerStaysWithTheHeadToo) {
  const Eigen::Isometry3d turn(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY()));
  for (const EyeModel& eye : {with_thin_lens(bare(), {0, 0, 0}, 12), with_plano_cylinder(bare(), 50, 30)})
    EXPECT_EQ(fixed_to_head(eye, turn).surfaces.size(), eye.surfaces.size());
}

TEST(Spectacle, OfAFileMayBeAContactLensOrReplaceTheLens) {
  const TemporaryFolder folder;
  const auto write = [&](const std::string& text) {
    std::ofstream(folder.path() / "worn.json") << text;
    return folder.path() / "worn.json";
  };
  const auto contact =
      write(R"({"media": {"hydrogel": {"index": 1.43}, "tears": {"index": 1.336}}, "surfaces": [
    {"name": "contact_front", "type": "sphere", "position_mm": -0.11, "radius_mm": 8.2, "medium_after": "hydrogel"},
    {"name": "contact_back", "type": "sphere", "position_mm": -0.01, "radius_mm": 7.8, "medium_after": "tears"}]})");
  const EyeModel worn = with_surfaces_of(bare(), contact);
  ASSERT_EQ(worn.surfaces[0].name, "contact_front");
  ASSERT_EQ(worn.surfaces[1].name, "contact_back");
  ASSERT_EQ(worn.surfaces[2].name, "cornea_anterior");
  const auto iol =
      write(R"({"removes": ["lens_anterior", "lens_posterior"], "media": {"acrylic": {"index": 1.55}},
    "surfaces": [
    {"name": "iol_front", "type": "sphere", "position_mm": 4.5, "radius_mm": 18, "medium_after": "acrylic"},
    {"name": "iol_back", "type": "sphere", "position_mm": 5.2, "radius_mm": -18, "medium_after": "vitreous"}]})");
  const EyeModel pseudophakic = with_surfaces_of(bare(), iol);
  const std::size_t n = pseudophakic.surfaces.size();
  EXPECT_EQ(pseudophakic.surfaces[n - 3].name, "iol_front");
  EXPECT_EQ(pseudophakic.surfaces[n - 2].name, "iol_back");
  EXPECT_EQ(pseudophakic.surfaces[n - 2].medium_after, "vitreous");
  EXPECT_EQ(trace_exact(pseudophakic, {{0, 0.5, 20}, -Eigen::Vector3d::UnitZ()}, 589.3).state,
            RayState::reached);
  for (const char* bad :
       {R"({"surfaces": []})", R"({"removes": ["nucleus"], "surfaces": [
        {"name": "a", "type": "plane", "position_mm": -5, "medium_after": "air"}]})",
        R"({"surfaces": [{"name": "a", "type": "plane", "position_mm": -5, "medium_after": "gold"}]})",
        R"({"media": {"lens": {"index": 1.5}}, "surfaces": [
        {"name": "a", "type": "plane", "position_mm": -5, "medium_after": "lens"}]})"})
    try {
      with_surfaces_of(bare(), write(bad));
      ADD_FAILURE() << bad;
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::input_invalid);
      EXPECT_NE(std::string(error.what()).find("worn.json"), std::string::npos) << error.what();
    }
}

TEST(Spectacle, IsReadAsCorrectPrintsIt) {
  const auto lens = [](const char* text) { return to_json(parse_spectacle(text)); };
  EXPECT_EQ(lens("-2.00 / -1.00 x 090 @ 12, prism = 2@90"), lens("-2/-1x90@12,prism=2@90"));
  EXPECT_EQ(lens("-2.00 DS"), lens("-2/0x0@12"));
  EXPECT_EQ(lens("PL, base_D=5"), lens("0@12,base_D=5"));
  EXPECT_NEAR(lens("+1/+2x90").at("power").at("M_D").get<double>(), 2, 1e-12);
}

TEST(Spectacle, KeysThatAreGivenTwiceAreRefusedByName) {
  for (const auto& [text, key] :
       {std::pair("0/0x0@12,prism=2@90,prism=2@0", "prism"), {"0/0x0@12,base_D=4,base_D=8", "base_D"}})
    try {
      parse_spectacle(text);
      ADD_FAILURE() << text;
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::usage);
      EXPECT_NE(std::string(error.what()).find(std::string(key) + " is given twice"), std::string::npos)
          << error.what();
    }
  try {
    parse_spectacle("0/0x0@12,prism=2@90,prism=2@0");
  } catch (const Error& error) {
    EXPECT_NE(error.remedy().find("2.83@45"), std::string::npos) << error.remedy();
  }
}

TEST(Spectacle, OfBadTextIsRefused) {
  for (const char* bad :
       {"", "abc", "-2/1", "-2/-1x", "-2@0", "-2@0.012", "-2@1", "-2@12,colour=3", "-2@12,index=9",
        "-2@12,prism=3", "-2@12,prism=2@400", "-2@12,prism=2@-1", "-2@12+-0.25"})
    try {
      parse_spectacle(bad);
      ADD_FAILURE() << bad;
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::usage) << bad;
    }
}

}  // namespace
}  // namespace emmetrope::raytrace
