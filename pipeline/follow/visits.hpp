#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/follow/growth.hpp"
#include "pipeline/report/case/case_data.hpp"

namespace emmetrope::follow {

/// The visits of one person.
struct Visits {
  std::vector<report::CaseData> cases;
  std::vector<std::string> dates;  ///< YYYY-MM-DD; empty where nobody knows
  /// Since the first visit; without dates of two visits 0 and 1, and `are_dated` is false.
  std::vector<double> years;
  bool are_dated = false;
  std::vector<std::string> remarks;  ///< whether they are of one person
  std::vector<std::string> doubts;   ///< what speaks against these visits, to be warned of
};

/// \param years  as in FollowOptions
/// \throw Error as run_follow
Visits read_visits(const std::vector<std::filesystem::path>& cases, const std::vector<double>& years,
                   LateralityChoice eyes);

/// The eye whose parameters are known but for the part of their errors that every fit to such images has: it is in every
/// visit, and in no growth.
/// \param shared  covariance of that part, by two parameters' names, as in fit.json
/// \throw Error (input_invalid) where it is more than the eye's, or of a parameter that the eye has not
ParametricEye without_shared_error(ParametricEye eye, const Json& shared);

/// An eye at every visit, or in `reason` why it cannot be followed.
struct EyeAtVisits {
  std::vector<EyeAtVisit> eyes;
  std::string reason;
  std::vector<std::string> doubts;  ///< what its growth is to be warned of
};
/// Where all were fitted to one contrast at one field, without the error that these share, if every visit tells it.
/// \throw Error (input_invalid) naming file and key where a fit.json is broken
EyeAtVisits eye_at_visits(const Visits& visits, Laterality eye);

/// Why an eye that is followed has no growth of its cornea: at which visit it is withheld. Empty: it has one.
std::string why_cornea_is_withheld(const Visits& visits, Laterality eye);

/// A sentence on each visit to whose meshing other instruments told something of the eye: growth is of the fits alone.
/// \throw Error (input_invalid) naming a file that is broken
std::vector<std::string> unused_readings(const Visits& visits, Laterality eye);

}  // namespace emmetrope::follow
