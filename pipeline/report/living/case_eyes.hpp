#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "pipeline/report/case/case_data.hpp"

namespace emmetrope::report {

/// The eyes of a case for the page.
struct CaseEyes {
  std::vector<Json> eyes;               ///< living_json() of each that can be shown
  std::vector<std::string> notes;       ///< how near each map comes; why an eye is missing
  std::vector<std::string> not_traced;  ///< those of the notes that tell of an eye that was not traced
};

/// Maps of the eyes as they were traced, with the lenses that were found for them.
CaseEyes living_eyes_of(const CaseData& data, int threads, std::uint64_t seed);

}  // namespace emmetrope::report
