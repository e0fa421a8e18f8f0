#include "raytrace/wavefront_files.hpp"

#include <fmt/format.h>

#include "pipeline/base/files.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/base/log.hpp"
#include "pipeline/eye/optics/paraxial.hpp"
#include "raytrace/picture/float_files.hpp"

namespace emmetrope::raytrace {
namespace {

/// The rays' directions about their mean, by where they cross the pupil.
std::string spot_diagram(const Wavefront& wavefront) {
  std::string spots = "pupil_x_mm,pupil_y_mm,angle_x_arcmin,angle_y_arcmin,weight\n";
  const Eigen::Vector2d mean = wavefront.mean_slope();
  double light = 0;
  for (const auto& ray : wavefront.rays) light += wavefront.light_share(ray);
  for (const auto& ray : wavefront.rays) {
    const Eigen::Vector2d angle = (ray.slope - mean) / degree * 60;
    spots += fmt::format("{:.5f},{:.5f},{:.5f},{:.5f},{:.6g}\n", ray.place_mm.x(), ray.place_mm.y(),
                         angle.x(), angle.y(), wavefront.light_share(ray) / light);
  }
  return spots;
}

}  // namespace

std::string narrowed_pupil(const EyeModel& eye, const Wavefront& wavefront) {
  constexpr double least_share = 0.9;  // aberrations of the pupil take less
  const double of_stop_mm = entrance_pupil(eye, wavefront.wavelength_nm).diameter_mm;
  if (eye.stop() == nullptr || wavefront.pupil_mm >= least_share * of_stop_mm) return {};
  return fmt::format(
      "the entrance pupil is {:.2f} mm wide, not the {:.2f} mm of an iris of {:g} mm: beside it rays miss a surface",
      wavefront.pupil_mm, of_stop_mm, eye.stop()->stop_diameter_mm);
}

WavefrontSettings wavefront_settings(const TraceSettings& settings) {
  WavefrontSettings wavefront;
  wavefront.wavelength_nm = settings.wavelength_nm;
  wavefront.fovea_mm = settings.grid.centre_mm;
  wavefront.stiles_crawford_per_mm2 = settings.stiles_crawford_per_mm2;
  return wavefront;
}

void write_wavefront(const EyeModel& eye, const TraceSettings& settings,
                     const std::filesystem::path& folder) {
  const Wavefront wavefront = measure_wavefront(eye, wavefront_settings(settings));
  if (const std::string narrowed = narrowed_pupil(eye, wavefront); !narrowed.empty())
    spdlog::warn("{}", narrowed);
  const PointSpread spread = point_spread(wavefront);
  Json json = wavefront_json(wavefront);
  if (spread.wraps) {
    spdlog::warn(
        "psf.tiff is left out: the blur is wider than the largest grid of a point spread function; spots.csv "
        "has the rays");
    json["psf"] = nullptr;
    std::filesystem::remove(folder / "psf.tiff");  // of an earlier run
  } else {
    json["psf"] = {{"file", "psf.tiff"}, {"pitch_arcmin", spread.pitch_arcmin}};
    write_tiff(folder / "psf.tiff", {spread.size, spread.size, 1, spread.values});
  }
  write_json(folder / "wavefront.json", json);
  write_file(folder / "spots.csv", spot_diagram(wavefront));
}

}  // namespace emmetrope::raytrace
