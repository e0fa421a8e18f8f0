#include "tests/support/phantom_refraction.hpp"

#include <cmath>
#include <random>

#include "correction/prescription/prescription.hpp"
#include "meshing/optics.hpp"
#include "tests/support/simulated_keratometry.hpp"

namespace emmetrope::correction {
namespace {

using namespace meshing;
using namespace raytrace;

struct Refraction {
  Eigen::Vector3d spot, paraxial;
};
Refraction refraction_of(const EyeModel& eye) {
  const PrescriptionSettings settings;
  raytrace::WavefrontSettings wavefront_settings;
  wavefront_settings.wavelength_nm = settings.wavelength_nm;
  const raytrace::Wavefront wavefront =
      raytrace::measure_wavefront(with_pupil(eye, settings.pupil_mm), wavefront_settings);
  const auto at_lens = [&](const PowerVector& in_pupil) {
    return as_vector(raytrace::at_vertex(wavefront, in_pupil, settings.vertex_distance_mm));
  };
  return {at_lens(wavefront.minimum_rms_spot), at_lens(wavefront.paraxial)};
}

std::vector<BudgetLine> if_known(const UncertainOptics& eye, const Eigen::MatrixXd& sensitivity) {
  struct Part {
    const char* name;
    std::vector<const char*> parameters;
  };
  static const std::vector<Part> parts{
      {"anterior cornea's curvature", {"cornea_c_per_mm"}},
      {"anterior cornea's asphericity", {"cornea_q"}},
      {"ratio of the cornea's radii", {"cornea_back_ratio"}},
      {"lens radii", {"lens_anterior_radius_mm", "lens_posterior_radius_mm"}},
      {"lens asphericities", {"lens_anterior_q", "lens_posterior_q"}},
      {"axial length", {"axial_length_mm"}}};
  std::vector<BudgetLine> lines;
  for (const Part& part : parts) {
    const auto rows = static_cast<Eigen::Index>(part.parameters.size());
    PlannedObservation exact{part.name, Eigen::MatrixXd::Zero(rows, sensitivity.cols()),
                             Eigen::MatrixXd::Zero(rows, rows)};
    for (Eigen::Index row = 0; row < rows; ++row) {
      const Eigen::Index at = eye.known.index_of(part.parameters[row]);
      exact.sensitivity(row, at) = 1;
      exact.noise_covariance(row, row) = 1e-8 * eye.known.eye().covariance(at, at);
    }
    const Eigen::Vector3d sigma =
        (sensitivity * covariance_after(eye.known.eye().covariance, exact) * sensitivity.transpose())
            .diagonal()
            .cwiseMax(0)
            .cwiseSqrt();
    lines.push_back({part.name, sigma[0], sigma[1], sigma[2]});
  }
  return lines;
}

constexpr double usual_lens_index = 1.4225, lens_index_sigma = 0.005;

}  // namespace

PhantomEye phantom_eye_from_record(const Json& record, bool bound) {
  const Json &truth = record.at("truth"), &cornea = truth.at("astigmatism");
  PhantomEye eye;
  Json fit = record.at("fit");
  if (bound) fit["covariance"] = record.at("bound");
  eye.fitted = parametric_eye_from_json(fit);
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
  UncertainEye estimate = fitted_eye(eye.fitted);
  estimate.add_scale_prior(eye.scale_sd);
  if (knowledge.keratometry) estimate.learn(simulated_keratometry(eye.corneal_power_D, eye.seed));

  const UncertainOptics uncertain =
      uncertain_optics_from_json(optics_json(estimate, defaults), ".", defaults.lens_index_sigma);
  const Eigen::MatrixXd sensitivity = refraction_sensitivity(
      uncertain, [](const EyeModel& changed) { return refraction_by_spot(changed, {}); });
  const Refraction fitted = refraction_of(uncertain.model), true_one = refraction_of(truth);
  return {fitted.spot - true_one.spot, fitted.paraxial - true_one.paraxial,
          sensitivity * uncertain.known.eye().covariance * sensitivity.transpose(),
          uncertainty_budget(uncertain, sensitivity), if_known(uncertain, sensitivity)};
}

}  // namespace emmetrope::correction
