#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "pipeline/base/command_line.hpp"

namespace emmetrope::cohort {

struct BidsOptions {
  std::filesystem::path dataset, output;
  std::string level;                                ///< "participant" or "group"
  std::vector<std::string> participants, sessions;  ///< labels with or without "sub-" and "ses-"; empty: all
};

/// The convention of BIDS Apps (Gorgolewski et al. 2017): `participant` measures one participant after another into the
/// dataset of derivatives OUT (several such jobs may share it), `group` makes cohort.tsv and cohort.html of what is in
/// OUT, without the images.
/// \return done also where eyes gave less, as engines throw away what a job leaves that ends otherwise: the outcome is
///   in the rows; fault where a stage failed for want of memory, disk or device
/// \throw Error (input_invalid) where it is no BIDS dataset or has no such participant or session
Answer run_bids(const BidsOptions& options, const CommonOptions& common);

}  // namespace emmetrope::cohort
