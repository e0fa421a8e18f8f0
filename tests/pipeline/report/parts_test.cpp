#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numeric>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/base/process.hpp"
#include "pipeline/report/content/biometry_rows.hpp"
#include "pipeline/report/dicom/object.hpp"
#include "pipeline/report/document/numbers.hpp"
#include "pipeline/report/figures/chart.hpp"
#include "pipeline/report/figures/cornea_map.hpp"
#include "pipeline/report/figures/encoding.hpp"
#include "pipeline/report/figures/letter_chart.hpp"
#include "pipeline/report/figures/reference_mtf.hpp"
#include "pipeline/report/figures/slices.hpp"
#include "pipeline/report/figures/still.hpp"
#include "tests/support/fixture_case.hpp"

namespace emmetrope::report {
namespace {

TEST(BiometryRow, ARangeWithAnOpenEndIsSaidInWords) {
  for (const auto* rows : measured_rows())
    for (const BiometryRow& row : *rows)
      if (const Range range = row.normal({}).range; range.is_limited()) {
        EXPECT_EQ(format_range(range, row.style.decimals).find("inf"), std::string::npos) << row.key;
      }
  const auto index = std::find_if(retina_rows().begin(), retina_rows().end(), [](const BiometryRow& row) {
    return row.key == "retina/staphyloma_index";
  });
  ASSERT_NE(index, retina_rows().end());
  EXPECT_EQ(format_range(index->normal({}).range, index->style.decimals), "up to 40.0");
}

/// Of a good fit, 0.05 degrees (95 %).
TEST(BiometryRow, OfATiltShowsItsInterval) {
  for (const BiometryRow& row : retina_rows())
    if (row.style.unit == "deg") {
      EXPECT_EQ(format_interval({-0.008, {-0.055, 0.039}, "mri"}, row.style), "\u00b1 0.05\u00b0") << row.key;
    }
}

TEST(Numbers, AreWrittenWithoutLocaleAndWithoutMinusZero) {
  EXPECT_EQ(fixed(-0.0004, 2), "0.00");
  EXPECT_EQ(signed_fixed(0.004, 2), "0.00");
  EXPECT_EQ(signed_fixed(1.25, 2), "+1.25");
  EXPECT_EQ(signed_fixed(-1.255, 1), "-1.3");
  EXPECT_EQ(format(23.456, {2, false, "mm"}), "23.46 mm");
  EXPECT_EQ(format(std::nan(""), {2, false, "mm"}), "not determined");
  EXPECT_EQ(format_interval({1, {0.5, 1.5}, "mri"}, {2, true, "D"}), "+0.50 to +1.50");
}

TEST(Chart, AFolderForTemporaryFilesThatIsNotThereIsNamed) {
  if (!find_program("gnuplot")) GTEST_SKIP() << "gnuplot is not installed";
  const char* before = std::getenv("TMPDIR");
  const std::string kept = before == nullptr ? "/tmp" : before;
  ::setenv("TMPDIR", "/nope", 1);
  Figure figure;
  figure.id = "line";
  figure.width_px = figure.height_px = 100;
  try {
    draw_chart(figure, "plot x\n");
    ADD_FAILURE() << "drawn in no folder";
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), ExitStatus::not_writable);
    EXPECT_THAT(error.what(), testing::AllOf(testing::HasSubstr("/nope"), testing::HasSubstr("TMPDIR")));
    EXPECT_THAT(error.remedy(), testing::HasSubstr("TMPDIR"));
  }
  ::setenv("TMPDIR", kept.c_str(), 1);
}

