#pragma once
#include <string>
#include <vector>

namespace emmetrope::report {

/// The works that a report cites, numbered from 1 in the order in which they are first cited.
class Citations {
 public:
  /// Number of what is cited by authors and year, as the table of limits does.
  /// \throw Error (fault) for a work that is not known
  int number_of(const std::string& authors_and_year);
  /// "1. Wei Q, ...": what has been cited so far.
  std::vector<std::string> list() const;

 private:
  std::vector<std::string> cited_;
};

}  // namespace emmetrope::report
