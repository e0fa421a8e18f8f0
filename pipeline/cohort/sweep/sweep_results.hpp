#pragma once
#include <string>
#include <vector>

#include "pipeline/cohort/sweep/sweep_run.hpp"

namespace emmetrope::cohort {

struct SweepResults {
  std::string text;
  /// Why columns that the sweep asks for are not in it, one sentence each.
  std::vector<std::string> faults;
};

/// A row a run: name, status, message, the settings that vary, every number of the result by its keys
/// ("entrance_pupil_diameter_mm"; of a measured one its interval too), the columns that the sweep asks for. Lists are
/// left out but for these.
/// \param names  of the runs, in their order
/// \throw Error (input_invalid) naming an end that is broken
SweepResults sweep_table(const Sweep& sweep, const SweepFolder& folder,
                         const std::vector<std::string>& names);

}  // namespace emmetrope::cohort
