#pragma once
#include <string>

#include "pipeline/report/case/case_data.hpp"

namespace emmetrope::report {

/// What the correction stage has learnt of an eye since it was traced: the prescription is of that eye, wavefront and
/// pictures without a lens are of the traced one.
enum class Learnt { nothing, refraction, readings };
Learnt learnt_since_traced(const EyeData& eye);

/// What an eye's meshes tell, for a sentence: what "the images alone" say, or "images and other instruments", where mesh
/// was given readings.
std::string meshed_from(const CaseData& data, const EyeData& eye);
/// What a refraction that was given is combined with: that, and readings that the correction stage was given.
std::string combined_with(const CaseData& data, const EyeData& eye);

}  // namespace emmetrope::report
