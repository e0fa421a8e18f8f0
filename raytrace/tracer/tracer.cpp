#include "raytrace/tracer/tracer.hpp"

#include <chrono>
#include <cmath>
#include <thread>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "raytrace/tracer/device_scene.hpp"
#include "raytrace/tracer/opencl.hpp"
#include "raytrace/tracer/optical_system.hpp"
#include "raytrace/tracer/pupil_aim.hpp"
#include "raytrace/tracer/spectrum.hpp"

namespace emmetrope::raytrace {
namespace {

constexpr int batches = 2;        ///< UN: batches of rays in flight
constexpr int pixel_floats = 12;  ///< PIXEL in kernels/trace.cl
constexpr int outputs = 4, state_counts = 4;
constexpr int work_group = 64;
/// Rays of one kernel call: short enough for progress, Ctrl-C and a display's watchdog.
constexpr std::int64_t rays_a_call = 8'000'000;
constexpr double centre_of_rotation_mm = 13.5;  ///< behind the apex

/// The eye turned by `gaze` (Listing): the scene as the turned eye's frame sees it. Positive horizontal: to
/// the patient's left (eye +x), positive vertical: up.
Eigen::Isometry3d eye_from_scene(const TraceSettings& settings) {
  Eigen::Isometry3d result = Eigen::Isometry3d::Identity();
  const double h = std::tan(settings.gaze_horizontal_deg * degree),
               v = std::tan(settings.gaze_vertical_deg * degree);
  if (h == 0 && v == 0) return result;
  const Eigen::Vector3d centre(0, 0, -centre_of_rotation_mm);
  const Eigen::Quaterniond turn =
      Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), Eigen::Vector3d(h, v, 1));
  result = Eigen::Translation3d(centre) * turn.inverse() * Eigen::Translation3d(-centre);
  return result;
}

/// Retina point, aim ellipse and normal of every pixel, PIXEL floats each. Returns them with the ellipses'
/// areas (mm^2).
struct Pixels {
  std::vector<float> values;
  std::vector<float> area_mm2;
};
Pixels make_pixels(const EyeModel& eye, const RetinalGrid& grid, const PupilAim& aim, int threads) {
  const std::size_t count = static_cast<std::size_t>(grid.width) * grid.height;
  Pixels pixels{std::vector<float>(count * pixel_floats), std::vector<float>(count)};
  std::exception_ptr fault;
  std::mutex mutex;
  const auto rows = [&](int first, int step) {
    try {
      for (int row = first; row < grid.height; row += step)
        for (int column = 0; column < grid.width; ++column) {
          // The retinal image is upside down: the picture's top left is seen by the retina's lower left in
          // eye x and y.
          const double x = grid.centre_mm.x() + grid.field_x_mm * ((column + 0.5) / grid.width - 0.5);
          const double y = grid.centre_mm.y() + grid.field_y_mm * ((row + 0.5) / grid.height - 0.5);
          const RetinaPoint point = retina_point(eye, x, y);
          const AimEllipse ellipse = aim.at(x, y);
          const std::size_t index = static_cast<std::size_t>(row) * grid.width + column;
          float* p = &pixels.values[index * pixel_floats];
          for (int i = 0; i < 3; ++i) p[i] = static_cast<float>(point.position_mm[i]);
          for (int i = 0; i < 2; ++i) p[3 + i] = static_cast<float>(ellipse.centre_mm[i]);
          for (int i = 0; i < 4; ++i) p[5 + i] = static_cast<float>(ellipse.from_disc(i / 2, i % 2));
          for (int i = 0; i < 3; ++i) p[9 + i] = static_cast<float>(point.normal[i]);
          pixels.area_mm2[index] = static_cast<float>(pi * std::abs(ellipse.from_disc.determinant()));
        }
    } catch (...) {
      const std::lock_guard<std::mutex> lock(mutex);
      fault = std::current_exception();
    }
  };
  std::vector<std::thread> workers;
  for (int t = 1; t < threads; ++t) workers.emplace_back(rows, t, threads);
  rows(0, threads);
  for (auto& worker : workers) worker.join();
  if (fault) std::rethrow_exception(fault);
  return pixels;
}

std::vector<float> colour_table(const Spectrum& spectrum) {
  std::vector<float> table;
  for (int to = 0; to < 3; ++to)
    for (int from = 0; from < 3; ++from)
      for (const auto& matrix : spectrum.rgb_from_rgb) table.push_back(static_cast<float>(matrix(to, from)));
  return table;
}

