#include "pipeline/driver/stale_results.hpp"

#include "pipeline/base/error.hpp"

namespace emmetrope::driver {

void remove_stale_results(const std::filesystem::path& case_folder, const std::string& stage_folder) {
  std::error_code fault;
  std::filesystem::remove_all(case_folder / stage_folder, fault);
  if (fault)
    throw output_error("cannot remove the outdated " + (case_folder / stage_folder).string() + ": " +
                       fault.message());
}

}  // namespace emmetrope::driver
