#include "correction/prescription/known_data.hpp"

#include <fmt/core.h>

#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/eye/media/ocular_media.hpp"

namespace emmetrope::correction {
namespace {

constexpr double usual_sigma_D = 0.25;  ///< of a subjective refraction

}  // namespace

std::map<Laterality, KnownData> parse_known_data(const KnownDataFlags& flags) {
  std::map<Laterality, KnownData> by_eye;
  // An eye of the correct stage ends at its photoreceptors.
  constexpr double retinal_depth_mm = 0;
  for (auto& [eye, instruments] : parse_instruments(flags.instruments, retinal_depth_mm))
    by_eye[eye].instruments = instruments;
  for (const std::string& text : flags.refractions) {
    const EyeRefraction given = parse_eye_refraction(text);
    std::optional<StatedRefraction>& refraction = by_eye[given.eye].refraction;
    if (refraction)
      throw usage_error("--refraction \"" + text + "\": that eye has one already",
                        "give the better one, or the mean of both with its accuracy");
    refraction = given.stated;
  }
  return by_eye;
}

Json to_json(const std::map<Laterality, KnownData>& known) {
  std::map<Laterality, EyeInstruments> instruments;
  Json refractions = Json::object();
  for (const auto& [eye, data] : known) {
    if (data.has_instruments()) instruments[eye] = data.instruments;
    if (!data.refraction) continue;
    const StatedRefraction& stated = *data.refraction;
    refractions[to_string(eye)] = {{"sphere_D", stated.refraction.sphere_D},
                                   {"cylinder_D", stated.refraction.cylinder_D},
                                   {"axis_deg", stated.refraction.axis_deg},
                                   {"vertex_distance_mm", stated.vertex_distance_mm},
                                   {"sigma_D", stated.sigma_D.value_or(usual_sigma_D)}};
  }
  return {{"instruments", to_json(instruments)}, {"refractions", refractions}};
}

Calibration calibrate(const raytrace::Tracer& tracer, const EyeModel& traced, UncertainOptics& uncertain,
                      const StatedRefraction& known, const PrescriptionSettings& settings) {
  const PowerVector at_cornea = move_towards_eye(to_power_vector(known.refraction), known.vertex_distance_mm);
  Calibration calibration;
  calibration.given = move_towards_eye(at_cornea, -settings.vertex_distance_mm);
  calibration.sigma_D = known.sigma_D.value_or(usual_sigma_D);
  calibration.index_before = uncertain.known.eye().lens_index;
  const SearchResult sharpest = sharpest_lens(tracer, traced, settings);
  calibration.before = sharpest.family.power(sharpest.best.lens);
  calibration.index_was_known = !(uncertain.known.sigma("lens_index") > 0);
  const Eigen::MatrixXd sensitivity = refraction_sensitivity(
      uncertain, [&](const EyeModel& eye) { return refraction_by_spot(eye, settings); });
  calibration.covariance_before = sensitivity * uncertain.known.eye().covariance * sensitivity.transpose();
  for (Eigen::Index i = 0; i < 3; ++i)
    calibration.origins_before[static_cast<std::size_t>(i)] = uncertain.known.origin_of(sensitivity.row(i));

  // The least-squares fit of ray slopes moves with the eye as the sharpest lens does; refractions are of sodium light,
  // whatever light the lens is sought in.
  PrescriptionSettings in_sodium_light = settings;
  in_sodium_light.wavelength_nm = sodium_nm;
  const Eigen::Vector3d start = as_vector(refraction_by_spot(uncertain.model, settings));
  calibration.innovation_sigma = learn(
      uncertain, "refraction",
      [&](const Eigen::VectorXd& values) -> Eigen::VectorXd {
        return as_vector(calibration.before) - start +
               as_vector(refraction_by_spot(eye_at(uncertain, values), in_sodium_light));
      },
      as_vector(calibration.given), Eigen::Matrix3d::Identity() * calibration.sigma_D * calibration.sigma_D);
  const Eigen::Index index = uncertain.known.index_of("lens_index");
  const auto unit = Eigen::RowVectorXd::Unit(uncertain.known.eye().covariance.rows(), index);
  calibration.index_after = Measured::from_sigma(
      uncertain.known.eye().lens_index, uncertain.known.sigma("lens_index"), uncertain.known.origin_of(unit));
  if (!(calibration.index_after.value > 1.36 && calibration.index_after.value < 1.5))
    throw no_result_error(
        fmt::format(
            "the given refraction, {:+.2f} D of spherical equivalent, and what the eye's geometry says would need a "
            "lens of index {:.3f}",
            calibration.given.M_D, calibration.index_after.value),
        "check the refraction's eye and sign, and the axial length");
  return calibration;
}

}  // namespace emmetrope::correction
