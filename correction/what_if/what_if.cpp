#include "correction/what_if/what_if.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>

#include "correction/what_if/ablation.hpp"
#include "correction/what_if/iol_formulas.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/media/ocular_media.hpp"
#include "pipeline/eye/population/population.hpp"
#include "raytrace/wavefront/wavefront.hpp"

namespace emmetrope::correction {
namespace {

constexpr double iol_index = 1.46, iol_thickness_mm = 0.8;

/// Radius of each face of a symmetric biconvex lens in aqueous with that equivalent power (thick lens), mm.
double iol_radius_mm(double power_D) {
  // F = 2 F1 - (t/n) F1^2 with F1 the power of a face; the root near F / 2.
  const double t_over_n = iol_thickness_mm * 1e-3 / iol_index;
  const double face_D = (1 - std::sqrt(1 - t_over_n * power_D)) / t_over_n;
  return 1e3 * (iol_index - aqueous_index) / face_D;
}

double mean_refraction_at_cornea_D(const EyeModel& eye, double wavelength_nm,
                                   const Eigen::Vector2d& fovea_mm) {
  raytrace::WavefrontSettings settings;
  settings.wavelength_nm = wavelength_nm;
  settings.fovea_mm = fovea_mm;
  const raytrace::Wavefront wavefront = raytrace::measure_wavefront(eye, settings);
  return raytrace::at_vertex(wavefront, wavefront.minimum_rms_spot, 0).M_D;
}

/// A distance for JSON: null where it is infinite.
Json finite_or_null(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Json pupil_json(const EyeModel& eye, const PrescriptionSettings& settings) {
  Json rows = Json::array();
  for (const double pupil_mm : {1.0, 2.0, 3.0, 4.0, 5.0, 6.0}) {
    PrescriptionSettings other = settings;
    other.pupil_mm = pupil_mm;
    try {
      const PowerVector power = refraction_by_spot(eye, other);
      rows.push_back(
          {{"pupil_mm", pupil_mm}, {"M_D", power.M_D}, {"J0_D", power.J0_D}, {"J45_D", power.J45_D}});
    } catch (const Error& error) {  // a pupil wider than what the eye lets through
      if (error.status() != ExitStatus::no_result) throw;
    }
  }
  return rows;
}

/// Whether anything between cornea and retina bends light.
bool has_lens(const EyeModel& eye) {
  return std::any_of(eye.surfaces.begin(), eye.surfaces.end() - 1, [](const Surface& surface) {
    return !surface.is_stop() && surface.name.rfind("cornea", 0) != 0;
  });
}

/// Far and near point of an eye that has taken up a part of its amplitude.
Json accommodation_json(const PowerVector& at_cornea, const PrescriptionSettings& settings,
                        const PowerVector& lens, double age_years, double accommodation_D) {
  const Amplitude amplitude = accommodation_amplitude(age_years);
  const double left_D = amplitude.average_D - accommodation_D;
  return {{"age_years", age_years},
          {"amplitude_D", amplitude.average_D},
          {"minimum_amplitude_D", amplitude.minimum_D},
          {"far_point_mm", finite_or_null(near_point_mm(at_cornea.M_D, -accommodation_D))},
          {"near_point_mm", finite_or_null(near_point_mm(at_cornea.M_D, left_D))},
          {"near_point_with_lens_mm",
           finite_or_null(near_point_with_lens_mm(at_cornea, left_D, lens, settings.vertex_distance_mm))}};
}

/// Mean keratometric power 1.5 mm from the apex, over two perpendicular meridians.
double mean_keratometry_D(const EyeModel& eye) {
  constexpr double ring_mm = 1.5;
  const Shape& cornea = *eye.surface("cornea_anterior").shape;
  double sum_D = 0;
  for (const auto& [x, y] : {std::pair(1, 0), std::pair(-1, 0), std::pair(0, 1), std::pair(0, -1)}) {
    const auto normal = cornea.normal(ring_mm * x, ring_mm * y);
    if (!normal) throw no_result_error("the front cornea ends within 1.5 mm of its apex");
    sum_D += keratometric_D_mm * (normal->x() * x + normal->y() * y) / ring_mm;
  }
  return sum_D / 4;
}

IolBiometry iol_biometry(const EyeModel& eye, double axial_length_mm) {
  return {axial_length_mm, mean_keratometry_D(eye), eye.surface("lens_anterior").position_mm};
}

using IolEye = ThinLensEye (*)(const IolBiometry&, double a_constant);

struct IolFormula {
  const char* name;
  IolEye eye;
};

constexpr std::array iol_formulas{IolFormula{"srkt", srkt_eye}, IolFormula{"holladay_1", holladay_eye},
                                  IolFormula{"hoffer_q", hoffer_q_eye}, IolFormula{"haigis", haigis_eye}};

/// How the IOL's power is found: rays first, then the formulas.
const char* iol_method(std::size_t i) { return i == 0 ? "ray_traced" : iol_formulas.at(i - 1).name; }

double or_nan(const std::function<double()>& power) {
  try {
    return power();
  } catch (const Error& error) {
    if (error.status() != ExitStatus::no_result) throw;
    return std::numeric_limits<double>::quiet_NaN();
  }
}

/// Says where rays meet the implant. SRK/T has no place for it behind a steep cornea (keratoconus from about 50 D);
/// Holladay's formula, which takes no radius below 7 mm, has.
IolEye placing_formula(const IolBiometry& biometry, double a_constant) {
  return std::isfinite(or_nan([&] { return srkt_eye(biometry, a_constant).lens_mm; })) ? srkt_eye
                                                                                       : holladay_eye;
}

/// By all methods; NaN where one has no answer.
Eigen::VectorXd iol_powers_D(const std::function<double()>& ray_traced_D, const IolBiometry& biometry,
                             const WhatIfSettings& what_if) {
  Eigen::VectorXd powers_D(iol_formulas.size() + 1);
  powers_D[0] = or_nan(ray_traced_D);
  for (std::size_t i = 0; i < iol_formulas.size(); ++i)
    powers_D[static_cast<Eigen::Index>(i + 1)] = or_nan([&] {
      return iol_power_D(iol_formulas.at(i).eye(biometry, what_if.iol_a_constant), what_if.iol_target_D);
    });
  return powers_D;
}

/// Standard deviations of the powers by what is known of the eye. They are wider than the refraction's may be: a
/// refraction that was given tells of cornea, lens and length together, and an IOL takes the lens's place. The ray-traced
/// power moves as what a fixed IOL leaves, over what a dioptre of it changes. NaN where a formula has no answer for eyes as
/// near as these.
Eigen::VectorXd iol_sigmas_D(const UncertainOptics& measured, double ray_traced_D, IolEye placing,
                             const PrescriptionSettings& settings, const WhatIfSettings& what_if) {
  const IolBiometry at_mean = iol_biometry(measured.model, measured.known.eye().axial_length_mm);
  const auto left_D = [&](const EyeModel& eye, const IolBiometry& biometry, double power_D) {
    const double position_mm = placing(biometry, what_if.iol_a_constant).lens_mm;
    return mean_refraction_at_cornea_D(with_iol(with_pupil(eye, settings.pupil_mm), power_D, position_mm),
                                       settings.wavelength_nm, settings.fovea_mm);
  };
  constexpr double step_D = 0.5;
  const double left_per_D = (left_D(measured.model, at_mean, ray_traced_D + step_D) -
                             left_D(measured.model, at_mean, ray_traced_D - step_D)) /
                            (2 * step_D);
  const NormalDistribution numbers = measured.known.parameters();
  const Eigen::MatrixXd slopes = jacobian(numbers, [&](const Eigen::VectorXd& values) -> Eigen::VectorXd {
    const EyeModel eye = eye_at(measured, values);
    const IolBiometry biometry = iol_biometry(eye, measured.known.at(values).axial_length_mm);
    return iol_powers_D([&] { return -left_D(eye, biometry, ray_traced_D) / left_per_D; }, biometry, what_if);
  });
  Eigen::VectorXd sigmas_D =
      (slopes * numbers.covariance * slopes.transpose()).diagonal().cwiseMax(0).cwiseSqrt();
  for (Eigen::Index i = 0; i < sigmas_D.size(); ++i)
    if (!slopes.row(i).allFinite()) sigmas_D[i] = std::numeric_limits<double>::quiet_NaN();
  if (std::isnan(sigmas_D[0]) && placing != holladay_eye)
    sigmas_D[0] = iol_sigmas_D(measured, ray_traced_D, holladay_eye, settings, what_if)[0];
  return sigmas_D;
}

Json iol_json(const EyeModel& eye, const PrescriptionSettings& settings, const WhatIfSettings& what_if,
              const UncertainOptics* measured) {
  constexpr double vertex_mm = 12;
  const IolBiometry biometry =
      iol_biometry(eye, measured ? measured->known.eye().axial_length_mm : eye.axial_length_mm());
  const IolEye placing = placing_formula(biometry, what_if.iol_a_constant);
  const double position_mm = placing(biometry, what_if.iol_a_constant).lens_mm,
               target_at_cornea_D = move_towards_eye({what_if.iol_target_D, 0, 0}, vertex_mm).M_D;
  const double ray_traced_D = ray_traced_iol_D(with_pupil(eye, settings.pupil_mm), position_mm,
                                               target_at_cornea_D, settings.wavelength_nm, settings.fovea_mm);
  const Eigen::VectorXd powers_D = iol_powers_D([&] { return ray_traced_D; }, biometry, what_if);
  Eigen::VectorXd sigmas_D;
  if (measured) sigmas_D = iol_sigmas_D(*measured, ray_traced_D, placing, settings, what_if);
  Json json{{"target_M_D", what_if.iol_target_D},
            {"target_vertex_distance_mm", vertex_mm},
            {"a_constant", what_if.iol_a_constant},
            {"axial_length_mm", biometry.axial_length_mm},
            {"keratometry_D", biometry.keratometry_D},
            {"anterior_chamber_depth_mm", biometry.anterior_chamber_depth_mm},
            {"position_mm", position_mm}};
  for (Eigen::Index i = 0; i < powers_D.size(); ++i) {
    const std::string method = iol_method(static_cast<std::size_t>(i));
    if (!std::isfinite(powers_D[i])) continue;
    json[method + "_D"] = powers_D[i];
    if (measured && std::isfinite(sigmas_D[i]))
      json[method + "_ci95_D"] = Measured::from_sigma(powers_D[i], sigmas_D[i], "").ci95;
  }
  if (!json.contains("srkt_D"))
    json["srkt_reason"] =
        "SRK/T has no corneal height for this length and keratometry; the implant is put where "
        "Holladay's formula expects it";
  return json;
}

/// Root mean square of the aberrations over the ablation's zone.
Json zone_rms_json(const EyeModel& eye, const PrescriptionSettings& settings, const OpticalZone& zone) {
  raytrace::WavefrontSettings over_zone;
  over_zone.wavelength_nm = settings.wavelength_nm;
  over_zone.fovea_mm = settings.fovea_mm;
  over_zone.entrance_pupil_mm = zone.diameter_mm;
  const raytrace::Wavefront wavefront = raytrace::measure_wavefront(eye, over_zone);
  return {{"all_um", wavefront.rms_um()}, {"higher_order_um", wavefront.higher_order_rms_um()}};
}

Json ablation_json(const EyeModel& eye, const PrescriptionSettings& settings,
                   const AblationProfile& profile) {
  PrescriptionSettings at_cornea = settings;
  at_cornea.vertex_distance_mm = 0;
  const EyeModel operated = with_ablation(eye, profile);
  const PowerVector left = refraction_by_spot(operated, at_cornea);
  return {{"optical_zone_mm", profile.zone().diameter_mm},
          {"centre_mm", {profile.zone().centre_mm.x(), profile.zone().centre_mm.y()}},
          {"central_depth_um", profile.central_depth_um()},
          {"deepest_um", profile.deepest_um()},
          {"residual", {{"M_D", left.M_D}, {"J0_D", left.J0_D}, {"J45_D", left.J45_D}}},
          {"zone_rms_before", zone_rms_json(eye, settings, profile.zone())},
          {"zone_rms", zone_rms_json(operated, settings, profile.zone())}};
}

}  // namespace

Json what_if_json(const EyeModel& eye, const PrescriptionSettings& settings, const PowerVector& refraction,
                  const WhatIfSettings& what_if, const UncertainOptics* measured) {
  const PowerVector at_cornea = move_towards_eye(refraction, settings.vertex_distance_mm);
  Json json;
  json["pupil"] = pupil_json(eye, settings);
  if (what_if.age_years)
    json["accommodation"] = has_lens(eye) ? accommodation_json(at_cornea, settings, refraction,
                                                               *what_if.age_years, what_if.accommodation_D)
                                          : Json{{"reason", "an eye without a lens does not accommodate"}};
  const auto or_reason = [](const std::function<Json()>& what) -> Json {
    try {
      return what();
    } catch (const Error& error) {
      return {{"reason", error.what()}};
    }
  };
  json["intra_ocular_lens"] = or_reason([&] { return iol_json(eye, settings, what_if, measured); });
  json["ablation"] =
      or_reason([&] { return ablation_json(eye, settings, munnerlyn_profile(eye, at_cornea)); });
  json["wavefront_guided_ablation"] = or_reason([&] {
    return ablation_json(eye, settings,
                         wavefront_guided_profile(eye, settings.wavelength_nm, settings.fovea_mm));
  });
  return json;
}

/// A vergence that is none: further than a kilometre.
constexpr double none_D = 1e-3;

double near_point_mm(double at_cornea_D, double amplitude_D) {
  const double vergence_D = at_cornea_D - amplitude_D;  // of light that the eye then focuses, at the cornea
  return std::abs(vergence_D) < none_D ? std::numeric_limits<double>::infinity() : -1e3 / vergence_D;
}

double near_point_with_lens_mm(const PowerVector& at_cornea, double amplitude_D, const PowerVector& lens,
                               double vertex_mm) {
  // Each meridian moves by its own power: the mean of what has moved is not the mean, moved.
  PowerVector accommodated = at_cornea;
  accommodated.M_D -= amplitude_D;
  const double before_lens_D = move_towards_eye(accommodated, -vertex_mm).M_D - lens.M_D;
  return std::abs(before_lens_D) < none_D ? std::numeric_limits<double>::infinity()
                                          : vertex_mm - 1e3 / before_lens_D;
}

EyeModel with_iol(EyeModel eye, double power_D, double position_mm) {
  const double radius_mm = std::abs(power_D) < 1e-6 ? 1e9 : iol_radius_mm(power_D);
  Surface& front = eye.surface("lens_anterior");
  Surface& back = eye.surface("lens_posterior");
  for (Surface* face : {&front, &back}) {
    face->tilt_deg.setZero();
    face->decentre_mm.setZero();
    face->semi_diameter_mm = 0;
    face->shape = make_sphere(face == &front ? radius_mm : -radius_mm);
    face->position_mm = position_mm + (face == &front ? -1 : 1) * iol_thickness_mm / 2;
  }
  front.medium_after = "iol";
  eye.media["iol"] = Medium{iol_index, {}, {}};
  // Whatever the natural lens had inside goes with it.
  const auto named = [&](const char* name) {
    return std::find_if(eye.surfaces.begin(), eye.surfaces.end(),
                        [&](const Surface& surface) { return surface.name == name; });
  };
  eye.surfaces.erase(named("lens_anterior") + 1, named("lens_posterior"));
  for (Surface& surface : eye.surfaces)
    if (surface.is_stop())
      surface.position_mm = std::min(surface.position_mm, position_mm - iol_thickness_mm);
  return eye;
}

double ray_traced_iol_D(const EyeModel& eye, double position_mm, double target_at_cornea_D,
                        double wavelength_nm, const Eigen::Vector2d& fovea_mm) {
  const auto error_D = [&](double power_D) {
    return mean_refraction_at_cornea_D(with_iol(eye, power_D, position_mm), wavelength_nm, fovea_mm) -
           target_at_cornea_D;
  };
  double low_D = -10, high_D = 50;  // more power makes the eye more myopic
  if (!(error_D(low_D) > 0 && error_D(high_D) < 0))
    throw no_result_error("no intra-ocular lens from -10 to +50 D gives the target refraction");
  while (high_D - low_D > 1e-4) {
    const double middle_D = (low_D + high_D) / 2;
    (error_D(middle_D) > 0 ? low_D : high_D) = middle_D;
  }
  return (low_D + high_D) / 2;
}

}  // namespace emmetrope::correction
