#include "raytrace/wavefront/field.hpp"

#include <gtest/gtest.h>

#include <numeric>
#include <opencv2/imgcodecs.hpp>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "tests/support/plain_eye.hpp"
#include "tests/support/random_conic_eye.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope::raytrace {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

TEST(Field, GridIsEvenRoundAndBeginsAtTheTop) {
  const std::vector<Vector2d> directions = FieldGrid{10, 5}.directions_deg();
  ASSERT_EQ(directions.size(), 13U);  // 5, 5 lies at 7 degrees, 10, 5 beyond 10
  EXPECT_EQ(directions.front(), Vector2d(0, 10));
  EXPECT_EQ(directions[1], Vector2d(-5, 5));
  EXPECT_EQ(directions.back(), Vector2d(0, -10));
  EXPECT_THROW((FieldGrid{90, 5}.check()), Error);
  EXPECT_THROW((FieldGrid{10, 0}.check()), Error);
  EXPECT_THROW((FieldGrid{80, 0.5}.check()), Error);
}

TEST(Field, TheRetinaSeesADirectionWhereItsChiefRayMeetsIt) {
  for (int seed = 0; seed < 5; ++seed) {
    EyeModel eye = random_conic_eye(seed);
    eye.surface("iris").decentre_mm = {0.1 * seed, -0.05 * seed};
    const PlainEye plain(eye, eye.reference_wavelength_nm);
    const ChiefRays rays(eye, eye.reference_wavelength_nm);
    for (const Vector2d& deg : FieldGrid{60, 20}.directions_deg()) {
      const Vector3d wanted(std::tan(deg.x() * degree), std::tan(deg.y() * degree), 1);
      const std::optional<RetinaPoint> image = rays.image_of(wanted);
      ASSERT_TRUE(image) << deg.transpose();
      const Vector2d from_pole_mm = image->position_mm.head<2>();
      EXPECT_NEAR((plain.retina(from_pole_mm) - image->position_mm).norm(), 0, 1e-9);
      const PlainPupil pupil(plain, from_pole_mm, 3);
      EXPECT_NEAR(pupil.sight.cross(wanted.normalized()).norm(), 0, 1e-8) << deg.transpose();
    }
  }
}

TEST(Field, TheRetinaInFrontOfItsEquatorSeesToo) {
  const EyeModel eye = make_eye("navarro");
  const ChiefRays rays(eye, 555);
  for (const double away_deg : {75.0, 95.0}) {
    const auto seen = retina_seeing(rays, {away_deg, 0});
    ASSERT_TRUE(seen) << away_deg;
    EXPECT_LT(seen->x(), 0);
    EXPECT_GT(seen->z(), retina_centre(eye).z());
    const auto sight = rays.line_of_sight(*seen);
    ASSERT_TRUE(sight) << away_deg;
    EXPECT_NEAR(std::atan2(sight->direction.x(), sight->direction.z()) / degree, away_deg, 1e-6);
    EXPECT_FALSE(
        wavefront_towards(eye, rays, {away_deg, 0}, {}));  // known by x and y alone, as behind the equator
  }
  EXPECT_FALSE(retina_seeing(rays, {0, 130}));
  for (const Vector2d& none : {Vector2d(NAN, 0), Vector2d(95, 20), Vector2d(181, 0)})
    EXPECT_THROW(retina_seeing(rays, none), Error) << none.transpose();
}

TEST(Field, FilesHoldAnEntryForEveryDirection) {
  const test::TemporaryFolder folder;
  EyeModel eye = make_eye("navarro");
  eye.set_stop_diameter(3);
  WavefrontSettings settings;
  settings.wavelength_nm = 555;
  write_field(eye, {30, 15}, settings, folder.path(), 2, {true});
  const Json json = read_json(folder.path() / "field.json");
  const std::size_t count = json["horizontal_deg"].size();
  EXPECT_EQ(count, 13U);
  for (const char* key :
       {"vertical_deg", "retina_mm", "retina_arc_mm", "pupil_mm", "pupil_area_mm2", "zernike_um", "rms_um",
        "higher_order_rms_um", "spot_rms_arcmin", "strehl", "vsotf", "tangential_deg"})
    EXPECT_EQ(json[key].size(), count) << key;
  EXPECT_EQ(json["mtf"]["tangential"].size(), count);
  EXPECT_EQ(json["mtf"]["tangential"][0].size(), json["mtf"]["cpd"].size());
  std::vector<cv::Mat> pages;
  ASSERT_TRUE(cv::imreadmulti((folder.path() / "psf-grid.tiff").string(), pages, cv::IMREAD_UNCHANGED));
  ASSERT_EQ(pages.size(), count);
  for (std::size_t k = 0; k < count; ++k) {
    const Wavefront wavefront = [&] {
      WavefrontSettings there = settings;
      there.fovea_mm = {json["retina_mm"][k][0].get<double>(), json["retina_mm"][k][1].get<double>()};
      return measure_wavefront(eye, there);
    }();
    EXPECT_NEAR(wavefront.line_of_sight_deg.x(), json["horizontal_deg"][k].get<double>(), 1e-6);
    EXPECT_NEAR(wavefront.line_of_sight_deg.y(), json["vertical_deg"][k].get<double>(), 1e-6);
    EXPECT_NEAR(wavefront.minimum_rms_spot.M_D, json["minimum_rms_spot"]["M_D"][k].get<double>(), 1e-9);
    // The page holds the light, and its second moment is the spots'.
    ASSERT_EQ(pages[k].rows, json["psf"]["side"].get<int>());
    const double pitch = json["psf"]["pitch_arcmin"][k];
    double light = 0, square = 0;
    Vector2d mean(0, 0);
    for (int row = 0; row < pages[k].rows; ++row)
      for (int column = 0; column < pages[k].cols; ++column) {
        const double value = pages[k].ptr<float>(row)[column];
        const Vector2d at(column - pages[k].cols / 2, row - pages[k].rows / 2);
        light += value;
        mean += value * at;
        square += value * at.squaredNorm();
      }
    EXPECT_NEAR(light, 1, 0.01);
    if (json["spot_rms_arcmin"][k].get<double>() < 4) continue;  // diffraction is as wide
    const double rms = pitch * std::sqrt(square / light - (mean / light).squaredNorm());
    EXPECT_NEAR(rms, json["spot_rms_arcmin"][k].get<double>(), 0.1 * rms);
  }
  EXPECT_TRUE(std::filesystem::exists(folder.path() / "psf-grid.png"));
}

}  // namespace
}  // namespace emmetrope::raytrace
