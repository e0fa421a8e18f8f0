#include "raytrace/irradiance_files.hpp"

#include <array>
#include <cmath>
#include <limits>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/population/population.hpp"
#include "raytrace/eye_picture.hpp"
#include "raytrace/mat_file.hpp"
#include "raytrace/picture/float_files.hpp"

namespace emmetrope::raytrace {
namespace {

namespace fs = std::filesystem;

constexpr std::array<const char*, 7> all_files{"irradiance.json",  "irradiance.tiff", "cones.tiff",
                                               "trolands.tiff",    "irradiance.exr",  "irradiance.mat",
                                               "optical-image.mat"};
constexpr const char* energy_unit = "W / (m^2 nm)";
constexpr const char* photon_unit = "photons / (s m^2 nm)";

/// What nobody sees is no number.
LinearImage with_unseen(LinearImage image, const std::vector<char>& unseen) {
  for (std::size_t i = 0; i < unseen.size() * image.channels; ++i)
    if (unseen[i / image.channels] != 0) image.values[i] = std::numeric_limits<float>::quiet_NaN();
  return image;
}

/// A pixel's size in the middle, where the eye sees there.
std::optional<Eigen::Vector2d> pair_of(const Json& scale, const char* key) {
  if (!scale[key][0].is_number() || !scale[key][1].is_number()) return std::nullopt;
  return Eigen::Vector2d(scale[key][0].get<double>(), scale[key][1].get<double>());
}

/// Times a factor; rows and columns of a picture's channel, column after column.
void append_columns(std::vector<float>& to, const LinearImage& image, int channel, double factor = 1) {
  for (int column = 0; column < image.width; ++column)
    for (int row = 0; row < image.height; ++row)
      to.push_back(static_cast<float>(factor * image.at(column, row, channel)));
}

MatVariable picture_variable(const std::string& name, const LinearImage& image) {
  std::vector<float> values;
  for (int c = 0; c < image.channels; ++c) append_columns(values, image, c);
  std::vector<std::size_t> size{static_cast<std::size_t>(image.height),
                                static_cast<std::size_t>(image.width)};
  if (image.channels > 1) size.push_back(image.channels);
  return {name, size, std::move(values)};
}

/// \param photons  of bands in W / (m^2 nm)
MatVariable spectral_variable(const std::string& name, const RetinalIrradiance& light, bool photons) {
  const LinearImage& first = light.irradiance.front();
  std::vector<float> values;
  values.reserve(first.values.size() * light.irradiance.size());
  for (std::size_t k = 0; k < light.irradiance.size(); ++k)
    append_columns(values, light.irradiance[k], 0, photons ? photons_per_joule(light.wavelength_nm[k]) : 1);
  return {name,
          {static_cast<std::size_t>(first.height), static_cast<std::size_t>(first.width),
           light.irradiance.size()},
          std::move(values)};
}

void write_irradiance_mat(const RetinalIrradiance& light, const Json& scale, bool photons,
                          const fs::path& file) {
  const std::size_t bands = light.wavelength_nm.size();
  std::vector<MatVariable> variables;
  variables.emplace_back("wavelength_nm", std::vector<std::size_t>{1, bands}, light.wavelength_nm);
  variables.emplace_back("transmittance", std::vector<std::size_t>{1, bands}, light.transmittance);
  variables.push_back(spectral_variable("irradiance", light, photons));
  variables.emplace_back("irradiance_unit", std::string(photons ? photon_unit : energy_unit));
  variables.push_back(picture_variable("cones", light.cones));
  variables.emplace_back("cones_unit", std::string("W / m^2"));
  variables.push_back(picture_variable("trolands", light.trolands));
  variables.emplace_back("pupil_area_mm2", light.pupil_area_mm2);
  for (const char* key : {"um_per_pixel", "arcmin_per_pixel"})
    if (const auto pair = pair_of(scale, key))
      variables.emplace_back(key, std::vector<std::size_t>{1, 2}, std::vector<double>{pair->x(), pair->y()});
  write_mat(file, variables);
}

/// isetbio knows square pixels on a plane behind a thin lens: its focal length is the retina's distance from the
/// image-side nodal point, by which a pixel's size and angle in the middle go together.
void write_optical_image(const RetinalIrradiance& light, const EyeModel& eye, const Json& scale,
                         const fs::path& file) {
  const auto um = pair_of(scale, "um_per_pixel"), arcmin = pair_of(scale, "arcmin_per_pixel");
  const double focal_mm = um->x() / 1000 / (arcmin->x() / 60 * degree);
  const double width_mm = um->x() / 1000 * light.irradiance.front().width;
  std::vector<MatVariable> optics, data, spectrum, oi;
  optics.emplace_back("type", std::string("optics"));
  optics.emplace_back("name", eye.name);
  optics.emplace_back("model", std::string("shiftinvariant"));
  optics.emplace_back("focalLength", focal_mm / 1000);
  optics.emplace_back("fNumber", focal_mm / std::sqrt(4 * light.pupil_area_mm2 / pi));
  data.push_back(spectral_variable("photons", light, true));
  spectrum.emplace_back("wave", std::vector<std::size_t>{light.wavelength_nm.size(), 1}, light.wavelength_nm);
  oi.emplace_back("type", std::string("opticalimage"));
  oi.emplace_back("name", eye.name);
  oi.emplace_back("data", std::move(data));
  oi.emplace_back("spectrum", std::move(spectrum));
  oi.emplace_back("optics", std::move(optics));
  oi.emplace_back("wAngular", 2 * std::atan(width_mm / 2 / focal_mm) / degree);
  std::vector<MatVariable> file_of_one;
  file_of_one.emplace_back("oi", std::move(oi));
  write_mat(file, file_of_one);
}

Json irradiance_json(const RetinalIrradiance& light, const EyeModel& eye, const Json& scale,
                     const IrradianceSettings& settings, const IrradianceFiles& files) {
  const auto picture = [&](const char* file, const char* unit) {
    return files.formats.count("tiff") > 0 ? Json{{"file", file}, {"unit", unit}} : Json{{"unit", unit}};
  };
  Json cones = picture("cones.tiff", "W / m^2");
  cones["channels"] = {"L", "M", "S"};
  return {{"eye", eye.name},
          {"wavelength_nm", light.wavelength_nm},
          {"band_nm", settings.step_nm},
          {"irradiance", picture("irradiance.tiff", files.photons ? photon_unit : energy_unit)},
          {"cones", cones},
          {"trolands", picture("trolands.tiff", "td")},
          {"formats", files.formats},
          {"scale", scale},
          {"white_luminance_cd_m2", settings.luminance_cd_m2},
          {"white_radiance_W_m2_sr_nm", light.white_radiance},
          {"white_trolands", light.white_trolands},
          {"pupil_area_mm2", light.pupil_area_mm2},
          {"media_age_years", settings.age_years.value_or(usual_age_years)},
          {"media_field", settings.media_field == MediaField::small ? "small" : "large"},
          {"transmittance", light.transmittance},
          {"rays", light.rays}};
}

}  // namespace

void write_irradiance(RetinalIrradiance light, const EyeModel& eye, const TraceSettings& trace,
                      const IrradianceSettings& settings, const IrradianceFiles& files,
                      const fs::path& folder) {
  for (LinearImage& band : light.irradiance) band = with_unseen(std::move(band), light.unseen);
  light.cones = with_unseen(std::move(light.cones), light.unseen);
  light.trolands = with_unseen(std::move(light.trolands), light.unseen);
  const Json scale = scale_of(eye, trace);
  const auto wants = [&](const char* format) { return files.formats.count(format) > 0; };
  if (wants("isetbio") && (!pair_of(scale, "um_per_pixel") || !pair_of(scale, "arcmin_per_pixel")))
    throw no_result_error(
        "--irradiance-format isetbio: the picture's middle, whose scale is the picture's, sees nothing");
  remove_irradiance(folder);
  if (wants("isetbio")) write_optical_image(light, eye, scale, folder / "optical-image.mat");
  if (wants("mat")) write_irradiance_mat(light, scale, files.photons, folder / "irradiance.mat");
  if (files.photons)
    for (std::size_t k = 0; k < light.irradiance.size(); ++k)
      for (float& value : light.irradiance[k].values)
        value *= static_cast<float>(photons_per_joule(light.wavelength_nm[k]));
  PixelNotes notes{pair_of(scale, "um_per_pixel"), files.photons ? photon_unit : energy_unit,
                   light.wavelength_nm};
  if (wants("exr")) write_spectral_exr(folder / "irradiance.exr", light.irradiance, notes);
  if (wants("tiff")) {
    write_tiff_pages(folder / "irradiance.tiff", light.irradiance, notes);
    write_tiff(folder / "cones.tiff", light.cones, {notes.pitch_um, "W / m^2", {}});
    write_tiff(folder / "trolands.tiff", light.trolands, {notes.pitch_um, "td", {}});
  }
  write_json(folder / "irradiance.json", irradiance_json(light, eye, scale, settings, files));
}

void remove_irradiance(const fs::path& folder) {
  for (const char* file : all_files) fs::remove(folder / file);
}

}  // namespace emmetrope::raytrace
