#include "pipeline/cohort/results/cohort_results.hpp"

#include "pipeline/base/files.hpp"
#include "pipeline/cohort/results/cohort_page.hpp"

namespace emmetrope::cohort {

void write_results(const CohortFolder& cohort, const std::vector<EyeRow>& rows,
                   const std::filesystem::path& folder) {
  write_json(folder / "cohort.json", table_dictionary());
  write_file(folder / "cohort.html", cohort_page(cohort, rows, folder));
  write_file(folder / "cohort.tsv", table_text(rows));
}

}  // namespace emmetrope::cohort
