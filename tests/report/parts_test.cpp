#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <numeric>

#include "fixture_case.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/report/cornea_map.hpp"
#include "pipeline/report/dicom/object.hpp"
#include "pipeline/report/encoding.hpp"
#include "pipeline/report/numbers.hpp"
#include "pipeline/report/point_spread.hpp"
#include "pipeline/report/slices.hpp"

namespace emmetrope::report {
namespace {

TEST(Numbers, AreWrittenWithoutLocaleAndWithoutMinusZero) {
  EXPECT_EQ(fixed(-0.0004, 2), "0.00");
  EXPECT_EQ(signed_fixed(0.004, 2), "0.00");
  EXPECT_EQ(signed_fixed(1.25, 2), "+1.25");
  EXPECT_EQ(signed_fixed(-1.255, 1), "-1.3");
  EXPECT_EQ(format(23.456, {2, false, "mm"}), "23.46 mm");
  EXPECT_EQ(format(std::nan(""), {2, false, "mm"}), "not determined");
  EXPECT_EQ(format_interval({1, {0.5, 1.5}, "mri"}, {2, true, "D"}), "+0.50 to +1.50");
}

TEST(Numbers, RefractionsFollowClinicalNotation) {
  EXPECT_EQ(format_refraction(-2.25, -1, 180), "-2.25 / -1.00 x 180");
  EXPECT_EQ(format_refraction(0, -0.5, 0), "0.00 / -0.50 x 180");
  EXPECT_EQ(format_refraction(1.5, -0.75, 5), "+1.50 / -0.75 x 005");
  EXPECT_EQ(format_refraction(-3, 0, 0), "-3.00 DS");
}

TEST(Encoding, EscapesMarkupAndRepairsText) {
  EXPECT_EQ(escape_xml("<a href=\"x\">&'"), "&lt;a href=&quot;x&quot;&gt;&amp;&#39;");
  EXPECT_EQ(clean_text("a\x01\nb"), "a  b");
  EXPECT_EQ(clean_text("\xff"), "\xef\xbf\xbd");
  EXPECT_EQ(base64("Man"), "TWFu");
}

TEST(StableUid, DependsOnTheTextAloneAndIsAValidUid) {
  const std::string uid = stable_uid("report");
  EXPECT_EQ(uid, stable_uid("report"));
  EXPECT_NE(uid, stable_uid("reports"));
  EXPECT_LE(uid.size(), 64U);
  EXPECT_EQ(uid.rfind("2.25.", 0), 0U);
  EXPECT_NE(uid[5], '0');
  EXPECT_EQ(uid.find_first_not_of("0123456789."), std::string::npos);
}

// Noll's and OSA's polynomials have unit mean square over the disc and vanishing products.
TEST(Zernike, TermsAreOrthonormalOverTheDisc) {
  constexpr int rings = 200, spokes = 64;
  for (int a = 0; a < 15; ++a)
    for (int b = a; b < 15; ++b) {
      double sum = 0;
      for (int i = 0; i < rings; ++i)
        for (int j = 0; j < spokes; ++j) {
          const double rho = (i + 0.5) / rings, theta = 2 * pi * j / spokes;
          sum += zernike_value(a, rho, theta) * zernike_value(b, rho, theta) * rho;
        }
      EXPECT_NEAR(sum * 2 / (rings * spokes), a == b ? 1 : 0, 2e-3) << a << " " << b;
    }
}

// A perfect pupil: the modulation is the closed form of the circular aperture.
TEST(PointSpread, OfAPerfectPupilReachesTheDiffractionLimit) {
  const PupilWavefront perfect{3, 555, {}};
  const Picture spread = point_spread(perfect);
  EXPECT_NEAR(std::accumulate(spread.values.begin(), spread.values.end(), 0.0), 1, 1e-4);
  const std::vector<double> cpd{5, 10, 20, 30, 40, 60, 80};
  const Modulation mtf = modulation_transfer(spread, cpd);
  for (std::size_t i = 0; i < cpd.size(); ++i) {
    EXPECT_NEAR(mtf.horizontal[i], diffraction_mtf(cpd[i], 3, 555), 0.004) << cpd[i];
    EXPECT_NEAR(mtf.vertical[i], diffraction_mtf(cpd[i], 3, 555), 0.004) << cpd[i];
  }
  EXPECT_EQ(diffraction_mtf(200, 3, 555), 0);
}

// Geometrical optics: one dioptre of defocus blurs a point into a disc of pupil times defocus, here 4 mrad.
TEST(PointSpread, DefocusSpreadsAPointOverPupilTimesDioptres) {
  constexpr double pupil_mm = 4, defocus_D = 2;
  PupilWavefront blurred{pupil_mm, 555, std::vector<double>(6, 0)};
  blurred.zernike_um[4] = -defocus_D * pupil_mm * pupil_mm / 4 / (4 * std::sqrt(3.0));
  const Picture spread = point_spread(blurred);
  double inside = 0, within_half = 0;
  for (int row = 0; row < spread.side; ++row)
    for (int column = 0; column < spread.side; ++column) {
      const double r = std::hypot(row - spread.side / 2, column - spread.side / 2) * spread.arcmin_per_pixel;
      const double radius = pupil_mm * defocus_D / 2 * 1e-3 * 180 * 60 / pi;
      const double value = spread.values[static_cast<std::size_t>(row) * spread.side + column];
      if (r < 1.1 * radius) inside += value;
      if (r < radius / std::sqrt(2)) within_half += value;
    }
  EXPECT_GT(inside, 0.97);
  EXPECT_NEAR(within_half, 0.5, 0.03);
}

// The lens that the wavefront asks for leaves the diffraction limit.
TEST(PointSpread, TheRightLensRemovesDefocusAndAstigmatism) {
  constexpr double r2 = 1.5 * 1.5;
  const PowerVector error{-2, 0.4, -0.3};
  const PupilWavefront blurred{
      3,
      555,
      {0, 0, 0, -error.J45_D * r2 / (2 * std::sqrt(6.0)), -error.M_D * r2 / (4 * std::sqrt(3.0)),
       -error.J0_D * r2 / (2 * std::sqrt(6.0))}};
  const Modulation mtf = modulation_transfer(point_spread(corrected_by(blurred, error)), {20});
  EXPECT_NEAR(mtf.horizontal[0], diffraction_mtf(20, 3, 555), 0.004);
}

/// A polar sheet of a sphere in the eye's frame.
TriangleMesh spherical_cornea(double radius_mm) {
  TriangleMesh mesh;
  constexpr int rings = 24, spokes = 48;
  const auto add = [&](double x, double y) {
    const Eigen::Vector3d p(x, y, std::sqrt(radius_mm * radius_mm - x * x - y * y) - radius_mm);
    mesh.vertices.push_back(p);
    mesh.normals.push_back((p + Eigen::Vector3d(0, 0, radius_mm)).normalized());
  };
  add(0, 0);
  for (int ring = 1; ring <= rings; ++ring)
    for (int spoke = 0; spoke < spokes; ++spoke)
      add(5.0 * ring / rings * std::cos(2 * pi * spoke / spokes),
          5.0 * ring / rings * std::sin(2 * pi * spoke / spokes));
  const auto at = [&](int ring, int spoke) { return 1 + (ring - 1) * spokes + spoke % spokes; };
  for (int spoke = 0; spoke < spokes; ++spoke) mesh.triangles.push_back({0, at(1, spoke), at(1, spoke + 1)});
  for (int ring = 1; ring < rings; ++ring)
    for (int spoke = 0; spoke < spokes; ++spoke) {
      mesh.triangles.push_back({at(ring, spoke), at(ring + 1, spoke), at(ring + 1, spoke + 1)});
      mesh.triangles.push_back({at(ring, spoke), at(ring + 1, spoke + 1), at(ring, spoke + 1)});
    }
  return mesh;
}

TEST(CorneaMap, OfASphereIsConstantPowerAndFlat) {
  const CorneaGrid grid = cornea_grid(spherical_cornea(7.8), 4, 41);
  EXPECT_NEAR(grid.best_sphere_radius_mm, 7.8, 1e-9);
  int cells = 0;
  for (std::size_t i = 0; i < grid.axial_power_D.size(); ++i) {
    if (!std::isfinite(grid.axial_power_D[i])) continue;
    ++cells;
    EXPECT_NEAR(grid.axial_power_D[i], 337.5 / 7.8, 0.05);
    EXPECT_NEAR(grid.elevation_um[i], 0, 1e-6);
  }
  EXPECT_GT(cells, 1100);  // pi / 4 of 41 x 41
}

TEST(Volume, KnowsItsPlaceInThePatient) {
  const std::filesystem::path folder =
      std::filesystem::path(::testing::TempDir()) / ("emmetrope-volume-" + std::to_string(::getpid()));
  std::filesystem::remove_all(folder);
  test::make_fixture_case(folder);
  const Volume volume(folder / "segmentation" / "stack1_labels.nii.gz");
  EXPECT_EQ(volume.size(), Eigen::Vector3i(140, 70, 60));
  // First voxel at LPS (-56, -60, -24), 0.8 mm along +x, +y, +z.
  Eigen::Matrix4d expected = Eigen::Matrix4d::Identity() * 0.8;
  expected.col(3) = Eigen::Vector4d(-56, -60, -24, 1);
  EXPECT_TRUE(volume.lps_from_voxel().isApprox(expected, 1e-6)) << volume.lps_from_voxel();
  // The middle of the right globe is vitreous (4), that of the left too (14).
  const auto label_at = [&](const Eigen::Vector3d& lps) {
    const Eigen::Vector4d voxel = volume.lps_from_voxel().inverse() * lps.homogeneous();
    return volume.at(static_cast<int>(std::lround(voxel.x())), static_cast<int>(std::lround(voxel.y())),
                     static_cast<int>(std::lround(voxel.z())));
  };
  EXPECT_EQ(label_at({-31, -38, 3}), 4);
  EXPECT_EQ(label_at({31, -38, 3}), 14);
  EXPECT_GT(volume.coverage({-31, -38, 3}, 11), 0.99);
  EXPECT_EQ(volume.coverage({-131, -38, 3}, 11), 0);
  std::filesystem::remove_all(folder);
}

TEST(Slice, IsInRadiologicalConventionAndNamesItsSides) {
  const std::filesystem::path folder =
      std::filesystem::path(::testing::TempDir()) / ("emmetrope-slice-" + std::to_string(::getpid()));
  std::filesystem::remove_all(folder);
  test::make_fixture_case(folder);
  const Volume volume(folder / "segmentation" / "stack1.nii.gz");
  // A short line of triangles 10 mm to the patient's left of the centre: it must be drawn on the right half.
  TriangleMesh mesh;
  mesh.vertices = {{-21, -40, 0}, {-21, -36, 0}, {-21, -38, 6}};
  mesh.triangles = {{0, 1, 2}};
  const Figure figure =
      slice_figure(volume, Plane::axial, {-31, -38, 3}, 40, {{mesh, "#123456", "test"}}, "slice");
  const std::size_t path = figure.svg.find("<path d=\"M");
  ASSERT_NE(path, std::string::npos);
  // 40 mm over 360 pixels: 10 mm right of the middle is pixel 270.
  EXPECT_NEAR(std::stod(figure.svg.substr(path + 10)), 270, 0.2);
  for (const char* letter : {">R<", ">L<", ">A<", ">P<"})
    EXPECT_THAT(figure.svg, ::testing::HasSubstr(letter));
  const std::size_t right = figure.svg.find("class=\"radiological\"");
  EXPECT_THAT(figure.svg.substr(right, 60), ::testing::HasSubstr("x=\"14\""));  // R, the first, on the left
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace emmetrope::report
