#include "raytrace/tracer/tracer.hpp"

#include <chrono>
#include <cmath>
#include <cstring>
#include <thread>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "raytrace/eye/mesh_shape.hpp"
#include "raytrace/eye/paraxial.hpp"
#include "raytrace/tracer/airy.hpp"
#include "raytrace/tracer/device_rays.hpp"
#include "raytrace/tracer/device_scene.hpp"
#include "raytrace/tracer/fast_map.hpp"
#include "raytrace/tracer/opencl.hpp"
#include "raytrace/tracer/optical_system.hpp"
#include "raytrace/tracer/paper_method.hpp"
#include "raytrace/tracer/pupil_aim.hpp"
#include "raytrace/tracer/retina_pixels.hpp"
#include "raytrace/tracer/sheet_mesh.hpp"
#include "raytrace/tracer/spectrum.hpp"

namespace emmetrope::raytrace {
namespace {

constexpr int outputs = 4, state_counts = 4;
/// Rays of one kernel call: short enough for progress, Ctrl-C and a display's watchdog.
constexpr std::int64_t rays_a_call = 8'000'000, rays_a_call_every_triangle = 100'000;

std::vector<float> colour_table(const Spectrum& spectrum) {
  std::vector<float> table;
  for (int to = 0; to < 3; ++to)
    for (int from = 0; from < 3; ++from)
      for (const auto& matrix : spectrum.rgb_from_rgb) table.push_back(static_cast<float>(matrix(to, from)));
  return table;
}

/// Names of the surfaces that tangents bend: the device must have them as biconics.
std::vector<std::string> names_of(const std::vector<CurvatureTangent>& tangents) {
  std::vector<std::string> names;
  for (const auto& tangent : tangents) names.push_back(tangent.surface);
  return names;
}

/// The tangents as kernels/tangent.cl takes them, and the first operation that one of them changes.
struct Seeds {
  std::vector<float> values;
  int first_operation = 0;
};
Seeds make_seeds(const OpticalSystem& system, const std::vector<CurvatureTangent>& tangents) {
  Seeds seeds;
  if (tangents.empty()) return seeds;
  seeds.first_operation = static_cast<int>(system.kinds.size());
  for (const auto& tangent : tangents) {
    const auto found = system.operation_of.find(tangent.surface);
    if (found == system.operation_of.end())
      throw usage_error("the eye has no surface \"" + tangent.surface + "\"");
    const int operation = found->second;
    const Eigen::Matrix2d turn =
        Eigen::Rotation2Dd(system.axis_deg.at(tangent.surface) * degree).toRotationMatrix();
    const Eigen::Matrix2d change = turn.transpose() * tangent.curvature_per_unit * turn;
    float bits = 0;
    std::memcpy(&bits, &operation, sizeof bits);
    seeds.values.insert(seeds.values.end(), {static_cast<float>(change(0, 0)),
                                             static_cast<float>((change(0, 1) + change(1, 0)) / 2),
                                             static_cast<float>(change(1, 1)), bits});
    seeds.first_operation = std::min(seeds.first_operation, operation);
  }
  for (std::size_t k = seeds.first_operation; k < system.kinds.size(); ++k)
    if (system.kinds[k] == Operation::stop || system.kinds[k] == Operation::patch ||
        system.kinds[k] == Operation::triangles || system.kinds[k] == Operation::every_triangle)
      throw unsupported_error("derivatives with respect to surface \"" + tangents.front().surface +
                                  "\": the stop or a mesh lies between it and the scene",
                              "differentiate by a surface in front of them, such as a spectacle's");
  return seeds;
}

double seconds_since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

/// Diameter of the entrance pupil of the eye without what it wears.
double entrance_pupil_mm(const EyeModel& eye) {
  EyeModel bare = eye;
  const auto worn = [](const Surface& surface) { return surface.name.rfind("spectacle", 0) == 0; };
  bare.surfaces.erase(std::remove_if(bare.surfaces.begin(), bare.surfaces.end(), worn), bare.surfaces.end());
  return entrance_pupil(bare, bare.reference_wavelength_nm).diameter_mm;
}

/// The Stiles-Crawford weight at the pupil's rim is 2 to the minus this.
double pupil_falloff(const EyeModel& eye, const TraceSettings& settings) {
  return std::log2(10.0) * settings.stiles_crawford_per_mm2 * std::pow(entrance_pupil_mm(eye) / 2, 2);
}

Representation chosen(const EyeModel& eye, const TraceSettings& settings) {
  if (settings.method == Method::paper) {
    const Representation wanted = settings.representation.value_or(Representation::every_triangle);
    if (wanted == Representation::smooth || wanted == Representation::fast)
      throw usage_error("--method paper has analytic surfaces or triangles only");
    return wanted == Representation::triangles ? Representation::every_triangle : wanted;
  }
  if (settings.representation) return *settings.representation;
  for (const auto& surface : eye.surfaces)
    if (!surface.is_stop() && surface.shape->type() == "mesh" && surface.name != "retina")
      return Representation::smooth;
  return Representation::analytic;
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
  Surface& retina = eye.surfaces.back();
  if (meshed && retina.shape->type() != "mesh") {
    const RetinalGrid& grid = settings.grid;
    const double reach_mm = grid.centre_mm.norm() + std::hypot(grid.field_x_mm, grid.field_y_mm) / 2;
    retina.shape = std::make_shared<MeshShape>(
        sheet_mesh(*retina.shape, 1.2 * reach_mm, vertices.front(), 0.25), MeshInterpolation::triangles);
  }
  vertices.erase(vertices.begin());
  return vertices;
}

void check(const TraceSettings& settings) {
  if (settings.method == Method::paper && settings.illuminance)
    throw usage_error("--illuminance: the paper's rays are not spread evenly over the pupil",
                      "leave out --method paper");
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
  if (!(settings.stiles_crawford_per_mm2 >= 0 && settings.stiles_crawford_per_mm2 <= 1))
    throw usage_error("--stiles-crawford: " + std::to_string(settings.stiles_crawford_per_mm2) +
                          " per mm^2 is out of range",
                      "give 0 to 1; 0.05 is usual");
  if (settings.method == Method::paper && (settings.stiles_crawford_per_mm2 > 0 || settings.diffraction))
    throw usage_error("--method paper knows neither diffraction nor the Stiles-Crawford effect");
  const Gaze& gaze = settings.pose.gaze;
  if (std::abs(gaze.horizontal_deg) > 60 || std::abs(gaze.vertical_deg) > 60)
    throw usage_error("--gaze: an eye does not turn by more than 60 degrees");
}

}  // namespace

struct Tracer::State {
  State(const std::string& device, int wanted_threads, int lanes)
      : cl(device, wanted_threads, lanes),
        threads(wanted_threads > 0 ? wanted_threads
                                   : static_cast<int>(std::max(1U, std::thread::hardware_concurrency()))) {}
  OpenCl cl;
  int threads;
};

Tracer::Tracer(const std::string& device, int threads, int lanes)
    : state_(std::make_unique<State>(device, threads, lanes)) {}
Tracer::~Tracer() = default;
Tracer::Tracer(Tracer&&) noexcept = default;
Tracer& Tracer::operator=(Tracer&&) noexcept = default;

std::string Tracer::device_name() const { return state_->cl.info().description(); }

TraceResult Tracer::trace(const EyeModel& whole_eye, const Scene& scene, const TraceSettings& settings,
                          const std::vector<CurvatureTangent>& tangents) const {
  check(settings);
  const auto begin = std::chrono::steady_clock::now();
  OpenCl& cl = state_->cl;
  const bool spectral = !settings.wavelength_nm;
  Spectrum spectrum = display_spectrum();
  if (!spectral) spectrum.wavelength_nm.fill(*settings.wavelength_nm);

  EyeModel eye = whole_eye;
  const bool paper = settings.method == Method::paper;
  SystemForm form;
  form.representation = chosen(eye, settings);
  form.vertices = take_retina_mesh(eye, settings, form.representation != Representation::analytic);
  form.as_biconic = names_of(tangents);
  form.every_surface = paper;
  form.threads = state_->threads;
  const OpticalSystem system =
      make_optical_system(paper ? without_stop(eye) : eye, spectrum.wavelength_nm, form);
  const std::vector<float> cap = paper ? aim_cap(eye, system.operation_of) : std::vector<float>{};
  const Seeds seeds = make_seeds(system, tangents);
  const DeviceScene view = make_device_scene(scene, settings.pose.eye_from_scene(), !spectral);
  if (view.has_meshes() && !tangents.empty())
    throw unsupported_error("derivatives of a scene with meshes are not offered", "use a scene of planes");
  const RetinalGrid& grid = settings.grid;
  const PupilAim aim(eye, grid, spectral ? eye.reference_wavelength_nm : *settings.wavelength_nm);
  const RetinaPixels pixels = make_pixels(eye, grid, aim, state_->threads);

  const int lanes = cl.lanes();
  KernelForm kernel_form;
  kernel_form.lanes = lanes;
  kernel_form.tile = lanes > 1 && !paper && form.representation != Representation::fast &&
                     (system.has(Operation::patch) || system.has(Operation::triangles));
  kernel_form.in_flight = 2;
  kernel_form.channels = view.channels;
  kernel_form.waves = !spectral ? 1 : kernel_form.tile ? wavelength_count : wavelength_count / lanes;
  kernel_form.spectral = spectral;
  kernel_form.illuminance = settings.illuminance;
  kernel_form.meshes = view.has_meshes();
  kernel_form.stiles_crawford = settings.stiles_crawford_per_mm2 > 0;
  kernel_form.diffraction = settings.diffraction;
  kernel_form.random_cap = paper;
  kernel_form.tangents = tangents.size();

  const PixelOrder order =
      kernel_form.tile ? in_tiles(grid.width, grid.height) : row_after_row(grid.width, grid.height);
  const int multiple = kernel_form.waves * kernel_form.in_flight * (kernel_form.tile ? 1 : lanes);
  const int samples = (settings.samples + multiple - 1) / multiple * multiple;
  const std::size_t places = order.pixels.size(), items = order.items();
  const std::vector<float> airy = settings.diffraction
                                      ? airy_table(spectrum.wavelength_nm, entrance_pupil_mm(eye))
                                      : std::vector<float>{};

  TraceResult result;
  result.device = device_name();
  result.notes = system.notes;
  std::vector<float> map_rows, map_weights;
  FastMap map;
  std::vector<float> image(places * outputs);
  std::vector<cl_int> states(places * state_counts);
  std::vector<float> derivatives(places * 3 * tangents.size());
  try {
    if (form.representation == Representation::fast) {
      const int mapped = tangents.empty() ? static_cast<int>(system.kinds.size()) : seeds.first_operation;
      map = make_fast_map(cl, eye, grid, aim, system, mapped, spectrum.wavelength_nm, settings.seed,
                          state_->threads);
      map_rows = map.rows(grid.height, lanes);
      map_weights = map.column_weights(grid.width);
      kernel_form.more = map.definitions();
      result.notes.push_back(map.note());
    }
    cl::Kernel kernel(cl.program(definitions_of(system, kernel_form)), "trace_pixels");
    const SystemBuffers system_buffers(cl, system);
    const SceneBuffers scene_buffers(cl, view);
    const cl::Buffer pixel_buffer = cl.upload(in_order(pixels, order)),
                     colour_buffer = cl.upload(colour_table(spectrum));
    const cl::Buffer image_buffer = cl.allocate(image.size() * sizeof(float)),
                     state_buffer = cl.allocate(states.size() * sizeof(cl_int)), cap_buffer = cl.upload(cap),
                     row_buffer = cl.upload(map_rows), weight_buffer = cl.upload(map_weights),
                     airy_buffer = cl.upload(airy), seed_buffer = cl.upload(seeds.values),
                     derivative_buffer =
                         cl.allocate(std::max<std::size_t>(1, derivatives.size()) * sizeof(float));
    const std::int64_t rays =
        system.has(Operation::every_triangle) ? rays_a_call_every_triangle : rays_a_call;
    const std::size_t items_a_call = static_cast<std::size_t>(
        std::max<std::int64_t>(work_group, rays / samples / order.together / work_group * work_group));
    Arguments arguments(kernel);
    system_buffers.add_to(arguments);
    arguments.add(static_cast<cl_int>(system.kinds.size()), pixel_buffer,
                  static_cast<cl_float>(aim.plane_z_mm()));
    const cl_uint place_of_slice = arguments.place();
    arguments.add(cl_int{0}, cl_int{0}, static_cast<cl_int>(samples),
                  static_cast<cl_uint>(settings.seed * 2654435761U + (settings.seed >> 32U)));
    scene_buffers.add_to(arguments);
    arguments.add(colour_buffer, image_buffer, state_buffer);
    if (paper) arguments.add(cap_buffer);
    if (kernel_form.stiles_crawford) arguments.add(static_cast<cl_float>(pupil_falloff(eye, settings)));
    if (kernel_form.diffraction) arguments.add(airy_buffer);
    if (form.representation == Representation::fast)
      arguments.add(static_cast<cl_int>(map.operations), static_cast<cl_int>(grid.width),
                    static_cast<cl_int>(grid.height), static_cast<cl_float>(map.plane_z_mm), row_buffer,
                    weight_buffer);
    if (!tangents.empty())
      arguments.add(seed_buffer, static_cast<cl_int>(seeds.first_operation), derivative_buffer);
    const std::size_t calls = (items + items_a_call - 1) / items_a_call;
    result.prepare_s = seconds_since(begin);
    Progress progress("tracing", calls, settings.verbosity);
    for (std::size_t first = 0; first < items; first += items_a_call) {
      const std::size_t count = std::min(items_a_call, items - first);
      kernel.setArg(place_of_slice, static_cast<cl_int>(first));
      kernel.setArg(place_of_slice + 1, static_cast<cl_int>(count));
      cl.queue().enqueueNDRangeKernel(kernel, cl::NullRange,
                                      cl::NDRange((count + work_group - 1) / work_group * work_group),
                                      cl::NDRange(work_group));
      cl.queue().finish();
      progress.advance();
    }
    cl.queue().enqueueReadBuffer(image_buffer, CL_TRUE, 0, image.size() * sizeof(float), image.data());
    if (!derivatives.empty())
      cl.queue().enqueueReadBuffer(derivative_buffer, CL_TRUE, 0, derivatives.size() * sizeof(float),
                                   derivatives.data());
    cl.queue().enqueueReadBuffer(state_buffer, CL_TRUE, 0, states.size() * sizeof(cl_int), states.data());
  } catch (const cl::Error& fault) {
    throw_device_error(fault, cl.info().name);
  }

  const std::size_t pixel_count = pixels.area_mm2.size();
  result.image = {grid.width, grid.height, 3, std::vector<float>(pixel_count * 3)};
  result.derivatives.assign(tangents.size(), result.image);
  std::vector<float> illuminance(pixel_count);
  std::array<std::uint64_t, state_counts> counted{};
  for (std::size_t place = 0; place < places; ++place) {
    if (order.pixels[place] < 0) continue;
    const std::size_t pixel = order.pixels[place];
    for (int c = 0; c < 3; ++c) result.image.values[pixel * 3 + c] = image[order.at(place, outputs, c)];
    illuminance[pixel] = image[order.at(place, outputs, 3)] * pixels.area_mm2[pixel];
    for (int k = 0; k < 3 * static_cast<int>(tangents.size()); ++k)
      result.derivatives[k / 3].values[pixel * 3 + k % 3] =
          derivatives[order.at(place, 3 * static_cast<int>(tangents.size()), k)];
    for (int s = 0; s < state_counts; ++s) counted[s] += states[order.at(place, state_counts, s)];
  }
  // Relative retinal illuminance: the solid angle of the light times the cosine, against the pole's.
  if (settings.illuminance) {
    const float at_pole =
        illuminance[static_cast<std::size_t>(grid.height / 2) * grid.width + grid.width / 2];
    for (std::size_t i = 0; i < result.image.values.size(); ++i)
      result.image.values[i] *= illuminance[i / 3] / at_pole;
  }
  result.device_bytes = sizeof(float) * (system.records.size() + pixels.values.size() + view.texels.size() +
                                         map_rows.size() + image.size() + derivatives.size() + states.size());
  result.rays = pixel_count * samples;
  result.states = {{RayState::vignetted, counted[0]},
                   {RayState::tir, counted[1]},
                   {RayState::missed_surface, counted[2]},
                   {RayState::missed_scene, counted[3]},
                   {RayState::reached, result.rays - counted[0] - counted[1] - counted[2] - counted[3]}};
  result.wall_s = seconds_since(begin);
  return result;
}

std::vector<ExitRay> Tracer::exit_rays(const EyeModel& eye, const std::vector<Ray>& rays_in_eye,
                                       const TraceSettings& settings) const {
  OpenCl& cl = state_->cl;
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
