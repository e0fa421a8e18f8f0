#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "pipeline/eye/model/eye_model.hpp"

/// Sequential lenses of Zemax OpticStudio (.zmx), the part of the format that eyes need: STANDARD, BICONICX, SZERNSAG
/// and GRINSUR3 surfaces, COORDBRK, the stop, circular apertures, model glasses and glass catalogues (.agf) beside the
/// file. Written from the program's published documentation.
namespace emmetrope {

/// \throw Error (input_invalid) naming file and line; (unsupported) naming what of the format eyes have no use for
EyeModel read_zmx(const std::filesystem::path& file);

/// The same name, .agf.
std::filesystem::path glass_catalogue_beside(std::filesystem::path zmx);

/// Writes the lens and, beside it, its glass catalogue.
/// \return what the format could not hold exactly, one sentence each
/// \throw Error (unsupported) for a gradient that Zemax's Gradient 3 cannot hold; (not_writable), also where a catalogue
///   stands in the way that this did not write
std::vector<std::string> write_zmx(const std::filesystem::path& file, const EyeModel& eye);

}  // namespace emmetrope
