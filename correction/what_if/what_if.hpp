#pragma once
#include <optional>

#include "correction/prescription/prescription.hpp"
#include "pipeline/base/json.hpp"
#include "pipeline/base/power_vector.hpp"
#include "pipeline/eye/measured/uncertain_optics.hpp"
#include "pipeline/eye/model/eye_model.hpp"

/// What would change the refraction: pupil, accommodation, an intra-ocular lens, an ablation. All on the eye
/// as it is traced, by the least-squares fit of ray slopes.
namespace emmetrope::correction {

/// Nearest distance of clear sight in front of the cornea, mm, with that amplitude; infinity or negative
/// (behind the eye) where none is.
/// \param at_cornea_D  mean refraction at the corneal vertex
double near_point_mm(double at_cornea_D, double amplitude_D);
/// The same, also from the cornea, through a lens in front of it; each meridian is moved by its own power.
/// \param at_cornea  refraction at the corneal vertex
/// \param lens  its back vertex power, vertex_mm in front of the cornea
double near_point_with_lens_mm(const PowerVector& at_cornea, double amplitude_D, const PowerVector& lens,
                               double vertex_mm);

/// A symmetric biconvex IOL of index 1.46, 0.8 mm thick.
/// \param position_mm  its middle behind the corneal vertex
EyeModel with_iol(EyeModel eye, double power_D, double position_mm);
/// Power of that IOL that gives a point of the retina, from its pole, `target` mean refraction at the corneal vertex, by
/// ray tracing.
/// \throw Error (no_result) when no power from -10 to 50 D does
double ray_traced_iol_D(const EyeModel& eye, double position_mm, double target_at_cornea_D,
                        double wavelength_nm, const Eigen::Vector2d& fovea_mm = {0, 0});

struct WhatIfSettings {
  std::optional<double> age_years;  ///< for the near point
  double accommodation_D = 0;       ///< that the eye has taken up already, of its amplitude
  double iol_target_D = 0;          ///< refraction that an IOL is to leave, 12 mm before the cornea
  double iol_a_constant = 118.4;    ///< of the IOL, for the formulas and for its place
};

/// All of it for one eye, as prescription.json's "what_if": refraction against pupil, near point by age
/// (where an age is given), the IOL by rays and by four formulas, and what two ablations of this refraction
/// would leave.
/// \param refraction  at the settings' vertex distance
/// \param measured  what is known of the eye, where it was measured: its optical axial length is the formulas', and
///   the IOL's powers have intervals
Json what_if_json(const EyeModel& eye, const PrescriptionSettings& settings, const PowerVector& refraction,
                  const WhatIfSettings& what_if, const UncertainOptics* measured = nullptr);

}  // namespace emmetrope::correction
