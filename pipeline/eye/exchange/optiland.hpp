#pragma once
#include <string>

#include "pipeline/base/json.hpp"
#include "pipeline/eye/model/eye_model.hpp"

namespace emmetrope {

/// Whether a text is a lens as Optiland saves it, visisipy's eyes too.
bool is_optiland(const std::string& text);

/// Planes, spheres and conics, ideal and Abbe media; the image is the retina.
/// \throw Error (input_invalid) naming the surface; (unsupported) naming what of the format eyes have no use for
EyeModel eye_from_optiland(const Json& json);

/// The text as JSON: Python writes what is infinite as a bare word that JSON does not know; it becomes null.
std::string without_infinities(std::string text);

}  // namespace emmetrope
