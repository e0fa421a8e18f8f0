#include "pipeline/eye/instruments/topography.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <sstream>

#include "meshing/biometry.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/instruments/instruments.hpp"
#include "pipeline/eye/surfaces/zernike.hpp"
#include "tests/support/random_eye.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope {
namespace {

using namespace meshing;

/// A toric cornea with 3 um of coma over 8 mm, lying tilted in its map.
struct Patient {
  Patient() {
    eye.cornea_c_per_mm = 1 / 7.7;
    eye.cornea_j0_per_mm = 0.003;
    eye.cornea_j45_per_mm = -0.002;
    eye.cornea_q = -0.3;
  }
  double depth_mm(double x, double y) const {
    return eye.cornea_anterior_depth_mm(x, y) + 0.003 * zernike_values(3, x / 4, y / 4)[8] + 0.002 * x -
           0.001 * y + 0.01;
  }
  ParametricEye eye;
};

/// `unit` of the elevation in mm; negative: the file gives depths.
std::string matrix_csv(const Patient& patient, double unit, const char* name, double noise_mm = 0) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  std::ostringstream text;
  text << name;
  for (int i = -16; i <= 16; ++i) text << "," << i * 0.25;
  text << "\n";
  for (int k = -16; k <= 16; ++k) {
    text << k * 0.25;
    for (int i = -16; i <= 16; ++i) {
      const double x = i * 0.25, y = k * 0.25;
      text << ",";
      if (std::hypot(x, y) <= 4) text << (-patient.depth_mm(x, y) + noise_mm * normal(random)) / unit;
    }
    text << "\n";
  }
  return text.str();
}

class TopographyFile : public testing::Test {
 protected:
  std::filesystem::path write(const std::string& name, const std::string& text) {
    write_file(folder_.path() / name, text);
    return folder_.path() / name;
  }
  test::TemporaryFolder folder_;
};

TEST_F(TopographyFile, MatrixColumnsAndDepthsSayTheSame) {
  const Patient patient;
  const ElevationMap heights = read_elevation_map(write("a.csv", matrix_csv(patient, 1e-3, "elevation_um")));
  const ElevationMap depths = read_elevation_map(write("b.csv", matrix_csv(patient, -1, "elevation_mm")));
  std::string columns = "x_mm,y_mm,elevation_um\n";
  for (Eigen::Index i = 0; i < heights.depth_mm.size(); ++i)
    columns += std::to_string(heights.position_mm(i, 0)) + "," + std::to_string(heights.position_mm(i, 1)) +
               "," + std::to_string(-1000 * heights.depth_mm[i]) + "\n";
  const ElevationMap list = read_elevation_map(write("c.csv", columns));
  ASSERT_EQ(heights.depth_mm.size(), depths.depth_mm.size());
  ASSERT_EQ(heights.depth_mm.size(), list.depth_mm.size());
  EXPECT_LT((heights.depth_mm - depths.depth_mm).cwiseAbs().maxCoeff(), 1e-5);  // six digits in the text
  EXPECT_LT((heights.depth_mm - list.depth_mm).cwiseAbs().maxCoeff(), 1e-5);
}

