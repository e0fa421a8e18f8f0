#include "tests/correction/phantom_refraction.hpp"

#include <cmath>
#include <random>

#include "correction/prescription.hpp"
#include "meshing/optics.hpp"
#include "tests/fit/simulated_keratometry.hpp"

namespace emmetrope::correction {
namespace {

Eigen::Vector3d as_vector(const PowerVector& power) { return {power.M_D, power.J0_D, power.J45_D}; }

struct Refraction {
  Eigen::Vector3d spot, paraxial;
};
Refraction refraction_of(const EyeModel& eye) {
  const PrescriptionSettings settings;
  WavefrontSettings wavefront_settings;
  wavefront_settings.wavelength_nm = settings.wavelength_nm;
  const Wavefront wavefront = measure_wavefront(with_pupil(eye, settings.pupil_mm), wavefront_settings);
  const auto at_lens = [&](const PowerVector& in_pupil) {
    return as_vector(at_vertex(wavefront, in_pupil, settings.vertex_distance_mm));
  };
  return {at_lens(wavefront.minimum_rms_spot), at_lens(wavefront.paraxial)};
}

constexpr double usual_lens_index = 1.4225, lens_index_sigma = 0.005;

}  // namespace

PhantomEye phantom_eye_from_record(const Json& record) {
  const Json &truth = record.at("truth"), &cornea = truth.at("astigmatism");
  PhantomEye eye;
  eye.fitted = parametric_eye_from_json(record.at("fit"));
  eye.truth = eye_from_json(truth.at("optics"), ".");
  eye.corneal_power_D = {cornea.at("M_D").get<double>(), cornea.at("J0_D").get<double>(),
                         cornea.at("J45_D").get<double>()};
  if (record.at("protocol").get<std::string>().find("distorted") != std::string::npos) eye.scale_sd = 0.003;
  eye.seed = record.at("seed").get<std::uint64_t>() * 2 + (record.at("laterality") == "os");
  return eye;
}

bool RefractionError::covered(int component) const {
  return std::abs(spot[component]) <= 1.959963985 * std::sqrt(covariance(component, component));
}

RefractionError refraction_error(const PhantomEye& eye, const Knowledge& knowledge) {
  EyeModel truth = eye.truth;
  OpticalDefaults defaults;
  if (knowledge.lens_index) {
    defaults.lens_index = truth.media.at("lens").index;
    defaults.lens_index_sigma = 0;
  } else {
    defaults.lens_index = usual_lens_index;
    defaults.lens_index_sigma = lens_index_sigma;
    std::mt19937_64 random(1000 + eye.seed);
    truth.media.at("lens").index =
        std::normal_distribution<double>(usual_lens_index, lens_index_sigma)(random);
  }
  EyeEstimate estimate(eye.fitted);
  estimate.add_scale_prior(eye.scale_sd);
  if (knowledge.keratometry) estimate.assimilate(simulated_keratometry(eye.corneal_power_D, eye.seed));

  const UncertainEye uncertain =
      uncertain_eye_from_json(optics_json(estimate, defaults), ".", defaults.lens_index_sigma);
  const Eigen::MatrixXd sensitivity = refraction_sensitivity(
      uncertain, [](const EyeModel& changed) { return refraction_by_spot(changed, {}); });
  const Refraction fitted = refraction_of(uncertain.eye), true_one = refraction_of(truth);
  return {fitted.spot - true_one.spot, fitted.paraxial - true_one.paraxial,
          sensitivity * uncertain.numbers.covariance * sensitivity.transpose(),
          uncertainty_budget(uncertain, sensitivity)};
}

}  // namespace emmetrope::correction
