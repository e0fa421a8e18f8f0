#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <OpenEXR/ImfStdIO.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "raytrace/picture/float_files.hpp"

namespace emmetrope::raytrace {
namespace {

/// A file in the making: its header, and where each channel's floats lie.
class ExrFile {
 public:
  ExrFile(int width, int height) : header_(width, height) {}

  Imf::Header& header() { return header_; }
  void add(const std::string& channel, const LinearImage& image, int offset) {
    const std::size_t step = sizeof(float) * image.channels;
    // OpenEXR takes what it reads as it takes what it writes: not const.
    auto* floats = const_cast<float*>(image.values.data()) + offset;
    header_.channels().insert(channel, Imf::Channel(Imf::FLOAT));
    pixels_.insert(channel,
                   Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(floats), step, step * image.width));
    height_ = image.height;
  }
  void write(const std::filesystem::path& file) {
    Imf::StdOSStream bytes;
    try {
      Imf::OutputFile exr(bytes, header_);
      exr.setFrameBuffer(pixels_);
      exr.writePixels(height_);
    } catch (const std::exception& fault) {
      throw Error(ExitStatus::fault, "cannot encode " + file.string() + ": " + fault.what());
    }
    write_file(file, bytes.str());
  }

 private:
  Imf::Header header_;
  Imf::FrameBuffer pixels_;
  int height_ = 0;
};

/// The layout has a comma, as a point would make a layer of what stands before it.
std::string channel_of(double wavelength_nm) {
  std::string name = fmt::format("S0.{:.6f}nm", wavelength_nm);
  std::replace(name.begin() + 3, name.end(), '.', ',');
  return name;
}

}  // namespace

void write_exr(const std::filesystem::path& file, const LinearImage& image) {
  ExrFile exr(image.width, image.height);
  const std::string_view names = image.channels == 1 ? "Y" : "RGBA";
  for (int c = 0; c < image.channels; ++c) exr.add(std::string(1, names[c]), image, c);
  exr.write(file);
}

void write_spectral_exr(const std::filesystem::path& file, const std::vector<LinearImage>& bands,
                        const PixelNotes& notes) {
  constexpr double um_an_inch = 25400;
  const LinearImage& first = bands.at(0);
  ExrFile exr(first.width, first.height);
  exr.header().insert("spectralLayoutVersion", Imf::StringAttribute("1.0"));
  exr.header().insert("emissiveUnits", Imf::StringAttribute(notes.unit));
  if (notes.pitch_um) {
    addXDensity(exr.header(), static_cast<float>(um_an_inch / notes.pitch_um->x()));
    exr.header().pixelAspectRatio() = static_cast<float>(notes.pitch_um->x() / notes.pitch_um->y());
  }
  for (std::size_t k = 0; k < bands.size(); ++k) exr.add(channel_of(notes.wavelength_nm.at(k)), bands[k], 0);
  exr.write(file);
}

}  // namespace emmetrope::raytrace
