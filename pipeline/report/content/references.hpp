#pragma once
#include <string>
#include <vector>

namespace emmetrope::report {

/// The list of references, numbered from 1.
std::vector<std::string> numbered_references();

/// Number in that list of what is cited by authors and year, as the table of limits does.
/// \throw Error (fault) where the list does not hold it
int reference_number(const std::string& authors_and_year);

}  // namespace emmetrope::report
