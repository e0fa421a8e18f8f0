#pragma once
#include <functional>
#include <vector>

#include "segmentation/fit/eye_fit.hpp"

namespace emmetrope::segmentation {

/// Fits one eye (fit_eye). Where something lies in its vitreous that is none, a tumour, blood or a detached retina, which
/// would draw the wall towards it, once more without those voxels and what lies within 2.5 mm of them.
///
/// No vitreous are voxels that touch each other, 2 mm inside the wall or more and 2.5 mm behind the lens, that each differ
/// from it, brighter in T1 and darker in T2, by more than 0.3 of the step to what surrounds the globe (T1) or to no signal
/// (T2) and by more than five standard deviations of the fit's noise and of the voxels there, and together by as much as
/// 12 mm3 of the whole step.
/// \return with what was left out (EyeFit::mass), and what no fit explains (EyeFit::unexplained)
/// \throw Error (no_result) as fit_eye
EyeFit fit_eye_beside_mass(const std::vector<const Stack*>& stacks, const EyeStart& start,
                           Weighting weighting, const std::function<void()>& advance = {},
                           Evidence evidence = Evidence::intensities);

/// Whether most of what a fit to other images found lies in the vitreous of this one, but for what the head moved between.
/// \param mass  not none
bool is_in_vitreous(const IntraocularMass& mass, const EyeFit& fit);

}  // namespace emmetrope::segmentation