TEST_F(TopographyFile, FindsTheToricAndWhatIsBeyondIt) {
  const Patient patient;
  const ElevationMap map =
      read_elevation_map(write("a.csv", matrix_csv(patient, 1e-3, "elevation_um", 0.001)));
  const Topography found = analyse_topography(map, 0.25);
  const CornealPower truth = corneal_power(anterior_cornea(patient.eye));
  EXPECT_NEAR(found.toric.value[0], truth.M_D, 0.03);
  EXPECT_NEAR(found.toric.value[1], truth.J0_D, 0.03);
  EXPECT_NEAR(found.toric.value[2], truth.J45_D, 0.03);
  EXPECT_NEAR(found.toric.value[3], patient.eye.cornea_q, 0.02);
  // A tilt of 2 and -1 thousandths is an apex that lies by them times the radius away; on points in a square
  // grid 3 um of coma tilt by 0.2 thousandths.
  EXPECT_NEAR(found.apex_mm.x(), -0.002 * 7.7, 2e-3);
  EXPECT_NEAR(found.apex_mm.y(), 0.001 * 7.7, 2e-3);
  // The point that is farthest from it is (4, 0).
  EXPECT_NEAR(found.zone_mm, 2 * std::hypot(4 - found.apex_mm.x(), found.apex_mm.y()), 1e-6);
  EXPECT_NEAR(found.departure_um[8], 3, 0.3);
  // A coma term shrinks with the cube of the zone; tilt goes with the toric.
  EXPECT_NEAR(found.irregularity_um.value, 3 * std::pow(6.0 / 8, 3), 0.15);
  EXPECT_EQ(found.irregularity_um.source, "topography");
}

/// What the lid covers is written as 0 by some instruments: no heights.
TEST_F(TopographyFile, GapsWrittenAsZeroAreRefused) {
  const Patient patient;
  std::string text = "x_mm,y_mm,elevation_um\n";
  for (int i = -16; i <= 16; ++i)
    for (int k = -16; k <= 16; ++k) {
      const double x = i * 0.25, y = k * 0.25;
      if (std::hypot(x, y) > 4) continue;
      text += std::to_string(x) + "," + std::to_string(y) + "," +
              (y > 2.5 ? "0" : std::to_string(-1000 * patient.depth_mm(x, y))) + "\n";
    }
  const std::filesystem::path file = write("zero.csv", text);
  EyeInstruments instruments;
  instruments.topography = TopographyFlag{file, 0.25};
  try {
    read_instruments(instruments);
    FAIL() << "taken";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("a gap written as 0?"));
    EXPECT_THAT(error.context().front(), testing::HasSubstr("zero.csv"));
    EXPECT_THAT(error.remedy(), testing::HasSubstr("leave gaps empty"));
  }
}

TEST_F(TopographyFile, RegularCorneaHasNoIrregularity) {
  Patient patient;
  std::ostringstream json;
  json.precision(17);
  const CornealDepth depth = anterior_cornea(patient.eye);
  const Eigen::VectorXd z = corneal_zernike_um(depth, 8, 8);
  json << "{\"zone_mm\": 8, \"zernike_um\": [";
  for (Eigen::Index i = 0; i < z.size(); ++i) json << (i > 0 ? "," : "") << z[i];
  json << "]}";
  const Topography found = analyse_topography(read_elevation_map(write("z.json", json.str())), 0.25);
  EXPECT_NEAR(found.irregularity_um.value, 0, 0.05);
  EXPECT_NEAR(found.toric.value[0], corneal_power(depth).M_D, 0.01);
}

/// A toric cornea with one Zernike term over 6 mm, sampled on a grid or on rings, whose points crowd in the middle.
std::string map_with_term(int term, double um, bool on_rings) {
  ParametricEye eye = Patient().eye;
  std::string map = "x_mm,y_mm,elevation_um\n";
  const auto add = [&](double x, double y) {
    map +=
        fmt::format("{},{},{}\n", x, y,
                    -1e3 * eye.cornea_anterior_depth_mm(x, y) - um * zernike_values(4, x / 3, y / 3)[term]);
  };
  if (on_rings) {
    for (int ring = 1; ring <= 22; ++ring)
      for (int spoke = 0; spoke < 36; ++spoke)
        add(0.2 * ring * std::cos(spoke * 10 * degree), 0.2 * ring * std::sin(spoke * 10 * degree));
  } else {
    for (double y = -4.4; y < 4.5; y += 0.2)
      for (double x = -4.4; x < 4.5; x += 0.2)
        if (std::hypot(x, y) <= 4.4) add(x, y);
  }
  return map;
}

