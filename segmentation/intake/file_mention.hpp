#pragma once
#include <filesystem>
#include <string>

/// Files in messages. A file's name may be the patient's, so a message about a file holds two names for it:
/// the file's own for the terminal, where it is needed to find the file, and one that tells nothing for what
/// a case keeps.
namespace emmetrope::segmentation {

/// \param neutral  what the record calls it: "slice 12"
std::string mention(const std::filesystem::path& file, const std::string& neutral);

/// The message for the terminal: "scan/Doe_012.dcm: ...".
std::string with_file_names(const std::string& message);
/// The message for the record: "slice 12: ...".
std::string without_file_names(const std::string& message);

}  // namespace emmetrope::segmentation
