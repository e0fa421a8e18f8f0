#pragma once
#include <vector>

#include "pipeline/eye/media/transmittance.hpp"
#include "raytrace/tracer/exposure.hpp"

namespace emmetrope::raytrace {

struct IrradianceSettings {
  double luminance_cd_m2 = 100;                        ///< of the scene's white (spectral_scene.hpp)
  double first_nm = 400, last_nm = 700, step_nm = 10;  ///< bands
  std::optional<double> age_years;                     ///< of the media; usual_age_years where none is given
  MediaField media_field = MediaField::small;

  std::vector<double> wavelengths_nm() const;
  /// \throw Error (usage) naming the option
  void check() const;
};

/// Light on the retina in physical units, a picture a band.
struct RetinalIrradiance {
  std::vector<double> wavelength_nm;
  std::vector<double> transmittance;    ///< of the media (ocular_transmittance), in the pictures
  std::vector<double> white_radiance;   ///< of the scene's white, W / (m^2 sr nm)
  std::vector<LinearImage> irradiance;  ///< one channel, W / (m^2 nm)
  /// Long, middle and short wavelength cones: integral of fundamental times irradiance, W / m^2, as if the media were
  /// clear, since the fundamentals hold the average observer's lens and macula (of the central 2 degrees).
  LinearImage cones;
  /// Retinal illuminance, trolands: luminance of what a pixel sees, as much of it as the bands hold, times the area of the
  /// entrance pupil, weighted as the irradiance is against the picture's middle. One channel.
  LinearImage trolands;
  std::vector<char> unseen;        ///< pixels that see nothing in one of the bands; empty where all see
  double pupil_area_mm2 = 0;       ///< of the entrance pupil, as seen along the axis
  double white_trolands = 0;       ///< luminance of white times that area
  double middle_projected_sr = 0;  ///< of the middle pixel, at the last wavelength
  std::uint64_t rays = 0;
  double wall_s = 0;
};

/// Quanta in a joule of light of this wavelength in vacuum: lambda / (h c).
inline double photons_per_joule(double wavelength_nm) { return 5.03411656e15 * wavelength_nm; }

/// Irradiance is n^2 T times the integral of radiance over the cone of light that the stop lets through, with the
/// cosine at the retina; n is the vitreous's index, T the media's transmittance. Directional sensitivity of receptors
/// is not in it.
/// \throw Error as Tracer::trace and both settings' check
RetinalIrradiance retinal_irradiance(const Tracer& tracer, const EyeModel& eye, const Scene& scene,
                                     const TraceSettings& trace, const Exposure& exposure,
                                     const IrradianceSettings& settings);

}  // namespace emmetrope::raytrace
