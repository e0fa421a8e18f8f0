#include "raytrace/irradiance_files.hpp"

#include <matio.h>

#include <array>
#include <limits>
#include <memory>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/eye/population/population.hpp"
#include "raytrace/eye_picture.hpp"

namespace emmetrope::raytrace {
namespace {

namespace fs = std::filesystem;

constexpr std::array<const char*, 4> irradiance_files{"irradiance.json", "irradiance.tiff", "cones.tiff",
                                                      "irradiance.mat"};

/// A MATLAB 5 file.
class MatFile {
 public:
  explicit MatFile(const fs::path& file)
      : file_(file), mat_(Mat_CreateVer(file.c_str(), nullptr, MAT_FT_MAT5), &Mat_Close) {
    if (!mat_) throw output_error("cannot write " + file.string());
  }
  /// \param values  column after column
  void add(const char* name, std::vector<std::size_t> size, std::vector<float> values) {
    put({Mat_VarCreate(name, MAT_C_SINGLE, MAT_T_SINGLE, static_cast<int>(size.size()), size.data(),
                       values.data(), 0),
         &Mat_VarFree});
  }
  void add(const char* name, std::vector<std::size_t> size, std::vector<double> values) {
    put({Mat_VarCreate(name, MAT_C_DOUBLE, MAT_T_DOUBLE, static_cast<int>(size.size()), size.data(),
                       values.data(), 0),
         &Mat_VarFree});
  }
  void add(const char* name, double value) { add(name, {1, 1}, std::vector<double>{value}); }
  void add(const char* name, std::string text) {
    std::array<std::size_t, 2> size{1, text.size()};
    put({Mat_VarCreate(name, MAT_C_CHAR, MAT_T_UTF8, 2, size.data(), text.data(), 0), &Mat_VarFree});
  }

 private:
  void put(const std::unique_ptr<matvar_t, decltype(&Mat_VarFree)>& variable) {
    if (!variable || Mat_VarWrite(mat_.get(), variable.get(), MAT_COMPRESSION_NONE) != 0)
      throw output_error("cannot write " + file_.string());
  }

  fs::path file_;
  std::unique_ptr<mat_t, decltype(&Mat_Close)> mat_;
};

/// What nobody sees is no number.
LinearImage with_unseen(LinearImage image, const std::vector<char>& unseen) {
  for (std::size_t i = 0; i < unseen.size() * image.channels; ++i)
    if (unseen[i / image.channels] != 0) image.values[i] = std::numeric_limits<float>::quiet_NaN();
  return image;
}

/// Rows and columns of a picture's channel, column after column.
void append_column_after_column(std::vector<float>& to, const LinearImage& image, int channel) {
  for (int column = 0; column < image.width; ++column)
    for (int row = 0; row < image.height; ++row) to.push_back(image.at(column, row, channel));
}

void write_mat(const RetinalIrradiance& light, const Json& scale, const fs::path& file) {
  const LinearImage& first = light.irradiance.front();
  const std::size_t width = first.width, height = first.height, bands = light.wavelength_nm.size();
  MatFile mat(file);
  mat.add("wavelength_nm", {1, bands}, light.wavelength_nm);
  mat.add("transmittance", {1, bands}, light.transmittance);
  std::vector<float> irradiance, cones;
  for (const LinearImage& band : light.irradiance) append_column_after_column(irradiance, band, 0);
  for (int c = 0; c < 3; ++c) append_column_after_column(cones, light.cones, c);
  mat.add("irradiance", {height, width, bands}, std::move(irradiance));
  mat.add("irradiance_unit", "W / (m^2 nm)");
  mat.add("cones", {height, width, 3}, std::move(cones));
  mat.add("cones_unit", "W / m^2");
  mat.add("pupil_area_mm2", light.pupil_area_mm2);
  for (const char* key : {"um_per_pixel", "arcmin_per_pixel"})
    if (scale[key][0].is_number() && scale[key][1].is_number())
      mat.add(key, {1, 2}, std::vector<double>{scale[key][0].get<double>(), scale[key][1].get<double>()});
}

}  // namespace

void write_irradiance(RetinalIrradiance light, const EyeModel& eye, const TraceSettings& trace,
                      const IrradianceSettings& settings, const fs::path& folder) {
  for (LinearImage& band : light.irradiance) band = with_unseen(std::move(band), light.unseen);
  light.cones = with_unseen(std::move(light.cones), light.unseen);
  const Json scale = scale_of(eye, trace);
  write_tiff_pages(folder / "irradiance.tiff", light.irradiance);
  write_tiff(folder / "cones.tiff", light.cones);
  write_mat(light, scale, folder / "irradiance.mat");
  write_json(folder / "irradiance.json",
             {{"eye", eye.name},
              {"wavelength_nm", light.wavelength_nm},
              {"band_nm", settings.step_nm},
              {"irradiance", {{"file", "irradiance.tiff"}, {"unit", "W / (m^2 nm)"}}},
              {"cones", {{"file", "cones.tiff"}, {"unit", "W / m^2"}, {"channels", {"L", "M", "S"}}}},
              {"scale", scale},
              {"white_luminance_cd_m2", settings.luminance_cd_m2},
              {"white_radiance_W_m2_sr_nm", light.white_radiance},
              {"white_trolands", light.white_trolands},
              {"pupil_area_mm2", light.pupil_area_mm2},
              {"media_age_years", settings.age_years.value_or(usual_age_years)},
              {"media_field", settings.media_field == MediaField::small ? "small" : "large"},
              {"transmittance", light.transmittance},
              {"rays", light.rays}});
}

void remove_irradiance(const fs::path& folder) {
  for (const char* file : irradiance_files) fs::remove(folder / file);
}

}  // namespace emmetrope::raytrace
