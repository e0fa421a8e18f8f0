#include <tiffio.h>

#include <algorithm>
#include <memory>

#include "pipeline/base/json.hpp"
#include "pipeline/base/write_beside.hpp"
#include "raytrace/picture/float_files.hpp"

namespace emmetrope::raytrace {
namespace {

using Tiff = std::unique_ptr<TIFF, decltype(&TIFFClose)>;

/// A classic TIFF counts bytes in 32 bits; little-endian on every machine.
const char* mode_of(const std::vector<LinearImage>& images) {
  constexpr double most_bytes = 4e9;
  double bytes = 0;
  for (const LinearImage& image : images) bytes += static_cast<double>(image.values.size() * sizeof(float));
  return bytes > most_bytes ? "wl8" : "wl";
}

std::string description_of(const PixelNotes& notes, std::size_t page) {
  Json about = Json::object();
  if (!notes.unit.empty()) about["unit"] = notes.unit;
  if (page < notes.wavelength_nm.size()) about["wavelength_nm"] = notes.wavelength_nm[page];
  if (notes.pitch_um) about["um_per_pixel"] = {notes.pitch_um->x(), notes.pitch_um->y()};
  return about.empty() ? "" : about.dump();
}

void describe(TIFF* tiff, const LinearImage& image, const PixelNotes& notes, std::size_t page) {
  constexpr double um_a_cm = 1e4;
  TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, image.width);
  TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, image.height);
  TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, 32);
  TIFFSetField(tiff, TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_IEEEFP);
  TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, image.channels);
  TIFFSetField(tiff, TIFFTAG_COMPRESSION, COMPRESSION_NONE);
  TIFFSetField(tiff, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
  TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, image.channels >= 3 ? PHOTOMETRIC_RGB : PHOTOMETRIC_MINISBLACK);
  if (const uint16_t cover = EXTRASAMPLE_UNASSALPHA; image.channels == 4)
    TIFFSetField(tiff, TIFFTAG_EXTRASAMPLES, 1, &cover);
  TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, TIFFDefaultStripSize(tiff, 0));
  if (notes.pitch_um) {
    TIFFSetField(tiff, TIFFTAG_RESOLUTIONUNIT, RESUNIT_CENTIMETER);
    TIFFSetField(tiff, TIFFTAG_XRESOLUTION, um_a_cm / notes.pitch_um->x());
    TIFFSetField(tiff, TIFFTAG_YRESOLUTION, um_a_cm / notes.pitch_um->y());
  }
  const std::string description = description_of(notes, page);
  if (!description.empty()) TIFFSetField(tiff, TIFFTAG_IMAGEDESCRIPTION, description.c_str());
}

bool put(TIFF* tiff, const LinearImage& image) {
  const std::size_t row_floats = static_cast<std::size_t>(image.width) * image.channels;
  std::vector<float> row(row_floats);  // libtiff asks for bytes that it may change
  for (int k = 0; k < image.height; ++k) {
    std::copy_n(image.values.begin() + static_cast<std::ptrdiff_t>(k * row_floats), row_floats, row.begin());
    if (TIFFWriteScanline(tiff, row.data(), k) != 1) return false;
  }
  return TIFFWriteDirectory(tiff) == 1;
}

}  // namespace

void write_tiff_pages(const std::filesystem::path& file, const std::vector<LinearImage>& images,
                      const PixelNotes& notes) {
  write_beside(file, [&](const std::filesystem::path& part) {
    const Tiff tiff(TIFFOpen(part.c_str(), mode_of(images)), &TIFFClose);
    bool written = tiff != nullptr;
    for (std::size_t page = 0; written && page < images.size(); ++page) {
      describe(tiff.get(), images[page], notes, page);
      written = put(tiff.get(), images[page]);
    }
    return written;
  });
}

void write_tiff(const std::filesystem::path& file, const LinearImage& image, const PixelNotes& notes) {
  write_tiff_pages(file, {image}, notes);
}

}  // namespace emmetrope::raytrace
