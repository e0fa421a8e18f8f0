#include "pipeline/eye/population/limits.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <cmath>

#include <limits>
#include <regex>

#include "meshing/biometry.hpp"
#include "pipeline/base/error.hpp"
#include "tests/support/random_eye.hpp"

namespace emmetrope {
namespace {

TEST(LimitsTable, NormalIsPlausibleAndPlausibleIsAccepted) {
  for (const Limits& row : limits_table()) {
    const bool is_limited =
        row.accepted.is_limited() || row.plausible.is_limited() || row.normal.is_limited();
    EXPECT_TRUE(is_limited) << row.quantity;
    for (const Range& range : {row.accepted, row.plausible, row.normal})
      EXPECT_LT(range.low, range.high) << row.quantity;
    if (row.normal.is_limited()) {
      EXPECT_TRUE(row.plausible.contains(row.normal)) << row.quantity;
      EXPECT_TRUE(row.accepted.contains(row.normal)) << row.quantity;
    }
    if (row.plausible.is_limited()) {
      EXPECT_TRUE(row.accepted.contains(row.plausible)) << row.quantity;
    }
  }
}

TEST(LimitsTable, ANormalRangeNamesItsReference) {
  for (const Limits& row : limits_table())
    EXPECT_EQ(row.normal_reference.empty(), !row.normal.is_limited()) << row.quantity;
}

TEST(LimitsTable, EachQuantityHasOneRow) {
  for (const Limits& row : limits_table()) EXPECT_EQ(&limits_of(row.quantity), &row) << row.quantity;
  EXPECT_EQ(find_limits("keratometry/steep"), nullptr);
  EXPECT_THROW(limits_of("keratometry/steep"), Error);
}

/// Paths of the measured numbers in a document, '/' between levels.
void collect_measured(const Json& json, const std::string& path, std::vector<std::string>& paths) {
  if (!json.is_object()) return;
  if (json.contains("ci95")) return paths.push_back(path);
  for (const auto& [key, value] : json.items())
    collect_measured(value, path.empty() ? key : fmt::format("{}/{}", path, key), paths);
}

TEST(LimitsTable, HoldsWhatBiometryMeasures) {
  std::vector<std::string> paths;
  collect_measured(meshing::biometry_json(UncertainEye(random_eye(2)), {}), "", paths);
  ASSERT_GT(paths.size(), 15U);
  // Of these what is limited is the power that they follow from, or nothing is known of them.
  const std::regex without(
      ".*/(radius_mm|axis_deg|J0_D|J45_D|irregularity_um|section_2p3mm/.*)"
      "|.*retina/(vertex_radius.*|q_.*|axis_.*|tilt_.*|volume_mm3|area_mm2)");
  for (const std::string& path : paths)
    EXPECT_EQ(find_limits(path) == nullptr, std::regex_match(path, without)) << path;
}

TEST(Settings, MetresAreRefusedByNameAndAContactLensIsNot) {
  EXPECT_NO_THROW(check_vertex_distance("vertex", 0));
  EXPECT_NO_THROW(check_vertex_distance("vertex", 12));
  for (const double bad_mm : {0.012, -12.0, 500.0, std::numeric_limits<double>::quiet_NaN()}) {
    try {
      check_vertex_distance("vertex", bad_mm);
      ADD_FAILURE() << bad_mm;
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::usage);
      EXPECT_EQ(std::string(error.what()).rfind("vertex is ", 0), 0U) << error.what();
      EXPECT_EQ(error.remedy(), "give 5 to 30 mm, or 0 for a contact lens");
    }
  }
}

TEST(NormalAtAge, IsOfAdultsOrOfChildrenOfThatAgeOrNone) {
  const auto length = [](std::optional<double> years) {
    return normal_at_age("optical_axial_length_mm", years);
  };
  EXPECT_EQ(length({}).reference, "Hoffmann and Huetz 2010");
  EXPECT_EQ(length(18).reference, "Hoffmann and Huetz 2010");
  EXPECT_EQ(length(17.9).reference, "Tideman et al. 2018");
  EXPECT_NEAR(length(6).range.low, 22.36 - 1.5, 1e-9);
  EXPECT_NEAR(length(9).range.high, 23.10 + 1.68, 1e-9);
  EXPECT_NEAR(length(12).range.low + length(12).range.high, 23.10 + 23.41, 1e-9);
  EXPECT_FALSE(length(3).range.is_limited());
  // Rauscher's girls and boys of 4 and 10 years, Kaymak's deviations within and between the sexes.
  const Normal lens_at_7 = normal_at_age("lens_thickness_mm", 7);
  const double between_sexes = (3.48 - 3.46) / 2, sd = std::hypot((0.18 + 0.17) / 2, between_sexes);
  EXPECT_EQ(lens_at_7.reference, "Rauscher et al. 2021");
  EXPECT_NEAR(lens_at_7.range.low, (3.75 + 3.73 + 3.47 + 3.44) / 4 - 2 * sd, 0.002);
  EXPECT_NEAR(lens_at_7.range.high, (3.75 + 3.73 + 3.47 + 3.44) / 4 + 2 * sd, 0.002);
  EXPECT_FALSE(normal_at_age("lens_thickness_mm", 3.9).range.is_limited());
  const Normal chamber_at_10 = normal_at_age("anterior_chamber_depth_mm", 10);
  EXPECT_NEAR(chamber_at_10.range.low + chamber_at_10.range.high,
              2.73 + 6 * 0.046 + 0.550 + 2.86 + 6 * 0.047 + 0.554, 0.005);
  for (const char* power : {"astigmatism/M_D", "keratometry/flat/power_D", "keratometry/steep/power_D"}) {
    const Range of_child = normal_at_age(power, 12).range;
    const double radius_mm = (7.78 + 7.89) / 2,
                 radius_sd_mm = std::hypot((0.23 + 0.22) / 2, (7.89 - 7.74) / 2);
    EXPECT_NEAR(of_child.low, 337.5 / (radius_mm + 2 * radius_sd_mm), 0.2);
    EXPECT_NEAR(of_child.high, 337.5 / (radius_mm - 2 * radius_sd_mm), 0.2);
  }
  EXPECT_FALSE(normal_at_age("keratometry/asphericity_q", 9).range.is_limited());
  EXPECT_TRUE(normal_at_age("lens_thickness_mm", 40).range.is_limited());
  EXPECT_FALSE(normal_at_age("no_such_quantity", {}).range.is_limited());
}

TEST(Range, HoldsItsEndsAndNoNumberThatIsNone) {
  const Range range{1.8, 5};
  EXPECT_TRUE(range.contains(1.8) && range.contains(5.0));
  EXPECT_FALSE(range.contains(1.799) || range.contains(5.001));
  EXPECT_FALSE(range.contains(std::numeric_limits<double>::quiet_NaN()));
  EXPECT_FALSE(Range{}.is_limited());
}

}  // namespace
}  // namespace emmetrope
