// One rule for a reading of another instrument, wherever it is given: "mesh --keratometry K, trace, correct"
// and "mesh, trace, correct --keratometry K" are of the same eye.
#include <gtest/gtest.h>

#include <cmath>

#include "correction/stage.hpp"
#include "meshing/stage.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/measured.hpp"
#include "pipeline/eye/meshes/mesh_formats.hpp"
#include "raytrace/case/measured_eye.hpp"
#include "tests/support/random_eye.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope::correction {
namespace {

namespace fs = std::filesystem;

/// A right eye as segmentation leaves it.
void write_fitted_eye(const fs::path& case_folder) {
  const fs::path folder = case_folder / "segmentation";
  fs::create_directories(folder / "od");
  write_json(folder / "od/fit.json", {{"laterality", "od"},
                                      {"eye", to_json(random_eye(40))},
                                      {"head_roll_deg", nullptr},
                                      {"withheld", Json::object()},
                                      {"status", "measured"}});
  write_json(folder / "stage.json", {{"verdict", {{"status", 0}, {"reasons", Json::array()}}}});
  write_json(case_folder / "case.json", {{"subject", {{"age_years", 40}}}});
}

/// What the trace stage leaves for the correction, without a picture.
void trace(const fs::path& case_folder) {
  const fs::path folder = case_folder / "raytrace";
  fs::create_directories(folder / "od");
  const raytrace::MeasuredEye measured = raytrace::read_measured_eye(case_folder, Laterality::od, {});
  raytrace::write_measured_eye(folder / "od", measured, Laterality::od);
  write_json(folder / "stage.json", {{"verdict", {{"status", 0}, {"reasons", Json::array()}}},
                                     {"parameters",
                                      {{"scene", "letters"},
                                       {"samples", 4},
                                       {"pupil_mm", 4},
                                       {"size", {20, 20}},
                                       {"field_mm", {6, 6}},
                                       {"fovea_mm", {0, 0}},
                                       {"lens_index", nullptr},
                                       {"age_years", 40}}}});
}

/// The refraction of a case in which these instruments' readings are given to one stage or the other.
Json refraction(const fs::path& case_folder, const InstrumentFlags& to_mesh,
                const InstrumentFlags& to_correct) {
  CommonOptions common;
  common.verbosity.quiet = true;
  common.threads = 2;
  write_fitted_eye(case_folder);
  meshing::MeshingOptions meshing;
  meshing.case_folder = case_folder;
  meshing.instruments = parse_instruments(to_mesh, meshing.retinal_depth_mm);
  meshing::make_meshes(meshing, common);
  trace(case_folder);
  CorrectionSettings settings;
  settings.prescription.verbosity.quiet = true;
  KnownDataFlags known;
  known.instruments = to_correct;
  settings.known = parse_known_data(known);
  return correct_case(case_folder, settings, common).json["eyes"]["od"];
}

TEST(KnownAtEitherStage, KeratometryGivesOneRefraction) {
  const test::TemporaryFolder temporary;
  const double power_D = 337.5 * random_eye(40).cornea_c_per_mm;
  InstrumentFlags keratometry;
  keratometry.keratometry = {"od:" + std::to_string(power_D + 0.2) + "@170/" + std::to_string(power_D + 1.1) +
                             "@80+-0.25"};
  const Json meshed = refraction(temporary.path() / "meshed", keratometry, {});
  const Json corrected = refraction(temporary.path() / "corrected", {}, keratometry);
  const Json without = refraction(temporary.path() / "without", {}, {});
  for (const char* key : {"M_D", "J0_D", "J45_D"}) {
    const auto at_mesh = meshed.at(key).get<Measured>(), at_correct = corrected.at(key).get<Measured>();
    EXPECT_NEAR(at_mesh.value, at_correct.value, 0.01) << key;
    EXPECT_NEAR(at_mesh.sigma(), at_correct.sigma(), 0.001) << key;
    EXPECT_EQ(at_mesh.source, at_correct.source) << key;
  }
  // It was learnt: the reading lies that far from what the images say.
  EXPECT_GT(std::abs(meshed["M_D"]["value"].get<double>() - without["M_D"]["value"].get<double>()), 0.5);
  EXPECT_EQ(meshed["J0_D"]["source"], "keratometry");
  // Given to both it would count twice.
  EXPECT_THROW(refraction(temporary.path() / "both", keratometry, keratometry), Error);
}

TEST(KnownData, IsWrittenInDecimals) {
  KnownDataFlags flags;
  flags.instruments.axial_length = {"od:23.75"};
  EXPECT_EQ(parse_known_data(flags).size(), 1U);
  flags.instruments.axial_length = {"od:0x17.C"};
  EXPECT_THROW(parse_known_data(flags), Error);
}

TEST(KnownData, OfOneRefractionAnEye) {
  KnownDataFlags flags;
  flags.refractions = {"od:+3.25/-1.00x180", "os:+1.25"};
  EXPECT_EQ(parse_known_data(flags).at(Laterality::od).refraction->refraction.sphere_D, 3.25);
  flags.refractions.emplace_back("od:+1.25/-1.00x180");
  EXPECT_THROW(parse_known_data(flags), Error);
  KnownDataFlags maps;
  maps.instruments.topography = {"od:a.csv"};
  EXPECT_EQ(parse_known_data(maps).size(), 1U);
  maps.instruments.topography = {"od:a.csv", "os:b.csv"};
  EXPECT_EQ(parse_known_data(maps).size(), 2U);
  maps.instruments.topography.emplace_back("od:c.csv");
  EXPECT_THROW(parse_known_data(maps), Error);
  maps.instruments.topography = {"od:a.csv", "os:./a.csv"};
  EXPECT_THROW(parse_known_data(maps), Error);
  const test::TemporaryFolder folder;
  const std::string right = (folder.path() / "r.csv").string(), left = (folder.path() / "l.csv").string();
  write_file(right, "0,0,0");
  write_file(left, "0,0,0");
  maps.instruments.topography = {"od:" + right, "os:" + left};
  EXPECT_THROW(parse_known_data(maps), Error);
  write_file(left, "0,0,0.1");
  EXPECT_EQ(parse_known_data(maps).size(), 2U);
}

TEST(KnownData, OfOneReadingGivenOnce) {
  KnownDataFlags flags;
  flags.instruments.anterior_chamber_depth = {"od:3.1", "od:3.2", "os:3.1"};
  EXPECT_EQ(parse_known_data(flags).at(Laterality::od).instruments.measurements.size(), 2U);
  flags.instruments.anterior_chamber_depth.emplace_back("od:3.10");
  EXPECT_THROW(parse_known_data(flags), Error);
}

}  // namespace
}  // namespace emmetrope::correction