/// The coefficient of a normalised term is what it leaves of the best toric conicoid, wherever the points lie.
TEST_F(TopographyFile, IrregularityIsTheSurfacesAndNotThePoints) {
  for (const auto& [term, um] : {std::pair{6, 8.0}, {9, 2.0}, {14, 5.0}, {10, 2.0}}) {  // trefoil, quadrafoil
    Eigen::Vector4d toric[2];
    for (const bool on_rings : {false, true}) {
      const Topography found =
          analyse_topography(read_elevation_map(write("term.csv", map_with_term(term, um, on_rings))), 0.25);
      EXPECT_NEAR(found.irregularity_um.value, um, 0.04 * um) << term << " " << on_rings;
      toric[on_rings ? 1 : 0] = found.toric.value;
    }
    EXPECT_NEAR((toric[1] - toric[0]).head<3>().norm(), 0, 0.03) << term;
    EXPECT_NEAR(toric[1][3], toric[0][3], 0.02) << term;
  }
}

/// Of a cornea that a lid hides in part it is that of what is seen, and no lid makes an irregular cornea a regular one.
TEST_F(TopographyFile, BehindALidNothingIsIrregular) {
  std::istringstream whole(map_with_term(6, 4, false));
  std::string seen, line;
  std::getline(whole, line);
  seen = line + "\n";
  std::mt19937 random(3);
  std::normal_distribution<double> noise_um(0, 1);
  while (std::getline(whole, line)) {
    std::istringstream words(line);
    double x = 0, y = 0, elevation_um = 0;
    char comma = ',';
    words >> x >> comma >> y >> comma >> elevation_um;
    if (y > -2 && y < 1.2) seen += fmt::format("{},{},{}\n", x, y, elevation_um + noise_um(random));
  }
  const Measured irregularity =
      analyse_topography(read_elevation_map(write("seen.csv", seen)), 0.25).irregularity_um;
  EXPECT_GT(irregularity.ci95[0], 0.5);
  EXPECT_LT(irregularity.ci95[1], 4.5);
}

/// A cornea that lies in its map shifted, or turned about its apex.
std::string map_off_apex(const ParametricEye& eye, double shift_mm, double turn_rad) {
  std::string map = "x_mm,y_mm,elevation_um\n";
  const double c = std::cos(turn_rad), s = std::sin(turn_rad);
  for (double y = -4; y <= 4; y += 0.25)
    for (double x = -4; x <= 4; x += 0.25) {
      if (std::hypot(x, y) > 4) continue;
      const double u = x + shift_mm;
      double depth_mm = 0;  // by Newton's method on the turned cornea
      const auto off_mm = [&](double d) {
        return c * d - s * u - eye.cornea_anterior_depth_mm(c * u + s * d, y);
      };
      for (int i = 0; i < 20; ++i)
        depth_mm -= off_mm(depth_mm) / ((off_mm(depth_mm + 1e-5) - off_mm(depth_mm - 1e-5)) / 2e-5);
      map += fmt::format("{},{},{}\n", x, y, -1e3 * depth_mm);
    }
  return map;
}