TEST(Encoding, EscapesMarkupAndRepairsText) {
  EXPECT_EQ(escape_xml("<a href=\"x\">&'"), "&lt;a href=&quot;x&quot;&gt;&amp;&#39;");
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

raytrace::PointSpread spread_of(double pupil_mm, double defocus_D) {
  raytrace::Wavefront wavefront;
  wavefront.pupil_mm = pupil_mm;
  wavefront.wavelength_nm = 555;
  wavefront.zernike_um.assign(6, 0);
  wavefront.zernike_um[4] = -defocus_D * pupil_mm * pupil_mm / 4 / (4 * std::sqrt(3.0));
  return raytrace::point_spread(wavefront);
}

double at(const Picture& picture, double x_arcmin, double y_arcmin) {
  const int row = picture.side / 2 + static_cast<int>(std::lround(y_arcmin / picture.arcmin_per_pixel));
  const int column = picture.side / 2 + static_cast<int>(std::lround(x_arcmin / picture.arcmin_per_pixel));
  return picture.values[static_cast<std::size_t>(row) * picture.side + column];
}

// Letters are 5 arcmin high at logMAR 0, and rows 1.6 letters apart.
TEST(LetterChart, LinesHaveTheSizesOfTheirAcuities) {
  const auto lines = letter_lines({0.7, 0.3, 0}, 120);
  ASSERT_EQ(lines.size(), 3U);
  EXPECT_EQ(lines[0].letters, 3);  // 25.06 high, 40.1 apart
  EXPECT_EQ(lines[2].letters, 5);
  EXPECT_NEAR(lines[1].middle_arcmin - lines[0].middle_arcmin, 1.1 * 25.059 + 0.5 * 9.976, 0.01);
  EXPECT_NEAR(lines[0].middle_arcmin - 25.059 / 2, -(lines[2].middle_arcmin + 2.5), 1e-3);
}

TEST(LetterChart, ASharpEyeSeesTheStrokesAndABlurredOneGrey) {
  const auto lines = letter_lines({0.7}, 30);
  ASSERT_EQ(lines.front().letters, 1);  // C: its left side is ink, its middle and its gap are not
  const double stroke = 25.059 / 5;
  const Picture sharp = blurred_letters(spread_of(3, 0), lines, 60);
  EXPECT_LT(at(sharp, -2 * stroke, 0), 0.1);
  EXPECT_GT(at(sharp, 0, 0), 0.9);
  EXPECT_GT(at(sharp, 2 * stroke, 0), 0.9);
  // 3 D over 4 mm is a disc of 12 mrad = 41 arcmin: no stroke is left.
  const Picture blurred = blurred_letters(spread_of(4, 3), lines, 60);
  EXPECT_NEAR(at(blurred, -2 * stroke, 0), at(blurred, 0, 0), 0.05);
}

// The blur moves ink about: it neither makes nor destroys any.
TEST(LetterChart, BlurKeepsTheInk) {
  const auto lines = letter_lines({0.5, 0.3}, 60);
  const auto ink = [](const Picture& picture) {
    double sum = 0;
    for (const float value : picture.values) sum += 1 - value;
    return sum * picture.arcmin_per_pixel * picture.arcmin_per_pixel;
  };
  const double sharp = ink(blurred_letters(spread_of(3, 0), lines, 80));
  EXPECT_GT(sharp, 100);
  EXPECT_NEAR(ink(blurred_letters(spread_of(3, 1), lines, 80)) / sharp, 1, 0.01);
}

TEST(Numbers, AnAxisIsFrom1To180Degrees) {
  const NumberStyle axis{0, false, "axis"};
  EXPECT_EQ(format(0.3, axis), "180\u00b0");
  EXPECT_EQ(format(179.7, axis), "180\u00b0");
  EXPECT_EQ(format(12.2, axis), "12\u00b0");
  EXPECT_EQ(format(0.3, {0, true, "deg"}), "0\u00b0");  // a tilt may be none
}

/// A text "7.5 mm is outside 7.5 to 13.2 mm" would be none.
TEST(Numbers, AreJudgedAsTheyAreWritten) {
  const auto& rows = biometry_rows();
  const auto row = std::find_if(rows.begin(), rows.end(),
                                [](const BiometryRow& r) { return r.key == "lens_anterior_radius_mm"; });
  ASSERT_NE(row, rows.end());
  EXPECT_TRUE(row->is_normal(7.4996, 40));
  EXPECT_FALSE(row->is_normal(7.44, 40));
  EXPECT_TRUE(row->is_normal(7.44, 9));  // of children nothing is known
}

TEST(ReferenceMtf, EndsAtTheCutOffAndHealthyEyesLieBelowDiffraction) {
  EXPECT_EQ(diffraction_mtf(0, 3, 555), 1);
  EXPECT_NEAR(diffraction_mtf(3 / 555e-6 * pi / 180 / 2, 3, 555), 2 / pi * (pi / 3 - std::sqrt(3) / 4), 1e-9);
  EXPECT_EQ(diffraction_mtf(200, 3, 555), 0);
  EXPECT_EQ(healthy_mtf(0, 3), 1);
  for (double cpd = 5; cpd < 60; cpd += 5) EXPECT_LT(healthy_mtf(cpd, 4), diffraction_mtf(cpd, 4, 555));
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

/// A closed sphere, triangles of 5 degrees.
TriangleMesh sphere(const Eigen::Vector3d& centre, double radius_mm) {
  TriangleMesh mesh;
  constexpr int rows = 36, columns = 72;
  for (int i = 0; i <= rows; ++i)
    for (int j = 0; j < columns; ++j) {
      const double polar = pi * i / rows, around = 2 * pi * j / columns;
      const Eigen::Vector3d normal(std::sin(polar) * std::cos(around), std::sin(polar) * std::sin(around),
                                   std::cos(polar));
      mesh.vertices.push_back(centre + radius_mm * normal);
      mesh.normals.push_back(normal);
    }
  for (int i = 0; i < rows; ++i)
    for (int j = 0; j < columns; ++j) {
      const int a = i * columns + j, b = i * columns + (j + 1) % columns;
      mesh.triangles.push_back({a, a + columns, b});
      mesh.triangles.push_back({b, a + columns, b + columns});
    }
  return mesh;
}

struct Opaque {
  double count = 0;
  Eigen::Vector2d middle_px{0, 0};
};

Opaque opaque_in(const std::string& rgba, const StillView& view) {
  Opaque found;
  for (int row = 0; row < view.height_px; ++row)
    for (int column = 0; column < view.width_px; ++column)
      if (rgba[4 * (static_cast<std::size_t>(row) * view.width_px + column) + 3] != 0) {
        found.count += 1;
        found.middle_px += Eigen::Vector2d(column + 0.5, row + 0.5);
      }
  found.middle_px /= found.count;
  return found;
}

// The outline of a sphere of 8 mm is a disc of 8 mm about its centre.
TEST(Still, ASphereIsADiscOfItsSizeAtItsPlace) {
  const StillView view = still_view(Laterality::od, 24);
  const Eigen::Vector3d offset(0, 2, -10);
  const Opaque disc = opaque_in(render_still({{sphere(offset, 8)}}, view), view);
  EXPECT_NEAR(disc.count * view.mm_per_pixel * view.mm_per_pixel / (pi * 64), 1, 0.01);
  const Eigen::Vector3d from_centre = offset - view.centre_mm;
  EXPECT_NEAR((disc.middle_px.x() - view.width_px / 2.0) * view.mm_per_pixel, from_centre.dot(view.right),
              0.03);
  EXPECT_NEAR((view.height_px / 2.0 - disc.middle_px.y()) * view.mm_per_pixel, from_centre.dot(view.up),
              0.03);
}

// Seen from the temporal side each, a right eye looks to the right of the picture and a left eye to its left.
TEST(Still, EyesAreMirrorImagesWithTheFrontOutwards) {
  for (const Laterality eye : both_eyes) {
    const StillView view = still_view(eye, 24);
    const Opaque front = opaque_in(render_still({{sphere({0, 0, -2}, 1.5)}}, view), view);
    EXPECT_EQ(front.middle_px.x() > view.width_px / 2.0, eye == Laterality::od);
    EXPECT_NEAR(view.right.cross(view.up).dot(view.towards_viewer), 1, 1e-12);
  }
}

TEST(Still, OfACutSphereTheFarHalfIsLeft) {
  const StillView view = still_view(Laterality::os, 24);
  StillSurface whole{sphere({0, 0, -12}, 8)};
  StillSurface cut = whole;
  cut.is_cut = true;
  const Opaque all = opaque_in(render_still({whole}, view), view),
               half = opaque_in(render_still({cut}, view), view);
  EXPECT_LT(half.count, 0.99 * all.count);
  // The cut disc, whose normal is +x, fills |cos| of the outline; beyond it the far half sticks out by half
  // an ellipse.
  EXPECT_NEAR(half.count / all.count, 0.5 + std::abs(view.towards_viewer.x()) / 2, 0.01);
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
