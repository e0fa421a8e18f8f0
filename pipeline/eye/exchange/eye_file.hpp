#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "pipeline/eye/model/eye_model.hpp"

namespace emmetrope {

/// An eye from a file of any kind: eye.json, a lens of Zemax (.zmx), of Optiland or visisipy (their JSON).
/// \throw Error (input_invalid, unsupported) naming the file
EyeModel read_eye_file(const std::filesystem::path& file);

struct WrittenEye {
  std::vector<std::filesystem::path> files;
  std::vector<std::string> notes;  ///< what the format could not hold exactly, one sentence each
  std::string warning;             ///< that what was written is another eye, by how many dioptres; or empty
};
/// Writes a lens of Zemax where the file ends so, else an eye.json.
/// \throw Error as write_zmx()
WrittenEye write_eye_file(const std::filesystem::path& file, const EyeModel& eye);

}  // namespace emmetrope