/// Off its apex a map seems to have another curvature, and coma: neither is the cornea's.
TEST_F(TopographyFile, AMapThatIsOffTheApexIsLaidOnIt) {
  const Patient patient;
  const ParametricEye& eye = patient.eye;
  const CornealPower truth = corneal_power(anterior_cornea(eye));
  const auto check = [&](const std::string& text, double off_mm, double most_D, double most_um) {
    const Topography found = analyse_topography(read_elevation_map(write("off.csv", text)), 0.25);
    EXPECT_NEAR(found.apex_mm.norm(), off_mm, 0.1 * off_mm);
    EXPECT_NEAR(found.toric.value[0], truth.M_D, most_D);
    EXPECT_NEAR(found.toric.value[1], truth.J0_D, most_D / 1.5);
    EXPECT_NEAR(found.toric.value[2], truth.J45_D, most_D / 1.5);
    EXPECT_LT(found.irregularity_um.value, most_um);
    EXPECT_EQ(alignment_warning(found).empty(), off_mm < 0.5);
  };
  for (const double off_mm : {0.1, 0.4, 1.0, 1.4}) {
    SCOPED_TRACE(off_mm);
    check(map_off_apex(eye, off_mm, 0), off_mm, 0.005, 0.01);
    // A turned conicoid is laid on the point that is highest in the map: there it is by 1 + Q c^2 r^2 flatter,
    // which is in the covariance, and by 3 um a millimetre of coma irregular.
    const double flatter_D = truth.M_D * std::abs(eye.cornea_q) * std::pow(off_mm * eye.cornea_c_per_mm, 2);
    check(map_off_apex(eye, 0, off_mm * eye.cornea_c_per_mm), off_mm, 1.3 * flatter_D + 0.01, 4 * off_mm);
  }
  EXPECT_THROW(analyse_topography(read_elevation_map(write("off.csv", map_off_apex(eye, 2, 0))), 0.25),
               Error);
}

/// Points every 0.9 mm with 10 um of noise: the powers that they give scatter as is told.
TEST_F(TopographyFile, TheNoiseOfAFewPointsIsInTheInterval) {
  const Patient patient;
  const CornealPower truth = corneal_power(anterior_cornea(patient.eye));
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  double chi2 = 0, told_D = 0;
  constexpr int maps = 40;
  constexpr double sigma_D = 1e-3;  // the instrument's own, out of the way
  for (int n = 0; n < maps; ++n) {
    ElevationMap map;
    std::vector<Eigen::Vector3d> points;
    for (double y = -3.6; y <= 3.7; y += 0.9)
      for (double x = -3.6; x <= 3.7; x += 0.9)
        for (const double jitter : {0.0, 0.3})
          if (std::hypot(x + jitter, y + jitter) <= 4)
            points.emplace_back(
                x + jitter, y + jitter,
                patient.eye.cornea_anterior_depth_mm(x + jitter, y + jitter) + 0.01 * normal(random));
    map.position_mm.resize(static_cast<Eigen::Index>(points.size()), 2);
    map.depth_mm.resize(static_cast<Eigen::Index>(points.size()));
    for (Eigen::Index i = 0; i < map.depth_mm.size(); ++i) {
      map.position_mm.row(i) = points[static_cast<std::size_t>(i)].head<2>().transpose();
      map.depth_mm[i] = points[static_cast<std::size_t>(i)].z();
    }
    const Topography found = analyse_topography(map, sigma_D);
    const Eigen::Vector3d error =
        found.toric.value.head<3>() - Eigen::Vector3d(truth.M_D, truth.J0_D, truth.J45_D);
    chi2 += error.dot(found.toric.covariance.topLeftCorner<3, 3>().ldlt().solve(error)) / (3 * maps);
    told_D += std::sqrt(found.toric.covariance(0, 0)) / maps;
    EXPECT_EQ(found.irregularity_um.ci95[0], 0);
  }
  EXPECT_GT(told_D, 0.1);
  EXPECT_NEAR(chi2, 1, 3 * std::sqrt(2.0 / (3 * maps)));  // three standard deviations of chi^2 of 120
}

/// What a lid hides is the conicoid's, not the extrapolated noise's; a point that strays makes no zone.
TEST_F(TopographyFile, WhereThereAreNoPointsItIsTheConicoid) {
  const Patient patient;
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  std::string text = "x_mm,y_mm,elevation_um\n";
  const auto row = [&](double x, double y) {
    text += fmt::format("{},{},{}\n", x, y, -1e3 * patient.depth_mm(x, y) + normal(random));
  };
  for (double y = -4.5; y <= 2; y += 0.25)
    for (double x = -4.5; x <= 4.5; x += 0.25)
      if (std::hypot(x, y) <= 4.5) row(x, y);
  row(0.125, 7);
  const Topography found = analyse_topography(read_elevation_map(write("lid.csv", text)), 0.25);
  EXPECT_NEAR(found.zone_mm, 9, 0.1);
  const CornealDepth depth = anterior_cornea(patient.eye, found);
  for (const double x : {-2.0, 0.0, 2.0})
    EXPECT_NEAR(depth(x, 3.8), patient.eye.cornea_anterior_depth_mm(x, 3.8), 0.02) << x;
}