Representation chosen(const EyeModel& eye, const TraceSettings& settings) {
  if (settings.representation) return *settings.representation;
  for (const auto& surface : eye.surfaces)
    if (!surface.is_stop() && surface.shape->type() == "mesh" && surface.name != "retina")
      return Representation::smooth;
  return Representation::analytic;
}

void check(const TraceSettings& settings) {
  const RetinalGrid& grid = settings.grid;
  if (grid.width < 1 || grid.height < 1 || grid.width > 16384 || grid.height > 16384)
    throw usage_error(
        "--size: " + std::to_string(grid.width) + "x" + std::to_string(grid.height) + " is no image size",
        "give 1x1 to 16384x16384");
  if (!(grid.field_x_mm > 0) || !(grid.field_y_mm > 0))
    throw usage_error("--field-mm: the field must be larger than 0");
  if (settings.samples < 1 || settings.samples > 1'000'000)
    throw usage_error("--samples: " + std::to_string(settings.samples) + " is out of range",
                      "give 1 to 1000000");
  if (settings.wavelength_nm && (*settings.wavelength_nm < 380 || *settings.wavelength_nm > 780))
    throw usage_error("--wavelength: " + std::to_string(*settings.wavelength_nm) + " nm is not visible",
                      "give 380 to 780");
  if (std::abs(settings.gaze_horizontal_deg) > 60 || std::abs(settings.gaze_vertical_deg) > 60)
    throw usage_error("--gaze: an eye does not turn by more than 60 degrees");
}

}  // namespace

struct Tracer::State {
  State(const std::string& device, int wanted_threads)
      : cl(device, wanted_threads),
        threads(wanted_threads > 0 ? wanted_threads : static_cast<int>(std::max(1U, std::thread::hardware_concurrency()))) {
  }
  OpenCl cl;
  int threads;
};

Tracer::Tracer(const std::string& device, int threads) : state_(std::make_unique<State>(device, threads)) {}
Tracer::~Tracer() = default;
Tracer::Tracer(Tracer&&) noexcept = default;
Tracer& Tracer::operator=(Tracer&&) noexcept = default;

std::string Tracer::device_name() const { return state_->cl.info().description(); }

