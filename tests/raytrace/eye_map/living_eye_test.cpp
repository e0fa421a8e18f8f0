#include "raytrace/eye_map/living_eye.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/eye/optics/paraxial.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "raytrace/wavefront/wavefront.hpp"
#include "tests/support/measured_optics.hpp"

namespace emmetrope::raytrace {
namespace {

UncertainOptics optics() { return uncertain_optics_from_json(measured_optics(), ".", 0.005); }

TEST(LivingEye, AccommodatesByAsManyDioptresAsAsked) {
  const UncertainOptics known = optics();
  const auto refraction_D = [&](const Eigen::VectorXd& values) {
    const EyeModel eye = eye_at(known, values);
    return paraxial_refraction(eye, eye.reference_wavelength_nm).M_D;
  };
  const Eigen::VectorXd mean = known.known.parameters().mean;
  for (const double age_years : {20.0, 45.0})
    for (const double wanted_D : {0.0, 0.5, 3.0, 6.0}) {
      const Eigen::VectorXd values = accommodated(known, wanted_D, age_years);
      EXPECT_NEAR(refraction_D(mean) - refraction_D(values), wanted_D, 1e-4) << age_years;
      const auto change = [&](const char* name) {
        const Eigen::Index i = known.known.index_of(name);
        return values[i] - mean[i];
      };
      if (wanted_D == 0) continue;
      // as every accommodating eye: steeper, thicker, further forward (Dubbelman et al. 2005)
      EXPECT_LT(change("lens_anterior_radius_mm"), 0);
      EXPECT_LT(change("lens_posterior_radius_mm"), 0);
      EXPECT_GT(change("lens_thickness_mm"), 0);
      EXPECT_LT(change("anterior_chamber_depth_mm"), 0);
    }
}

/// Vergence of a ray fan in D: slope by height of the terms p_x and p_y, at the middle of the field.
double vergence_D(const std::vector<double>& rays) {
  const auto pupil = static_cast<std::size_t>(EyeMap::terms(EyeMap::pupil_degree));
  // T_n(0) = 1, 0, -1, 0, 1, ...
  const auto at_middle = [&](std::size_t term, std::size_t output) {
    double sum = 0;
    std::size_t field = 0;
    const auto even = [](int n) { return n % 2 == 1 ? 0.0 : n % 4 == 0 ? 1.0 : -1.0; };
    for (int j = 0; j <= EyeMap::field_degree; ++j)
      for (int i = 0; i <= EyeMap::field_degree - j; ++i, ++field)
        sum += even(i) * even(j) * rays[(field * pupil + term) * EyeMap::outputs + output];
    return sum;
  };
  constexpr std::size_t along_x = 1, along_y = EyeMap::pupil_degree + 1;
  return 1e3 *
         (at_middle(along_x, 2) / at_middle(along_x, 0) + at_middle(along_y, 3) / at_middle(along_y, 1)) / 2;
}

TEST(LivingEye, TheEndsOfItsBandAreTheEndsOfItsRefraction) {
  const UncertainOptics known = optics();
  EyeMapSettings settings;
  settings.threads = 2;
  const EyeModel eye = eye_at(known, known.known.parameters().mean);
  const LivingEye living = living_measured_eye(eye, &known, 40, settings);
  EXPECT_NEAR(living.map.largest_accommodation_D, 6.5, 1e-9);
  ASSERT_FALSE(living.bands.empty());
  const std::vector<double> at_rest = rays_at_rest(eye, settings);
  for (const EyeBand& band : living.bands) {
    // Widest first, and each at least 0.05 D.
    EXPECT_GE(std::hypot(band.reach_D.M_D, band.reach_D.J0_D, band.reach_D.J45_D), 0.05);
    std::vector<double> upper = at_rest, lower = at_rest;
    for (std::size_t i = 0; i < at_rest.size(); ++i) {
      upper[i] += band.upper[i];
      lower[i] += band.lower[i];
    }
    // A refraction is the lens that a diverging fan out of the eye needs: paraxial vergence moves as the fitted M does
    // but for spherical aberration.
    const double moved_D = (vergence_D(upper) - vergence_D(lower)) / 2;
    EXPECT_NEAR(moved_D, band.reach_D.M_D, 0.05 + 0.1 * std::abs(band.reach_D.M_D));
  }
}

// Of a short-sighted eye an interval at the spectacle's 12 mm is a fifth wider than in the pupil.
TEST(LivingEye, ItsBandIsThatOfTheLensBesideIt) {
  Json long_eye = measured_optics();
  constexpr double length_mm = 26.5;
  long_eye["eye"]["surfaces"].back()["position_mm"] = length_mm;
  long_eye["values"][10] = length_mm;
  const UncertainOptics known = uncertain_optics_from_json(long_eye, ".", 0.005);
  const NormalDistribution numbers = known.known.parameters();
  const BandRefraction told{3, 12, 589.3};
  const Eigen::MatrixXd slopes = jacobian(numbers, [&](const Eigen::VectorXd& values) -> Eigen::VectorXd {
    EyeModel eye = eye_at(known, values);
    eye.set_stop_diameter(told.pupil_mm);
    WavefrontSettings settings;
    settings.wavelength_nm = told.wavelength_nm;
    const Wavefront wavefront = measure_wavefront(eye, settings);
    return as_vector(at_vertex(wavefront, wavefront.minimum_rms_spot, told.vertex_distance_mm));
  });
  const double half_width_D = 1.96 * std::sqrt((slopes * numbers.covariance * slopes.transpose())(0, 0));
  EyeMapSettings settings;
  settings.threads = 2;
  double reach_squared = 0;
  for (const EyeBand& band :
       living_measured_eye(eye_at(known, numbers.mean), &known, 40, settings, told).bands)
    reach_squared += band.reach_D.M_D * band.reach_D.M_D;
  EXPECT_NEAR(std::sqrt(reach_squared), half_width_D, 0.02);
}

TEST(LivingEye, WithoutOpticsItHasNeitherBandNorAccommodation) {
  const UncertainOptics known = optics();
  const LivingEye living = living_measured_eye(eye_at(known, known.known.parameters().mean), nullptr, 40, {});
  EXPECT_EQ(living.map.largest_accommodation_D, 0);
  EXPECT_TRUE(living.bands.empty());
}

TEST(LivingEye, ASchematicEyeAccommodatesIfItsModelDoes) {
  EXPECT_EQ(living_schematic_eye("navarro", {}).map.largest_accommodation_D, 8);
  EXPECT_EQ(living_schematic_eye("liou-brennan", {}).map.largest_accommodation_D, 0);
  EXPECT_THROW(living_schematic_eye("nobody", {}), Error);
}

TEST(LivingEye, ShowsItsSurfacesAtRestHalfwayAndAccommodated) {
  const LivingEye living = living_schematic_eye("navarro", {});
  ASSERT_EQ(living.accommodating.size(), 3U);
  const auto radius_mm = [&](std::size_t state, const std::string& name) {
    constexpr double beside_mm = 1e-2;
    for (const Surface& surface : living.accommodating[state].surfaces)
      if (surface.name == name) return beside_mm * beside_mm / 2 / *surface.shape->depth_mm(beside_mm, 0);
    return 0.0;
  };
  // Navarro, Santamaria and Bescos (1985): both radii by the logarithm of one parameter A + 1, 1 at rest.
  for (const std::size_t state : {0, 1, 2}) {
    const double log_A = (10.2 - radius_mm(state, "lens_anterior")) / 1.75;
    EXPECT_NEAR(radius_mm(state, "lens_posterior"), -6 + 0.2294 * log_A, 1e-4) << state;
    const auto refraction_D = [&](std::size_t of) {
      const EyeModel& eye = living.accommodating[of];
      return paraxial_refraction(eye, eye.reference_wavelength_nm).M_D;
    };
    EXPECT_NEAR(refraction_D(0) - refraction_D(state),
                0.5 * static_cast<double>(state) * living.map.largest_accommodation_D, 1e-3);
  }
}

/// On Navarro's retina, a sphere of 12 mm whose back stands 24.0 mm behind the cornea.
TEST(RetinaRefraction, LiesOnTheRetinaAndIsAsRoundAsTheEye) {
  const EyeModel eye = make_eye("navarro");
  const RetinaRefraction refraction = retina_refraction(eye, 2);
  ASSERT_EQ(refraction.places.size(), 1U + RetinaRefraction::rings * RetinaRefraction::spokes);
  const Eigen::Vector3d centre(0, 0, 12 - eye.axial_length_mm());
  for (const auto& place : refraction.places) {
    ASSERT_TRUE(place);
    EXPECT_NEAR((place->retina_mm - centre).norm(), 12, 1e-6);
  }
  EXPECT_NEAR(refraction.places[0]->M_D, measure_wavefront(eye).minimum_rms_spot.M_D, 1e-9);
  for (std::size_t ring = 0; ring < RetinaRefraction::rings; ++ring) {
    const std::size_t first = 1 + ring * RetinaRefraction::spokes;
    for (std::size_t spoke = 1; spoke < RetinaRefraction::spokes; ++spoke)
      EXPECT_NEAR(refraction.places[first + spoke]->M_D, refraction.places[first]->M_D, 0.02)
          << ring << ", " << spoke;
    // Light from +x falls on the other side of the axis.
    EXPECT_LT(refraction.places[first]->retina_mm.x(), 0);
    EXPECT_NEAR(refraction.places[first]->retina_mm.y(), 0, 1e-6);
  }
}

}  // namespace
}  // namespace emmetrope::raytrace
