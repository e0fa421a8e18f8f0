#include "raytrace/eye_map/living_eye.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/base/parallel.hpp"
#include "pipeline/eye/optics/paraxial.hpp"
#include "pipeline/eye/population/population.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "raytrace/wavefront/field.hpp"

namespace emmetrope::raytrace {
namespace {

constexpr double sigmas_to_95 = 1.96;
constexpr double least_reach_D = 0.05;  ///< of a band that anybody would see

Eigen::Vector3d refraction_of(EyeModel eye, const BandRefraction& told) {
  eye.set_stop_diameter(told.pupil_mm);
  WavefrontSettings settings;
  settings.wavelength_nm = told.wavelength_nm;
  const Wavefront wavefront = measure_wavefront(eye, settings);
  return as_vector(at_vertex(wavefront, wavefront.minimum_rms_spot, told.vertex_distance_mm));
}

double paraxial_mean_D(const EyeModel& eye) {
  return paraxial_refraction(eye, eye.reference_wavelength_nm).M_D;
}

std::vector<EyeBand> bands_of(const UncertainOptics& optics, const EyeMapSettings& settings,
                              const BandRefraction& told) {
  const NormalDistribution known = optics.known.parameters();
  const Eigen::MatrixXd slopes = jacobian(known, [&](const Eigen::VectorXd& values) -> Eigen::VectorXd {
    return refraction_of(eye_at(optics, values), told);
  });
  const Eigen::Matrix3d covariance = slopes * known.covariance * slopes.transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(covariance);
  const std::vector<double> at_rest = rays_at_rest(eye_at(optics, known.mean), settings);
  const auto change = [&](const Eigen::VectorXd& shift) {
    std::vector<double> rays = rays_at_rest(eye_at(optics, known.mean + shift), settings);
    for (std::size_t i = 0; i < rays.size(); ++i) rays[i] -= at_rest[i];
    return rays;
  };
  std::vector<EyeBand> bands;
  for (int k = 2; k >= 0; --k) {
    const double reach_D = sigmas_to_95 * std::sqrt(std::max(0.0, axes.eigenvalues()[k]));
    if (reach_D < least_reach_D) break;
    Eigen::Vector3d axis = axes.eigenvectors().col(k);
    if (axis.x() < 0) axis = -axis;
    const Eigen::VectorXd shift =
        known.covariance * slopes.transpose() * axis * (sigmas_to_95 * sigmas_to_95 / reach_D);
    const Eigen::Vector3d reach = reach_D * axis;
    bands.push_back({{reach[0], reach[1], reach[2]}, change(shift), change(-shift)});
  }
  return bands;
}

std::vector<EyeModel> accommodating(const EyeStates& states) {
  if (!(states.largest_accommodation_D > 0)) return {};
  return {states.at(0), states.at(states.largest_accommodation_D / 2),
          states.at(states.largest_accommodation_D)};
}

}  // namespace

RetinaRefraction retina_refraction(const EyeModel& eye, int threads) {
  RetinaRefraction refraction;
  refraction.places.resize(1 + RetinaRefraction::rings * RetinaRefraction::spokes);
  WavefrontSettings settings;
  settings.order = 4;
  const ChiefRays chief_rays(eye, eye.reference_wavelength_nm);
  on_threads(threads, refraction.places.size(), [&](std::size_t k) {
    Eigen::Vector2d direction_deg(0, 0);
    if (k > 0) {
      const std::size_t ring = 1 + (k - 1) / RetinaRefraction::spokes,
                        spoke = (k - 1) % RetinaRefraction::spokes;
      const double slope = std::tan(static_cast<double>(ring) * RetinaRefraction::ring_deg * degree),
                   angle = 2 * pi * static_cast<double>(spoke) / RetinaRefraction::spokes;
      direction_deg = {std::atan(slope * std::cos(angle)) / degree,
                       std::atan(slope * std::sin(angle)) / degree};
    }
    if (const auto seen = wavefront_towards(eye, chief_rays, direction_deg, settings))
      refraction.places[k] = {seen->retina_mm, seen->wavefront.minimum_rms_spot.M_D};
  });
  return refraction;
}

Eigen::VectorXd accommodated(const UncertainOptics& optics, double accommodation_D, double age_years) {
  const Eigen::VectorXd mean = optics.known.parameters().mean;
  const auto at_stimulus = [&](double stimulus_D) {
    Eigen::VectorXd values = mean;
    const auto value = [&](const char* name) -> double& { return values[optics.known.index_of(name)]; };
    const auto curve = [&](const char* name, double per_mm) {
      value(name) = 1 / (1 / value(name) + stimulus_D * per_mm);
    };
    curve("lens_anterior_radius_mm", 0.0077);
    curve("lens_posterior_radius_mm", 0.0043);
    value("lens_thickness_mm") += stimulus_D * (0.058 - 0.0005 * age_years);
    value("anterior_chamber_depth_mm") -= stimulus_D * (0.048 - 0.0004 * age_years);
    value("lens_index") += stimulus_D * 0.0013;
    return values;
  };
  const double at_rest_D = paraxial_mean_D(eye_at(optics, mean));
  // Nearly straight: the secant method ends in a few steps.
  double before = 0, before_D = 0, stimulus = accommodation_D;
  for (int round = 0; round < 20; ++round) {
    const double reached_D = at_rest_D - paraxial_mean_D(eye_at(optics, at_stimulus(stimulus)));
    if (std::abs(reached_D - accommodation_D) < 1e-6 || reached_D == before_D) break;
    const double next =
        stimulus + (accommodation_D - reached_D) * (stimulus - before) / (reached_D - before_D);
    before = stimulus;
    before_D = reached_D;
    stimulus = next;
  }
  return at_stimulus(stimulus);
}

LivingEye living_schematic_eye(const std::string& name_or_file, const EyeMapSettings& settings) {
  EyeStates states;
  states.at = [&](double accommodation_D) {
    EyeOptions options;
    options.accommodation_D = accommodation_D;
    return make_eye(name_or_file, options);
  };
  constexpr double most_D = 8;
  for (double tried_D = most_D; tried_D > 0; tried_D -= 2) try {
      states.at(tried_D);
      states.largest_accommodation_D = tried_D;
      break;
    } catch (const Error& error) {  // a model that does not, or not so far
      if (error.status() == ExitStatus::fault) throw;
    }
  return {widest_eye_map(states, settings), {}, {}, accommodating(states)};
}

LivingEye living_measured_eye(const EyeModel& eye, const UncertainOptics* optics, double age_years,
                              const EyeMapSettings& settings, const BandRefraction& refraction) {
  LivingEye living{widest_eye_map({[&](double) { return eye; }, 0}, settings), {}};
  if (!optics) return living;
  EyeMapSettings same = settings;
  same.pupil_mm = living.map.pupil_mm;
  constexpr double most_D = 8;
  const EyeStates formulas{[&](double accommodation_D) {
                             return eye_at(*optics, accommodated(*optics, accommodation_D, age_years));
                           },
                           std::min(most_D, accommodation_amplitude(age_years).average_D)};
  // The eye itself is worth showing without them.
  const auto if_possible = [&](const char* what, const std::function<void()>& add) {
    try {
      add();
    } catch (const Error& error) {
      if (error.status() == ExitStatus::fault) throw;
      living.left_out.push_back(std::string(what) + " is left out: " + error.what());
    }
  };
  if (formulas.largest_accommodation_D > 0)
    if_possible("accommodation", [&] {
      living.map = with_accommodation_of(living.map, make_eye_map(formulas, same));
      living.accommodating = accommodating(formulas);
    });
  if_possible("the interval", [&] { living.bands = bands_of(*optics, same, refraction); });
  return living;
}

}  // namespace emmetrope::raytrace
