#pragma once
#include <string>
#include <vector>

#include "pipeline/cohort/results/cohort_rows.hpp"

namespace emmetrope::cohort {

/// cohort.html: what came of the eyes, why others gave nothing (with a picture of each reason), distributions against
/// normal ranges, left against right, length against age and refraction, eyes that lie far from the others.
std::string cohort_page(const CohortFolder& cohort, const std::vector<EyeRow>& rows);

}  // namespace emmetrope::cohort
