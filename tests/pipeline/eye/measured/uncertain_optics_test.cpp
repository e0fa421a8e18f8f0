#include "pipeline/eye/measured/uncertain_optics.hpp"

#include <gtest/gtest.h>

#include "pipeline/base/error.hpp"
#include "pipeline/eye/optics/paraxial.hpp"
#include "tests/support/measured_optics.hpp"

namespace emmetrope {
namespace {

PowerVector paraxial(const EyeModel& eye) { return paraxial_refraction(eye, 589.3); }

TEST(UncertainOptics, IsTheEyeThatItsParametersDescribe) {
  const UncertainOptics eye = uncertain_optics_from_json(measured_optics(), ".", 0.005);
  EXPECT_EQ(eye.known.eye().parameter_names.back(), "lens_index");
  EXPECT_NEAR(std::sqrt(eye.known.eye().covariance(17, 17)), 0.005, 1e-12);
  const PowerVector rebuilt = paraxial(eye_at(eye, eye.known.parameters().mean)), given = paraxial(eye.model);
  EXPECT_NEAR(rebuilt.M_D, given.M_D, 1e-9);
  EXPECT_NEAR(rebuilt.J0_D, given.J0_D, 1e-9);
  EXPECT_NEAR(rebuilt.J45_D, given.J45_D, 1e-9);
}

TEST(UncertainOptics, TiltTurnsTheLensAboutItsMiddle) {
  const UncertainOptics eye = uncertain_optics_from_json(measured_optics(), ".", 0.005);
  Eigen::VectorXd values = eye.known.parameters().mean;
  values[eye.known.index_of("lens_tilt_x_deg")] = 5;
  const EyeModel tilted = eye_at(eye, values);
  const Eigen::Vector3d front = tilted.surface("lens_anterior").eye_from_surface().translation();
  const Eigen::Vector3d back = tilted.surface("lens_posterior").eye_from_surface().translation();
  EXPECT_LT(((front + back) / 2 - Eigen::Vector3d(0, 0, -5.3)).norm(), 1e-12);
  EXPECT_NEAR((front - back).norm(), 3.8, 1e-12);
}

TEST(UncertainOptics, RefusesWhatDoesNotFit) {
  const auto refused = [](const Json& json) {
    try {
      uncertain_optics_from_json(json, ".", 0.005);
    } catch (const Error& error) {
      return error.status() == ExitStatus::input_invalid;
    }
    return false;
  };
  Json missing = measured_optics();
  missing.erase("covariance");
  EXPECT_TRUE(refused(missing));
  Json short_row = measured_optics();
  short_row["covariance"][3].erase(0);
  EXPECT_TRUE(refused(short_row));
  Json indefinite = measured_optics();
  indefinite["covariance"][0][1] = indefinite["covariance"][1][0] = 1.0;
  EXPECT_TRUE(refused(indefinite));
  Json other_eye = measured_optics();
  other_eye["values"][10] = 25.0;
  EXPECT_TRUE(refused(other_eye));
  other_eye["values"][10] = 24.0;
  other_eye["values"][0] = 1 / 7.5;
  EXPECT_TRUE(refused(other_eye));
}

}  // namespace
}  // namespace emmetrope
