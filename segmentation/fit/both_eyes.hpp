#pragma once
#include "segmentation/fit/eye_fit.hpp"

namespace emmetrope::segmentation {

/// How far the eyes of one person differ: standard deviations of the differences (sources:
/// docs/method/segmentation.md, "Priors").
inline constexpr double corneal_power_difference_D = 0.7;
inline constexpr double axial_length_difference_mm = 0.5, chamber_depth_difference_mm = 0.15,
                        lens_thickness_difference_mm = 0.15, corneal_thickness_difference_mm = 0.02,
                        lid_thickness_difference_mm = 0.2;
// In one and the same stack: of the logarithm of a tissue's brightness over that of the aqueous, of the
// logarithm of the sharpness, and of the chemical shift of fat.
inline constexpr double tissue_intensity_difference = 0.05, lid_intensity_difference = 0.1;
inline constexpr double sharpness_difference = 0.01, fat_shift_difference_mm = 0.01;

/// Tells each eye what the other one's images say of it. The fits took the eyes as strangers with the
/// population's mean corneal curvature and spread; here that prior becomes one of two eyes whose difference
/// is known, with the same spread of each eye alone. Eyes, chambers, lenses, corneas and lids are equally
/// long, deep and thick but for the differences above; where both eyes were fitted to the same stacks, their
/// tissues are also equally bright against the aqueous, and the stacks equally sharp with fat equally
/// displaced. What images of one contrast err by alike (EyeFit::shared_covariance), or those of any
/// (EyeFit::common_covariance), tells neither eye anything of the other and stays as it is. Each of these
/// counts where the eyes agree with it within three standard deviations. Exact for normal distributions; every
/// parameter follows what is shared by its regression on it.
/// \return false, and nothing is changed, where the corneal powers differ by more than three standard
///   deviations of what prior and images allow, or a cornea is irregular: a graft, a keratoconus
bool couple_eyes(EyeFit& od, EyeFit& os);

}  // namespace emmetrope::segmentation
