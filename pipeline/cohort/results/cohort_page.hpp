#pragma once
#include <string>
#include <vector>

#include "pipeline/cohort/results/cohort_rows.hpp"

namespace emmetrope::cohort {

/// cohort.html: what came of the eyes, why others gave nothing (with a picture of each reason), distributions against
/// normal ranges, left against right, length against age and refraction, eyes that lie far from the others, with links
/// to their reports.
/// \param page_folder  where the page will lie
std::string cohort_page(const CohortFolder& cohort, const std::vector<EyeRow>& rows,
                        const std::filesystem::path& page_folder);

}  // namespace emmetrope::cohort
