#pragma once
#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "raytrace/picture/linear_image.hpp"

/// Pictures as files of linear floats; whole or not at all.
namespace emmetrope::raytrace {

/// What a file says of its pixels beside their values.
struct PixelNotes {
  std::optional<Eigen::Vector2d> pitch_um;  ///< on the retina, across and down
  std::string unit;
  std::vector<double> wavelength_nm;  ///< of each page or channel of a spectral picture
};

/// TIFF, uncompressed, a page a picture: pitch as XResolution and YResolution in pixels a centimetre, unit and
/// wavelength as JSON in ImageDescription.
void write_tiff(const std::filesystem::path& file, const LinearImage& image, const PixelNotes& notes = {});
void write_tiff_pages(const std::filesystem::path& file, const std::vector<LinearImage>& images,
                      const PixelNotes& notes = {});

/// OpenEXR of a grey or coloured picture.
void write_exr(const std::filesystem::path& file, const LinearImage& image);
/// OpenEXR in the spectral layout of Fichet, Pacanowski and Wilkie (Journal of Computer Graphics Techniques 10(3), 2021):
/// a channel "S0.550,000000nm" a wavelength, the unit as `emissiveUnits`; pitch as xDensity in pixels an inch.
/// \param bands  of one channel each
void write_spectral_exr(const std::filesystem::path& file, const std::vector<LinearImage>& bands,
                        const PixelNotes& notes);

}  // namespace emmetrope::raytrace