TraceResult Tracer::trace(const EyeModel& eye, const Scene& scene, const TraceSettings& settings,
                          const std::vector<CurvatureTangent>& tangents) const {
  check(settings);
  if (!tangents.empty()) throw unsupported_error("derivative images are not there yet");
  const auto begin = std::chrono::steady_clock::now();
  OpenCl& cl = state_->cl;
  const bool spectral = !settings.wavelength_nm;
  Spectrum spectrum = display_spectrum();
  if (!spectral) spectrum.wavelength_nm.fill(*settings.wavelength_nm);

  const OpticalSystem system =
      make_optical_system(eye, spectrum.wavelength_nm, chosen(eye, settings), settings.vertices);
  const DeviceScene view = make_device_scene(scene, eye_from_scene(settings), !spectral);
  const RetinalGrid& grid = settings.grid;
  const PupilAim aim(eye, grid, spectral ? eye.reference_wavelength_nm : *settings.wavelength_nm);
  const Pixels pixels = make_pixels(eye, grid, aim, state_->threads);

  const int lanes = cl.lanes(), waves = spectral ? wavelength_count / lanes : 1;
  const int multiple = lanes * waves * batches;
  const int samples = (settings.samples + multiple - 1) / multiple * multiple;
  const int pixel_count = grid.width * grid.height;
  const std::string definitions =
      "-DVLN=" + std::to_string(lanes) + " -DUN=" + std::to_string(batches) +
      " -DCHANNELS=" + std::to_string(view.channels) + " -DSPECTRAL=" + (spectral ? "1" : "0") +
      " -DWAVES=" + std::to_string(waves) + " -DILLUMINANCE=" + (settings.illuminance ? "1" : "0") +
      " -DSHARE_RECORDS=" + (lanes == 1 ? "1" : "0") + system.definitions();

  TraceResult result;
  result.device = device_name();
  std::vector<float> image(static_cast<std::size_t>(pixel_count) * outputs);
  std::vector<cl_int> states(static_cast<std::size_t>(pixel_count) * state_counts);
  try {
    cl::Kernel kernel(cl.program(definitions), "trace_pixels");
    std::vector<int> kinds;
    for (const Operation kind : system.kinds) kinds.push_back(static_cast<int>(kind));
    const cl::Buffer kind_buffer = cl.upload(kinds), operation_buffer = cl.upload(system.operations),
                     ratio_buffer = cl.upload(system.ratios), record_buffer = cl.upload(system.records),
                     pixel_buffer = cl.upload(pixels.values), plane_buffer = cl.upload(view.planes),
                     texel_buffer = cl.upload(view.texels), background_buffer = cl.upload(view.background),
                     colour_buffer = cl.upload(colour_table(spectrum));
    const cl::Buffer image_buffer = cl.allocate(image.size() * sizeof(float)),
                     state_buffer = cl.allocate(states.size() * sizeof(cl_int));
    const int pixels_a_call =
        std::max<std::int64_t>(work_group, rays_a_call / samples / work_group * work_group);
    cl_uint place = 0;
    const auto set = [&](const auto& value) { kernel.setArg(place++, value); };
    set(kind_buffer);
    set(operation_buffer);
    set(ratio_buffer);
    set(record_buffer);
    set(static_cast<cl_int>(kinds.size()));
    set(pixel_buffer);
    set(static_cast<cl_float>(aim.plane_z_mm()));
    const cl_uint place_of_slice = place;
    set(cl_int{0});
    set(cl_int{0});
    set(static_cast<cl_int>(samples));
    set(static_cast<cl_uint>(settings.seed * 2654435761U + (settings.seed >> 32U)));
    set(plane_buffer);
    set(static_cast<cl_int>(view.plane_count));
    set(texel_buffer);
    set(background_buffer);
    set(colour_buffer);
    set(image_buffer);
    set(state_buffer);
    const std::size_t calls = (pixel_count + pixels_a_call - 1) / pixels_a_call;
    Progress progress("tracing", calls, settings.verbosity);
    for (int first = 0; first < pixel_count; first += pixels_a_call) {
      const int count = std::min(pixels_a_call, pixel_count - first);
      kernel.setArg(place_of_slice, static_cast<cl_int>(first));
      kernel.setArg(place_of_slice + 1, static_cast<cl_int>(count));
      cl.queue().enqueueNDRangeKernel(kernel, cl::NullRange,
                                      cl::NDRange((count + work_group - 1) / work_group * work_group),
                                      cl::NDRange(work_group));
      cl.queue().finish();
      progress.advance();
    }
    cl.queue().enqueueReadBuffer(image_buffer, CL_TRUE, 0, image.size() * sizeof(float), image.data());
    cl.queue().enqueueReadBuffer(state_buffer, CL_TRUE, 0, states.size() * sizeof(cl_int), states.data());
  } catch (const cl::Error& fault) {
    throw_device_error(fault, cl.info().name);
  }

  result.image = {grid.width, grid.height, 3, std::vector<float>(static_cast<std::size_t>(pixel_count) * 3)};
  std::array<std::uint64_t, state_counts> counted{};
  // Relative retinal illuminance: the solid angle of the light times the cosine, against the pole's.
  double at_pole = 1;
  if (settings.illuminance) {
    const int middle = (grid.height / 2) * grid.width + grid.width / 2;
    at_pole = image[static_cast<std::size_t>(middle) * outputs + 3] * pixels.area_mm2[middle];
  }
  for (int i = 0; i < pixel_count; ++i) {
    const double gain = settings.illuminance
                            ? image[static_cast<std::size_t>(i) * outputs + 3] * pixels.area_mm2[i] / at_pole
                            : 1.0;
    for (int c = 0; c < 3; ++c)
      result.image.values[static_cast<std::size_t>(i) * 3 + c] =
          static_cast<float>(gain * image[static_cast<std::size_t>(i) * outputs + c]);
    for (int s = 0; s < state_counts; ++s)
      counted[s] += states[static_cast<std::size_t>(i) * state_counts + s];
  }
  result.rays = static_cast<std::uint64_t>(pixel_count) * samples;
  result.states = {{RayState::vignetted, counted[0]},
                   {RayState::tir, counted[1]},
                   {RayState::missed_surface, counted[2]},
                   {RayState::missed_scene, counted[3]},
                   {RayState::reached, result.rays - counted[0] - counted[1] - counted[2] - counted[3]}};
  result.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return result;
}

}  // namespace emmetrope::raytrace
