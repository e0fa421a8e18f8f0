#pragma once
#include <filesystem>
#include <string>

#include "pipeline/cohort/subjects/cohort_folder.hpp"
#include "pipeline/cohort/subjects/subjects.hpp"

namespace emmetrope::cohort {

/// OUT of a BIDS App: a dataset of derivatives (BIDS 1.10), with the cases in a folder that BIDS does not look at.
/// - dataset_description.json, README, .bidsignore, eyes.json (what the columns of the *_eyes.tsv are)
/// - sub-X/[ses-Y/]anat/*_seg-eyes_dseg.nii.gz .json .tsv: the tissues at every voxel of an image that was fitted
/// - sub-X/[ses-Y/]anat/sub-X[_ses-Y]_eyes.tsv: the two rows of cohort.tsv; sub-X[_ses-Y].html: the report
class Derivatives {
 public:
  explicit Derivatives(std::filesystem::path root) : root_(std::move(root)) {}
  const std::filesystem::path& root() const { return root_; }
  CohortFolder cohort() const { return CohortFolder(root_ / "emmetrope"); }

  /// What describes the dataset; files that hold it already stay, as many jobs may write into one dataset.
  /// \param dataset  where the images come from
  void describe(const std::filesystem::path& dataset) const;
  /// Puts what the case holds where BIDS wants it, in place of what an earlier run put there.
  /// \throw Error (not_writable), (input_invalid) naming a file of the case that is broken
  void publish(const Subject& subject, const std::filesystem::path& dataset) const;

 private:
  std::filesystem::path root_;
};

/// "sub-01_acq-hi_seg-eyes_dseg" of "sub-01_acq-hi_T1w.nii.gz"; with `space`, as which images of one name and two
/// contrasts differ, "sub-01_acq-hi_space-T1w_seg-eyes_dseg".
std::string label_name(const std::string& image, bool with_space);

}  // namespace emmetrope::cohort
