#pragma once
#include <optional>
#include <vector>

#include "pipeline/base/progress.hpp"
#include "segmentation/judgement/judged_eye.hpp"

namespace emmetrope::segmentation {

/// Looks once more at two eyes that were fitted to the intensities of the same stacks, in the same order. An eye of which
/// less is known than of its fellow is fitted again from what its fellow is like, and taken where more is known by it.
/// Where the two find fat displaced differently, have chambers of other depths or look up and down apart, each is fitted
/// again from the other; of the pairs, old and new, that agree, the likeliest is taken. Where none does, both lose what
/// they contradict each other in, the fit or the front: one took something else for it, and which is not known. Not for
/// eyes that were fitted to labels.
/// \param stacks   of the study, as FoundEye counts them
/// \param threads  at most; the result does not depend on them
void compare_fellow_eyes(JudgedEye& od, JudgedEye& os, const std::vector<const Stack*>& stacks,
                         std::optional<double> age_years, int threads, Verbosity verbosity);

/// The fits of two eyes.
struct FellowPair {
  const JudgedEye *od, *os;
};
/// Every right one with every left one.
std::vector<FellowPair> all_pairs(const std::vector<const JudgedEye*>& od,
                                  const std::vector<const JudgedEye*>& os);

/// A pair that is taken, and the likeliest of those that agree, too, but have an eye's chamber elsewhere.
struct LikeliestPair {
  FellowPair pair;
  std::optional<FellowPair> rival;
  /// That of its chambers in the population over that of both pairs', of one chamber for each, as those of a person are
  /// about one number; how well the pairs explain the images is not in it.
  double rivals_probability;
};

/// Of pairs of fits that agree and are as good as the old ones (nothing more is withheld, and their residuals are 1.15
/// times as large at most, each among its own voxels) that with the smallest residuals against the old ones; where these
/// had chambers of different depths, of those with the likeliest chambers, and with a rival where there is one.
/// \param od, os  the old fits
std::optional<LikeliestPair> likeliest_agreeing(const JudgedEye& od, const JudgedEye& os,
                                                const std::vector<FellowPair>& pairs);

/// What two eyes tell of each other in the end: fronts that stand are coupled, intervals reach to a rival, which is coupled
/// to the fellow's as well, and where globes are not equally wide or high, the intervals of both reach to the other (fits to
/// intensities).
/// \return whether they were coupled (`couple_eyes`)
bool couple_fellow_eyes(JudgedEye& od, JudgedEye& os);

}  // namespace emmetrope::segmentation