TEST_F(TopographyFile, ShapeAndDepthAgreeAndPassTheApex) {
  const Patient patient;
  const Topography found =
      analyse_topography(read_elevation_map(write("a.csv", matrix_csv(patient, 1e-3, "elevation_um"))), 0.25);
  const ShapePtr shape = anterior_cornea_shape(patient.eye, found);
  const CornealDepth depth = anterior_cornea(patient.eye, found);
  EXPECT_NEAR(depth(0, 0), 0, 1e-12);
  for (const double x : {-3.0, 0.4, 2.0})
    for (const double y : {-2.0, 0.0, 1.7}) EXPECT_NEAR(*shape->depth_mm(x, y), depth(x, y), 1e-9);
}

TEST_F(TopographyFile, TightensTheEstimateAndKeepsItsShape) {
  const Patient patient;
  const Topography found =
      analyse_topography(read_elevation_map(write("a.csv", matrix_csv(patient, 1e-3, "elevation_um"))), 0.1);
  UncertainEye estimate = fitted_eye(random_eye(50));
  const double before = biometry_json(estimate, {})["keratometry"]["flat"]["power_D"].get<Measured>().sigma();
  estimate.learn(found.toric);
  const Json after = biometry_json(estimate, {}, &found);
  EXPECT_LT(after["keratometry"]["flat"]["power_D"].get<Measured>().sigma(), before / 3);
  EXPECT_EQ(after["astigmatism"]["irregularity_um"]["source"], "topography");
  EXPECT_EQ(after["astigmatism"]["M_D"]["source"], "topography");
  EXPECT_GT(std::abs(after["cornea_zernike_um"][8]["value"].get<double>()),
            0.5);  // the coma is in the cornea now
}

