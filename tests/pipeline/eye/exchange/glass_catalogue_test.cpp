#include "pipeline/eye/exchange/glass_catalogue.hpp"

#include <gmock/gmock.h>

#include "pipeline/base/files.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope {
namespace {

using test::TemporaryFolder;

// N-BK7 of Schott's data sheet (Sellmeier), n_d 1.51680, n_F 1.52238, n_C 1.51432; and SF6's older entry by Schott's
// power series would be another formula.
TEST(GlassCatalogue, SellmeiersGlassHasItsDataSheetsIndices) {
  const TemporaryFolder folder;
  write_file(
      folder.path() / "s.agf",
      "CC Schott\nNM N-BK7 2 517642.251 1.5168 64.17 0 1\nED 7.1 8.3 2.51 -0.0009 0\n"
      "CD 1.03961212E+000 6.00069867E-003 2.31792344E-001 2.00179144E-002 1.01046945E+000 1.03560653E+002 0 0\n"
      "NM ODD 13 0 1.5 60\nCD 1 2 3\n");
  const auto glasses = read_glass_catalogue(folder.path() / "s.agf", 587.5618);
  ASSERT_EQ(glasses.count("N-BK7"), 1u);
  EXPECT_EQ(glasses.count("ODD"), 0u);  // an unknown formula
  const Medium& glass = glasses.at("N-BK7");
  EXPECT_NEAR(glass.index_at(587.5618, 587.5618), 1.51680, 5e-6);
  EXPECT_NEAR(glass.index_at(486.1327, 587.5618), 1.52238, 5e-6);
  EXPECT_NEAR(glass.index_at(656.2725, 587.5618), 1.51432, 5e-6);
}

TEST(GlassCatalogue, WhatIsWrittenIsRead) {
  const TemporaryFolder folder;
  using Formula = Dispersion::Formula;
  const std::vector<Medium> media{
      {1.376, {}, {}},
      {1.37, {Formula::conrady, {1.32107278, 8.47113739e-3, 2.31825063e-4}}, {}},
      {1.336, {Formula::herzberger, {1.36697, -0.0024177, 0.0021106, -0.0000313}}, {}},
      {1.42, {Formula::table, {458, 1.3828, 543, 1.3777, 632.8, 1.3747}}, {}}};
  for (const Medium& medium : media) {
    const CatalogueGlass glass = catalogue_glass("X", medium, 555);
    write_file(folder.path() / "x.agf", glass.text);
    const Medium again = read_glass_catalogue(folder.path() / "x.agf", 555).at("X");
    EXPECT_NEAR(again.index, medium.index, 1e-14);
    for (double nm = 380; nm <= 1000; nm += 20)
      EXPECT_NEAR(again.index_at(nm, 555), medium.index_at(nm, 555), 1.01 * glass.worst_index + 1e-14);
  }
  EXPECT_LT(catalogue_glass("X", media[1], 555).worst_index, 1e-14);
  EXPECT_LT(catalogue_glass("X", media[2], 555).worst_index, 2e-5);
}

}  // namespace
}  // namespace emmetrope
