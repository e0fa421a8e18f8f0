#pragma once
#include <filesystem>

#include "segmentation/intake/wire.hpp"

class DcmFileFormat;

namespace emmetrope::segmentation {

/// Parses one file as far as it goes and picks the attributes of tags.hpp. Pixels stay in the file.
/// Runs in the decoding process: DCMTK may crash or hang on hostile files.
/// \param request  of a header alone the attributes of the study are picked too
ImageHeader read_header(const std::filesystem::path& file, DcmFileFormat& parsed, Request request);

}  // namespace emmetrope::segmentation