TEST_F(TopographyFile, BrokenMapsAreRefusedWithLineAndFile) {
  const auto complaint = [&](const std::string& name, const std::string& text) -> std::string {
    try {
      analyse_topography(read_elevation_map(write(name, text)), 0.25);
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::input_invalid);
      return error.what();
    }
    return "accepted";
  };
  using testing::AllOf;
  using testing::HasSubstr;
  EXPECT_THAT(complaint("a.csv", ""), HasSubstr("line 1"));
  EXPECT_THAT(complaint("a.csv", "x_mm,y_mm,elevation_um\n0,0\n"), HasSubstr("line 2"));
  EXPECT_THAT(complaint("a.csv", "x_mm,y_mm,elevation_um\na,0,1\n"), HasSubstr("line 2"));
  EXPECT_THAT(complaint("a.csv", "x_mm,y_mm,elevation_um\n0,0,1\n"), HasSubstr("too few"));
  EXPECT_THAT(complaint("a.csv", "x_mm,y_mm,elevation_um\n0,0,\n0,1,nan\n1,0,#REF!\n"),
              AllOf(HasSubstr("line 4"), HasSubstr("'#REF!'")));
  std::string half = "x_mm,y_mm,elevation_um\n";
  const Patient patient;
  for (double y = 0.5; y <= 4; y += 0.25)
    for (double x = -3; x <= 3; x += 0.25)
      half += fmt::format("{},{},{}\n", x, y, -1e3 * patient.depth_mm(x, y));
  EXPECT_THAT(complaint("half.csv", half), HasSubstr("does not surround the apex"));
  EXPECT_THAT(complaint("z.json", "{\"zernike_um\": [1]}"), HasSubstr("zone_mm"));
  EXPECT_THAT(complaint("z.json", "{\"zone_mm\": -8, \"zernike_um\": [0,0,0,0,-300]}"),
              AllOf(HasSubstr("z.json"), HasSubstr("zone_mm"), HasSubstr("found -8")));
  EXPECT_THAT(complaint("z.json", "{\"zone_mm\": 8, \"zernike_um\": []}"),
              AllOf(HasSubstr("zernike_um"), HasSubstr("found []")));
  EXPECT_THAT(complaint("z.json", "{\"zone_mm\": 8, \"zernike_um\": [0,0,0,0,-300], \"order\": \"noll\"}"),
              HasSubstr("unknown key \"order\""));
  std::string polar = "x_mm,y_mm,elevation_um\n";  // its middle once a meridian
  for (int meridian = 0; meridian < 36; ++meridian)
    for (double r = 0; r <= 4; r += 0.25) {
      const double x = r * std::cos(meridian * pi / 18), y = r * std::sin(meridian * pi / 18);
      polar += fmt::format("{},{},{}\n", x, y, -1e3 * patient.eye.cornea_anterior_depth_mm(x, y));
    }
  EXPECT_EQ(complaint("polar.csv", polar), "accepted");
  std::string both = "x_mm,y_mm,elevation_um\n";
  for (const double radius_mm : {7.7, 7.4})
    for (double y = -4; y <= 4; y += 0.5)
      for (double x = -4; x <= 4; x += 0.5)
        both += fmt::format("{},{},{}\n", x, y, -500 * (x * x + y * y) / radius_mm);
  EXPECT_THAT(complaint("both.csv", both), AllOf(HasSubstr("line 291"), HasSubstr("in line 2")));
  // A spreadsheet's mark before the header is none of its letters.
  EXPECT_THAT(complaint("a.csv", "\xEF\xBB\xBFx_mm,y_mm,elevation_um\n0,0,1\n"), HasSubstr("too few"));
  EXPECT_THAT(complaint("z.json", "{\"zone_mm\": 5, \"zernike_um\": [0,0,0,0,-300]}"),
              HasSubstr("5.0 mm wide"));
  EXPECT_THAT(complaint("z.json", "{\"zone_mm\": 8, \"zernike_um\": [0,0,0,0,-3000]}"),
              HasSubstr("no cornea"));
}

// A slip of the decimal sign, or of the exponent.
TEST_F(TopographyFile, OnePointThatLiesFarOffIsRefusedWithItsLine) {
  const auto with_point = [&](const std::string& row) {
    std::string text = "x_mm,y_mm,elevation_um\n";
    const Patient patient;
    for (double y = -4; y <= 4; y += 0.25)
      for (double x = -4; x <= 4; x += 0.25)
        if (std::hypot(x, y) <= 4) text += fmt::format("{},{},{}\n", x, y, -1e3 * patient.depth_mm(x, y));
    return write("a.csv", text + row + "\n");
  };
  for (const char* row : {"-3,20,-900", "1e308,0,-900", "0,-1e308,-900", "0,3.2,1e308", "1e200,1e200,1"}) {
    try {
      read_elevation_map(with_point(row));
      ADD_FAILURE() << row;
    } catch (const Error& error) {
      EXPECT_THAT(error.what(),
                  testing::AllOf(testing::HasSubstr("a.csv, line "), testing::HasSubstr("apex")))
          << row;
    }
  }
  // Within what is read, but where the cornea's conicoid has no depth.
  EXPECT_THROW(analyse_topography(read_elevation_map(with_point("9.9,0,-900")), 0.25), Error);
  EXPECT_THROW(read_elevation_map(write("z.json", "{\"zone_mm\": 60, \"zernike_um\": [0,0,0,0,-300]}")),
               Error);
  EXPECT_THROW(read_elevation_map(write("z.json", "{\"zone_mm\": 8, \"zernike_um\": [0,0,0,0,1e308]}")),
               Error);
}

}  // namespace
}  // namespace emmetrope
