#include "pipeline/eye/media/medium.hpp"

#include <gmock/gmock.h>

#include "pipeline/eye/model/eye_model.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"

namespace emmetrope {
namespace {

using Formula = Dispersion::Formula;

TEST(Medium, NavarrosHerzbergerIndices) {
  const EyeModel eye = make_eye("navarro");
  const std::pair<const char*, std::pair<double, double>> expected[] = {{"cornea", {1.377404, 1.375967}},
                                                                        {"aqueous", {1.338841, 1.337371}},
                                                                        {"lens", {1.421807, 1.419922}},
                                                                        {"vitreous", {1.337440, 1.336006}}};
  for (const auto& [name, values] : expected) {
    EXPECT_NEAR(eye.medium(name).dispersion.formula_index(550), values.first, 1e-6) << name;
    EXPECT_NEAR(eye.medium(name).dispersion.formula_index(589.3), values.second, 1e-6) << name;
  }
}

TEST(Medium, FormulaGivesTheDifferenceFromTheReference) {
  for (const std::string& name : schematic_eye_names()) {
    const EyeModel eye = make_eye(name);
    for (const auto& [medium_name, medium] : eye.media) {
      const double reference = eye.reference_wavelength_nm;
      EXPECT_EQ(medium.index_at(reference, reference), medium.index) << name << medium_name;
      EXPECT_GT(medium.index_at(450, reference), medium.index_at(650, reference)) << name << medium_name;
    }
  }
}

TEST(Medium, AbbeNumberIsKept) {
  const Dispersion abbe{Formula::abbe, {1.377, 57.1}};
  EXPECT_NEAR((1.377 - 1) / (abbe.formula_index(486.1327) - abbe.formula_index(656.2725)), 57.1, 1e-9);
  EXPECT_NEAR(abbe.formula_index(587.5618), 1.377, 1e-12);
}

TEST(Medium, SellmeierOfFusedSilica) {
  // Malitson 1965: n_d 1.45846, Abbe number 67.8.
  const Dispersion silica{
      Formula::sellmeier,
      {0.6961663, 0.0684043 * 0.0684043, 0.4079426, 0.1162414 * 0.1162414, 0.8974794, 9.896161 * 9.896161}};
  EXPECT_NEAR(silica.formula_index(587.56), 1.45846, 1e-5);
  EXPECT_NEAR(
      (silica.formula_index(587.56) - 1) / (silica.formula_index(486.13) - silica.formula_index(656.27)),
      67.8, 0.05);
}

TEST(Medium, ConradyOfTheAqueous) {
  const Dispersion aqueous{Formula::conrady, {1.32107278, 8.47113739e-3, 2.31825063e-4}};
  EXPECT_NEAR(aqueous.formula_index(555),
              1.32107278 + 8.47113739e-3 / 0.555 + 2.31825063e-4 / std::pow(0.555, 3.5), 1e-12);
}

TEST(Medium, TableIsMetAtItsRowsAndGoesOnBeyondThem) {
  const Dispersion table{Formula::table, {458, 1.3828, 543, 1.3777, 589.3, 1.376, 632.8, 1.3747}};
  EXPECT_NEAR(table.formula_index(458), 1.3828, 1e-12);
  EXPECT_NEAR(table.formula_index(543), 1.3777, 1e-12);
  EXPECT_NEAR(table.formula_index(632.8), 1.3747, 1e-12);
  EXPECT_GT(table.formula_index(400), 1.3828);
  EXPECT_LT(table.formula_index(700), 1.3747);
  EXPECT_GT(table.formula_index(700), 1.370);
}

TEST(Medium, GradientOfLiouAndBrennanMeetsInItsMiddle) {
  const EyeModel eye = make_eye("liou-brennan");
  EXPECT_NEAR(eye.medium("lens_front").index_at(1.59, 0, 555, 555),
              eye.medium("lens_back").index_at(0, 0, 555, 555), 1e-4);
  EXPECT_NEAR(eye.medium("lens_front").index_at(0.5, 2, 555, 555),
              1.368 + 0.049057 * 0.5 - 0.015427 * 0.25 - 0.001978 * 4, 1e-12);
}

}  // namespace
}  // namespace emmetrope
