#pragma once

/// Powers of intra-ocular lenses by the published thin-lens formulas. All are one vergence calculation,
///   P = 1336/(L - d) - 1336/(1336/(K + R) - d),
/// with R the target refraction at the cornea; they differ in the eye's length L, the lens's expected
/// position d and the power K of the cornea. Barrett's formula is not published and not here. All constants
/// are those that biometers' manuals print (Tomey UD-800, "IOL power calculation formula"; Haigis' own page
/// for his).
namespace emmetrope::correction {

/// What a biometer reports.
struct IolBiometry {
  double axial_length_mm = 0;
  double keratometry_D = 0;              ///< mean, keratometric index 1.3375
  double anterior_chamber_depth_mm = 0;  ///< cornea included; Haigis' formula alone needs it
};

/// What a formula makes of it.
struct ThinLensEye {
  double length_mm = 0, lens_mm = 0;  ///< to the retina and to the lens, behind the cornea
  double cornea_D = 0;
};

/// \param a_constant  of the lens, SRK's; the formulas' own constants follow from it as their authors say
/// \throw Error (no_result) where a formula has no corneal height
///
/// SRK/T: Retzlaff, Sanders and Kraff 1990. The correction of lengths above 24.2 mm has the coefficient 1.716
/// of the paper, of Aramberri (2003) and of biometers' manuals; some programs carry 1.715, which shortens the
/// corrected length by 0.025 mm at 25 mm.
ThinLensEye srkt_eye(const IolBiometry& biometry, double a_constant);
/// Holladay, Prager, Chandler and Musgrove 1988; surgeon factor 0.5663 A - 65.60.
ThinLensEye holladay_eye(const IolBiometry& biometry, double a_constant);
/// Hoffer 1993 with its errata; pACD = 0.58357 A - 63.896.
ThinLensEye hoffer_q_eye(const IolBiometry& biometry, double a_constant);
/// Haigis, in Shammas 2004: a1 = 0.4, a2 = 0.1, a0 from A by the means 3.37 and 23.39 mm; not optimised for
/// the lens it gives about a dioptre more than the others.
ThinLensEye haigis_eye(const IolBiometry& biometry, double a_constant);

/// The lens's power for a target refraction 12 mm before the cornea.
double iol_power_D(const ThinLensEye& eye, double target_D);

}  // namespace emmetrope::correction
