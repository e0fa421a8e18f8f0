#include "raytrace/tracer/tracer.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <thread>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/model/mesh_shape.hpp"
#include "raytrace/device/image_change.hpp"
#include "raytrace/device/shared_picture.hpp"
#include "raytrace/picture/airy.hpp"
#include "raytrace/picture/spectrum.hpp"
#include "raytrace/retina/pupil_aim.hpp"
#include "raytrace/retina/retina_pixels.hpp"
#include "raytrace/retina/wide_field.hpp"
#include "raytrace/system/optical_system.hpp"
#include "raytrace/system/paper_method.hpp"
#include "raytrace/system/sheet_mesh.hpp"
#include "raytrace/wavefront/seen_pupil.hpp"

namespace emmetrope::raytrace {
namespace {

std::vector<float> colour_table(const Spectrum& spectrum) {
  std::vector<float> table;
  for (int to = 0; to < 3; ++to)
    for (int from = 0; from < 3; ++from)
      for (const auto& matrix : spectrum.rgb_from_rgb) table.push_back(static_cast<float>(matrix(to, from)));
  return table;
}

double seconds_since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

/// The Stiles-Crawford weight at the pupil's rim is 2 to the minus this. It is of the eye's pupil, whatever it wears.
double pupil_falloff(const EyeModel& eye, const TraceSettings& settings) {
  const double area_mm2 = seen_pupil_area_mm2(without_spectacle(eye), eye.reference_wavelength_nm);
  return std::log2(10.0) * settings.stiles_crawford_per_mm2 * area_mm2 / pi;
}

/// Rays are bent where they have left the spectacle, by the pupil that is seen through it.
std::vector<float> airy_table_of(const EyeModel& eye, const Spectrum& spectrum) {
  const double area_mm2 = seen_pupil_area_mm2(eye, eye.reference_wavelength_nm);
  return airy_table(spectrum.wavelength_nm, 2 * std::sqrt(area_mm2 / pi));
}

Representation chosen(const EyeModel& eye, const TraceSettings& settings) {
  if (settings.method == Method::paper) {
    const Representation wanted = settings.representation.value_or(Representation::every_triangle);
    if (wanted == Representation::smooth || wanted == Representation::fast)
      throw usage_error("--method paper has analytic surfaces or triangles only");
    return wanted == Representation::triangles ? Representation::every_triangle : wanted;
  }
  if (settings.representation) return *settings.representation;
  const bool refracts_at_mesh =
      std::any_of(eye.surfaces.begin(), std::prev(eye.surfaces.end()),
                  [](const Surface& surface) { return mesh_of(surface) != nullptr; });
  return refracts_at_mesh ? Representation::smooth : Representation::analytic;
}

/// The counts of `vertices` that belong to refracting surfaces; a retina's own count makes it a mesh.
std::vector<int> take_retina_mesh(EyeModel& eye, const TraceSettings& settings, bool meshed) {
  std::vector<int> vertices = settings.vertices;
  if (vertices.size() == 1) return vertices;
  const auto surfaces = std::count_if(eye.surfaces.begin(), eye.surfaces.end(),
                                      [](const auto& surface) { return !surface.is_stop(); });
  const auto given = static_cast<std::ptrdiff_t>(vertices.size());
  if (given != surfaces && given != surfaces - 1)
    throw usage_error("--vertices: " + std::to_string(given) + " numbers for an eye of " +
                          std::to_string(surfaces - 1) + " refracting surfaces and a retina",
                      "give one for all, or one each from the retina to the cornea");
  if (given < surfaces) return vertices;
  if (settings.grid.projection != Projection::retina_plane)
    throw usage_error("--vertices: the retina's own number goes with the projection retina-plane",
                      "give one for all, or one for each refracting surface");
  Surface& retina = eye.surfaces.back();
  if (meshed && mesh_of(retina) == nullptr) {
    const RetinalGrid& grid = settings.grid;
    const double reach_mm = grid.centre_mm.norm() + std::hypot(grid.field_x_mm, grid.field_y_mm) / 2;
    retina.shape = std::make_shared<MeshShape>(
        sheet_mesh(*retina.shape, 1.2 * reach_mm, vertices.front(), 0.25), MeshInterpolation::triangles);
  }
  vertices.erase(vertices.begin());
  return vertices;
}

/// \throw Error where the picture's derivatives are not offered
void check_derivatives(const Scene& scene, const TraceSettings& settings,
                       const std::vector<EyeTangent>& tangents) {
  if (tangents.empty()) return;
  if (settings.grid.projection != Projection::retina_plane)
    throw usage_error("derivatives are of pictures equidistant in eye x and y");
  if (!scene.meshes.empty())
    throw unsupported_error("derivatives of a scene with meshes are not offered", "use a scene of planes");
  if (settings.method == Method::paper || settings.achromatic)
    throw usage_error("neither --method paper nor --achromatic has derivatives");
}

Spectrum spectrum_of(const TraceSettings& settings, const EyeModel& eye) {
  Spectrum spectrum = display_spectrum();
  if (settings.wavelength_nm) spectrum.wavelength_nm.fill(*settings.wavelength_nm);
  if (settings.achromatic) spectrum.wavelength_nm.fill(eye.reference_wavelength_nm);
  return spectrum;
}

/// \param eye  its retina becomes a mesh where its own count of vertices says so
SystemForm system_form(EyeModel& eye, const TraceSettings& settings, int threads) {
  SystemForm form;
  form.representation = chosen(eye, settings);
  form.vertices = take_retina_mesh(eye, settings, form.representation != Representation::analytic);
  form.every_surface = settings.method == Method::paper;
  form.threads = threads;
  return form;
}

/// Where the picture's rays start, and what they are aimed at.
struct PicturePlaces {
  RetinaPixels pixels;
  double aim_plane_z_mm = 0;
  std::optional<PupilAim> aim;  ///< of the retina's plane alone
};
PicturePlaces places_of(const EyeModel& eye, const TraceSettings& settings, int threads) {
  const double wavelength_nm = settings.wavelength_nm.value_or(eye.reference_wavelength_nm);
  if (settings.grid.projection != Projection::retina_plane) {
    const WideField field(eye, settings.grid, wavelength_nm,
                          settings.place_wavelength_nm.value_or(wavelength_nm), threads);
    return {field.pixels(threads), field.plane_z_mm(), std::nullopt};
  }
  PupilAim aim(eye, settings.grid, wavelength_nm, threads);
  RetinaPixels pixels = make_pixels(eye, settings.grid, aim, threads);
  return {std::move(pixels), aim.plane_z_mm(), std::move(aim)};
}

/// All that does not need a device.
PictureJob picture_job(const EyeModel& eye, const Scene& scene, const TraceSettings& settings,
                       const SystemForm& form, const Spectrum& spectrum, PicturePlaces places) {
  const bool paper = settings.method == Method::paper, spectral = !settings.wavelength_nm;
  PictureJob job;
  job.system = make_optical_system(paper ? without_stop(eye) : eye, spectrum.wavelength_nm, form);
  job.view = make_device_scene(scene, settings.pose.eye_from_scene(), !spectral, form.threads);
  job.grid = settings.grid;
  job.samples = settings.samples;
  job.pixels = std::move(places.pixels);
  job.aim_plane_z_mm = places.aim_plane_z_mm;
  job.colours = colour_table(spectrum);
  if (paper) job.cap = aim_cap(eye, job.system.operation_of);
  if (settings.stiles_crawford_per_mm2 > 0)
    job.pupil_falloff = static_cast<float>(pupil_falloff(eye, settings));
  if (settings.diffraction) job.airy = airy_table_of(eye, spectrum);
  job.form.channels = job.view.channels;
  job.form.spectral = spectral;
  job.form.illuminance = settings.illuminance;
  job.form.meshes = job.view.has_meshes();
  job.form.stiles_crawford = job.pupil_falloff.has_value();
  job.form.diffraction = settings.diffraction;
  job.form.random_cap = paper;
  return job;
}

/// Of the pixels that light reaches, the nearest to the picture's middle; the middle where there is none.
std::size_t middle_pixel(const RetinalGrid& grid, const PictureSums& sums) {
  const int column = grid.width / 2, row = grid.height / 2;
  const auto from_middle = [&](std::size_t pixel) {
    const int i = static_cast<int>(pixel);
    return std::hypot(i % grid.width - column, i / grid.width - row);
  };
  const std::size_t middle = static_cast<std::size_t>(row) * grid.width + column;
  if (sums.weight[middle] > 0) return middle;
  std::optional<std::size_t> nearest;
  for (std::size_t i = 0; i < sums.weight.size(); ++i)
    if (sums.weight[i] > 0 && (!nearest || from_middle(i) < from_middle(*nearest))) nearest = i;
  return nearest.value_or(middle);
}

/// Means from sums.
void finish(TraceResult& result, const PictureSums& sums, const PictureJob& job, bool illuminance) {
  const RetinalGrid& grid = job.grid;
  const std::size_t pixels = sums.weight.size(), derivatives = job.form.tangents;
  result.image = {grid.width, grid.height, 3, std::vector<float>(pixels * 3)};
  result.derivatives.assign(derivatives, result.image);
  const auto scale = [&](std::size_t i) { return sums.weight[i] > 0 ? 1 / sums.weight[i] : 0.F; };
  for (std::size_t i = 0; i < pixels; ++i) {
    for (int c = 0; c < 3; ++c) result.image.values[3 * i + c] = sums.light[3 * i + c] * scale(i);
    for (std::size_t k = 0; k < 3 * derivatives; ++k)
      result.derivatives[k / 3].values[3 * i + k % 3] = sums.derivatives[3 * derivatives * i + k] * scale(i);
  }
  // Relative retinal illuminance: the solid angle of the light times the cosine, against the middle's.
  if (illuminance) {
    const auto of = [&](std::size_t pixel) { return sums.weight[pixel] * job.pixels.area_mm2[pixel]; };
    const float in_middle = of(middle_pixel(grid, sums));
    for (std::size_t i = 0; in_middle > 0 && i < result.image.values.size(); ++i)
      result.image.values[i] *= of(i / 3) / in_middle;
    result.middle_projected_sr = in_middle / static_cast<float>(sums.samples);
  }
  result.samples = sums.samples;
  result.unseen = job.pixels.unseen;
  result.rays = (pixels - std::count(result.unseen.begin(), result.unseen.end(), 1)) * sums.samples;
  std::uint64_t stopped = 0;
  constexpr RayState states[] = {RayState::vignetted, RayState::tir, RayState::missed_surface,
                                 RayState::missed_scene};
  for (int s = 0; s < 4; ++s) stopped += result.states[states[s]] = sums.counts[s];
  result.states[RayState::reached] = result.rays - stopped;
}

}  // namespace

struct Tracer::State {
  State(const std::string& wanted, int wanted_threads, int lanes)
      : threads(wanted_threads > 0 ? wanted_threads
                                   : static_cast<int>(std::max(1U, std::thread::hardware_concurrency()))) {
    for (const DeviceInfo& device : chosen_devices(list_devices(wanted_threads), wanted))
      devices.push_back(std::make_unique<OpenCl>(device, wanted_threads, lanes));
  }
  std::vector<std::unique_ptr<OpenCl>> devices;
  int threads;
};

Tracer::Tracer(const std::string& device, int threads, int lanes)
    : state_(std::make_unique<State>(device, threads, lanes)) {}
Tracer::~Tracer() = default;
Tracer::Tracer(Tracer&&) noexcept = default;
Tracer& Tracer::operator=(Tracer&&) noexcept = default;

std::string Tracer::device_name() const {
  std::string names;
  for (const auto& device : state_->devices)
    names += (names.empty() ? "" : " + ") + device->info().description();
  return names;
}

TraceResult Tracer::trace(const EyeModel& whole_eye, const Scene& scene, const TraceSettings& settings,
                          const std::vector<EyeTangent>& tangents) const {
  settings.check();
  check_derivatives(scene, settings, tangents);
  const auto begin = std::chrono::steady_clock::now();
  const Spectrum spectrum = spectrum_of(settings, whole_eye);
  EyeModel eye = whole_eye;
  const SystemForm form = system_form(eye, settings, state_->threads);
  PicturePlaces places = places_of(eye, settings, state_->threads);
  const std::optional<PupilAim> aim = std::move(places.aim);
  PictureJob job = picture_job(eye, scene, settings, form, spectrum, std::move(places));
  if (!tangents.empty())
    job.change = make_image_change(tangents, job.view, job.grid, spectrum.wavelength_nm, state_->threads);
  job.form.tangents = tangents.size();

  TraceResult result;
  result.device = device_name();
  result.notes = job.system.notes;
  if (form.representation == Representation::fast) {
    OpenCl& first = *state_->devices.front();
    try {
      job.map = make_fast_map(first, eye, job.grid, aim.value(), job.system, spectrum.wavelength_nm,
                              settings.seed, state_->threads);
    } catch (const cl::Error& fault) {
      throw_device_error(fault, first.info().name);
    }
    result.notes.push_back(job.map->note());
  }
  SharedPicture picture(state_->devices, job);
  result.prepare_s = seconds_since(begin);
  PictureSums sums;
  if (settings.target_error) {
    auto estimate =
        picture.until(*settings.target_error, settings.seed, settings.samples, settings.verbosity);
    sums = std::move(estimate.sums);
    result.error = estimate.standard_error;
  } else {
    sums = picture.no_samples();
    picture.add_samples(sums, settings.seed, settings.samples, "tracing", settings.verbosity);
  }
  finish(result, sums, job, settings.illuminance);
  result.device_bytes = picture.bytes();
  result.wall_s = seconds_since(begin);
  return result;
}

std::vector<ExitRay> Tracer::exit_rays(const EyeModel& eye, const std::vector<Ray>& rays_in_eye,
                                       const TraceSettings& settings) const {
  OpenCl& cl = *state_->devices.front();
  std::array<double, wavelength_count> wavelengths{};
  wavelengths.fill(settings.wavelength_nm.value_or(eye.reference_wavelength_nm));
  SystemForm form;
  form.representation = chosen(eye, settings);
  form.vertices = settings.vertices;
  const OpticalSystem system = make_optical_system(eye, wavelengths, form);
  const std::size_t count = rays_in_eye.size();
  std::vector<float> in(6 * count), out;
  for (std::size_t i = 0; i < count; ++i)
    for (int c = 0; c < 3; ++c) {
      in[c * count + i] = static_cast<float>(rays_in_eye[i].origin[c]);
      in[(3 + c) * count + i] = static_cast<float>(rays_in_eye[i].direction[c]);
    }
  try {
    out = raytrace::trace_rays(cl, system, SystemBuffers(cl, system), in,
                               static_cast<int>(system.kinds.size()));
  } catch (const cl::Error& fault) {
    throw_device_error(fault, cl.info().name);
  }
  constexpr RayState states[] = {RayState::reached, RayState::vignetted, RayState::tir,
                                 RayState::missed_surface};
  std::vector<ExitRay> result(rays_in_eye.size());
  for (std::size_t i = 0; i < result.size(); ++i)
    result[i] = {{out[i], out[count + i], out[2 * count + i]},
                 {out[3 * count + i], out[4 * count + i], out[5 * count + i]},
                 states[static_cast<int>(out[6 * count + i])]};
  return result;
}

}  // namespace emmetrope::raytrace
