#pragma once
#include <filesystem>
#include <string>

#include "pipeline/base/command_line.hpp"
#include "pipeline/pacs/archive.hpp"

namespace emmetrope::pacs {

struct PacsOptions {
  std::string action;  ///< "pull" or "push"
  std::filesystem::path settings;
  std::filesystem::path case_folder;  ///< push
  std::filesystem::path output;       ///< pull
  StudyQuery query;                   ///< pull
};

/// pull: the MR images of the one study that the query finds, into a new folder, all of them or none; none where one of
/// them is another patient's.
/// push: the DICOM objects of a case's report.
/// \throw Error (usage), (input_invalid) where no study or more than one is found, naming them without their patients;
///   as Archive
Answer run_pacs(const PacsOptions& options, const CommonOptions& common);

}  // namespace emmetrope::pacs
