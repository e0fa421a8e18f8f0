#include "raytrace/radiometry/irradiance.hpp"

#include <fmt/format.h>

#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/media/transmittance.hpp"
#include "pipeline/eye/population/limits.hpp"
#include "pipeline/eye/population/population.hpp"
#include "raytrace/radiometry/observer.hpp"
#include "raytrace/radiometry/spectral_scene.hpp"
#include "raytrace/wavefront/seen_pupil.hpp"

namespace emmetrope::raytrace {
namespace {

/// Index of the medium before the retina.
double vitreous_index_at(const EyeModel& eye, double wavelength_nm) {
  for (std::size_t i = eye.surfaces.size() - 1; i-- > 0;)
    if (!eye.surfaces[i].is_stop())
      return eye.medium(eye.surfaces[i].medium_after).index_at(wavelength_nm, eye.reference_wavelength_nm);
  return 1;
}

LinearImage blank_image(const RetinalGrid& grid, int channels) {
  return {grid.width, grid.height, channels,
          std::vector<float>(static_cast<std::size_t>(grid.width) * grid.height * channels)};
}

}  // namespace

std::vector<double> IrradianceSettings::wavelengths_nm() const {
  std::vector<double> bands;
  for (int k = 0; first_nm + k * step_nm <= last_nm + 1e-9; ++k) bands.push_back(first_nm + k * step_nm);
  return bands;
}

void IrradianceSettings::check() const {
  if (!(luminance_cd_m2 > 0 && luminance_cd_m2 <= 1e9))
    throw usage_error(
        fmt::format("--irradiance: a white of {:g} cd/m^2 is not above 0 and up to 1e9", luminance_cd_m2),
        "100 is a display's, 1e9 the sun's");
  if (!(first_nm >= 380 && last_nm <= 900 && first_nm <= last_nm && step_nm >= 1 && step_nm <= 500))
    throw usage_error("--bands: wavelengths from 380 to 900 nm in steps of 1 to 500 are wanted",
                      "write 400:700:10");
  if (age_years) check_setting("--media-age", *age_years, human_age_years, " years");
}

RetinalIrradiance retinal_irradiance(const Tracer& tracer, const EyeModel& eye, const Scene& scene,
                                     const TraceSettings& trace, const Exposure& exposure,
                                     const IrradianceSettings& settings) {
  settings.check();
  trace.check();
  const DisplayLight display(settings.luminance_cd_m2);
  RetinalIrradiance result;
  result.cones = blank_image(trace.grid, 3);
  result.trolands = blank_image(trace.grid, 1);
  result.pupil_area_mm2 = seen_pupil_area_mm2(without_spectacle(eye), eye.reference_wavelength_nm);
  result.white_trolands = settings.luminance_cd_m2 * result.pupil_area_mm2;
  const std::vector<double> wavelengths_nm = settings.wavelengths_nm();
  // A pixel is one point of the retina in every band: transverse chromatic aberration stays.
  TraceSettings in_one_band = trace;
  in_one_band.verbosity.quiet = true;
  in_one_band.place_wavelength_nm = eye.reference_wavelength_nm;
  in_one_band.illuminance = true;
  in_one_band.stiles_crawford_per_mm2 = 0;
  Progress progress("tracing wavelength by wavelength", wavelengths_nm.size(), trace.verbosity);
  for (const double nm : wavelengths_nm) {
    TraceSettings now = in_one_band;
    now.wavelength_nm = nm;
    const SceneAtWavelength shown = at_wavelength(scene, display, nm);
    const double transmittance =
        ocular_transmittance(nm, settings.age_years.value_or(usual_age_years), settings.media_field);
    LinearImage irradiance = blank_image(trace.grid, 1);
    if (shown.unit > 0) {
      const TraceResult traced = trace_exposure(tracer, eye, shown.scene, now, exposure);
      const double n = vitreous_index_at(eye, nm);
      const double in_clear_media = n * n * traced.middle_projected_sr * shown.unit;
      const Eigen::Vector3d cones = in_clear_media * settings.step_nm * cone_fundamentals(nm);
      const auto trolands = static_cast<float>(photopic_efficacy * luminous_efficiency(nm) * shown.unit *
                                               settings.step_nm * result.pupil_area_mm2);
      for (std::size_t i = 0; i < irradiance.values.size(); ++i) {
        const float light = traced.image.values[3 * i];
        irradiance.values[i] = static_cast<float>(in_clear_media * transmittance) * light;
        result.trolands.values[i] += trolands * light;
        for (int c = 0; c < 3; ++c) result.cones.values[3 * i + c] += static_cast<float>(cones[c]) * light;
      }
      if (result.unseen.empty()) result.unseen.resize(traced.unseen.size());
      for (std::size_t i = 0; i < traced.unseen.size(); ++i) result.unseen[i] |= traced.unseen[i];
      result.middle_projected_sr = traced.middle_projected_sr;
      result.rays += traced.rays;
      result.wall_s += traced.wall_s;
    }
    result.wavelength_nm.push_back(nm);
    result.transmittance.push_back(transmittance);
    result.white_radiance.push_back(display.radiance(nm).sum());
    result.irradiance.push_back(std::move(irradiance));
    progress.advance();
  }
  return result;
}

}  // namespace emmetrope::raytrace
