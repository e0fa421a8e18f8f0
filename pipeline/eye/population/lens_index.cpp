#include "pipeline/eye/population/population.hpp"

namespace emmetrope {

double lens_index_at_age(double age_years) { return 1.441 - 0.00039 * age_years; }

}  // namespace emmetrope
