#pragma once
#include <filesystem>
#include <memory>
#include <string>

#include "raytrace/scene/scene_model.hpp"

namespace emmetrope::raytrace {

/// Reads a PNG, JPEG or TIFF file as sRGB.
/// \throw Error (input_invalid) naming it
std::shared_ptr<const Texture> read_picture(const std::filesystem::path& file);
/// The same from its bytes.
/// \param name  what an error calls it
std::shared_ptr<const Texture> decode_picture(const std::string& bytes, const std::string& name);

/// Spectral radiance: a TIFF of floats with a page for every wavelength.
/// \throw Error (input_invalid) naming it
std::shared_ptr<const SpectralPicture> read_spectral_picture(const std::filesystem::path& file,
                                                             const std::vector<double>& wavelength_nm);

/// sRGB of a byte, 0 to 255, as linear light.
float linear_light(unsigned char value);

}  // namespace emmetrope::raytrace
