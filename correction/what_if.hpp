#pragma once
#include <optional>

#include "correction/prescription.hpp"
#include "pipeline/base/json.hpp"
#include "pipeline/base/power_vector.hpp"
#include "raytrace/eye/eye_model.hpp"

/// What would change the refraction: pupil, accommodation, an intra-ocular lens, an ablation. All on the eye
/// as it is traced, by the least-squares fit of ray slopes.
namespace emmetrope::correction {

/// Amplitude of accommodation at an age, D; Hofstetter (1950): average 18.5 - 0.30 age, minimum 15 - 0.25
/// age; not below 0.
struct Amplitude {
  double average_D = 0, minimum_D = 0;
};
Amplitude accommodation_amplitude(double age_years);

/// Nearest distance of clear sight in front of the cornea, mm, with that amplitude; infinity or negative
/// (behind the eye) where none is. \param at_cornea_D  mean refraction at the corneal vertex
double near_point_mm(double at_cornea_D, double amplitude_D);
/// The same through a lens of back vertex power lens_D at vertex_mm, distance from the lens.
double near_point_with_lens_mm(double at_cornea_D, double amplitude_D, double lens_D, double vertex_mm);

/// IOL power for a target refraction at 12 mm by SRK/T (Retzlaff, Sanders and Kraff 1990, with their
/// erratum). \param axial_length_mm  optical; \param keratometry_D  mean, keratometric index 1.3375
double srkt_power_D(double axial_length_mm, double keratometry_D, double a_constant, double target_D);
/// Where SRK/T expects the lens, mm behind the corneal vertex.
double srkt_lens_position_mm(double axial_length_mm, double keratometry_D, double a_constant);

/// A symmetric biconvex IOL of index 1.46, 0.8 mm thick.
/// \param position_mm  its middle behind the corneal vertex
EyeModel with_iol(EyeModel eye, double power_D, double position_mm);
/// Power of that IOL that gives the eye `target` mean refraction at the corneal vertex, by ray tracing.
/// \throw Error (no_result) when no power from -10 to 50 D does
double ray_traced_iol_D(const EyeModel& eye, double position_mm, double target_at_cornea_D,
                        double wavelength_nm);

/// A Munnerlyn ablation (Munnerlyn, Koons and Marshall 1988): the front cornea becomes the surface whose
/// curvature takes `correction` away, inside the optical zone. \param correction  at the corneal vertex The
/// new front is a biconic with the old asphericity.
EyeModel with_ablation(EyeModel eye, const PowerVector& correction);
/// Depth that it takes off at the centre: t = R1 (1 - ...) exactly, about zone^2 |D| / 3 in um for myopia.
double munnerlyn_depth_um(double radius_mm, double correction_D, double zone_mm, double index = 1.376);

/// All of it for one eye, as prescription.json's "what_if": refraction against pupil, near point by age
/// (where an age is given), the IOL for emmetropia by rays and by SRK/T, and what an ablation of this
/// refraction would leave. \param refraction  at the settings' vertex distance
Json what_if_json(const EyeModel& eye, const PrescriptionSettings& settings, const PowerVector& refraction,
                  std::optional<double> age_years);

}  // namespace emmetrope::correction
