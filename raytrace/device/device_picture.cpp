#include "raytrace/device/device_picture.hpp"

#include <algorithm>

namespace emmetrope::raytrace {
namespace {

constexpr int outputs = 4, state_counts = 4;
/// Rays of one kernel call for each compute unit: enough to fill it, and short enough for progress, Ctrl-C
/// and a display's watchdog.
constexpr std::int64_t rays_a_call = 4'000'000, rays_a_call_every_triangle = 50'000;

KernelForm form_on(const OpenCl& cl, const PictureJob& job) {
  KernelForm form = job.form;
  form.lanes = cl.lanes();
  form.tile = form.lanes > 1 && !form.random_cap && !job.map &&
              (job.system.has(Operation::patch) || job.system.has(Operation::triangles));
  form.waves = !form.spectral ? 1 : form.tile ? wavelength_count : wavelength_count / form.lanes;
  // More batches at a time hide more latency as long as registers hold them: those of spheres.
  constexpr int many = 4;
  const bool simple = !job.map && !job.system.sequence_definitions().empty() &&
                      std::all_of(job.system.kinds.begin(), job.system.kinds.end(), [](Operation kind) {
                        return kind == Operation::sphere || kind == Operation::stop;
                      });
  form.in_flight = simple && form.lanes > 1 && job.samples % (many * form.lanes) == 0 ? many : 2;
  form.more = job.map ? job.map->definitions() : job.system.sequence_definitions();
  if (job.change) form.more += " -DCHANGE_DEGREE=" + std::to_string(job.change->degree);
  return form;
}

/// Where the rows of blocks begin among the items, and where the last one ends.
std::vector<std::size_t> first_items(const PixelOrder& order, int width, int height) {
  const std::vector<int> rows = block_edges(height);
  std::vector<std::size_t> first;
  for (std::size_t item = 0; item < order.items(); ++item) {
    int pixel = -1;
    for (int lane = 0; lane < order.together && pixel < 0; ++lane)
      pixel = order.pixels[item * order.together + lane];
    if (pixel / width == rows[first.size()]) first.push_back(item);
  }
  first.push_back(order.items());
  return first;
}

}  // namespace

DevicePicture::DevicePicture(OpenCl& cl, const PictureJob& job)
    : cl_(cl),
      job_(job),
      form_(form_on(cl, job)),
      order_(form_.tile ? in_tiles(job.grid.width, job.grid.height)
                        : row_after_row(job.grid.width, job.grid.height)),
      first_items_(first_items(order_, job.grid.width, job.grid.height)),
      kernel_(cl.program(definitions_of(job.system, form_)), "trace_pixels"),
      system_(cl, job.system),
      scene_(cl, job.view) {
  const auto keep = [this](const cl::Buffer& buffer) {
    kept_.push_back(buffer);
    bytes_ += buffer.getInfo<CL_MEM_SIZE>();
    return buffer;
  };
  const std::size_t places = order_.pixels.size();
  const auto room = [&](std::size_t values) {
    return keep(cl.allocate(std::max<std::size_t>(1, places * values) * sizeof(float)));
  };
  const auto in_form = [&](const std::vector<float>& values, int floats_a_pixel) {
    return keep(form_.tile ? cl.upload(in_order(values, floats_a_pixel, order_)) : cl.share(values));
  };
  Arguments arguments(kernel_);
  system_.add_to(arguments);
  arguments.add(static_cast<cl_int>(job.system.kinds.size()),
                in_form(job.pixels.values, RetinaPixels::floats_a_pixel),
                static_cast<cl_float>(job.aim_plane_z_mm));
  place_of_slice_ = arguments.place();
  arguments.add(cl_int{0}, cl_int{0}, cl_int{0}, cl_uint{0}, cl_uint{0});
  scene_.add_to(arguments);
  image_ = room(outputs);
  states_ = room(state_counts);
  arguments.add(keep(cl.upload(job.colours)), image_, states_);
  if (form_.random_cap) arguments.add(keep(cl.upload(job.cap)));
  if (form_.stiles_crawford) arguments.add(static_cast<cl_float>(job.pupil_falloff.value()));
  if (form_.diffraction) arguments.add(keep(cl.upload(job.airy)));
  if (job.map)
    arguments.add(static_cast<cl_int>(job.system.kinds.size()), static_cast<cl_int>(job.grid.width),
                  static_cast<cl_int>(job.grid.height), static_cast<cl_float>(job.map->plane_z_mm),
                  keep(cl.upload(job.map->rows(job.grid.height, form_.lanes))),
                  keep(cl.upload(job.map->column_weights(job.grid.width))));
  if (job.change) {
    derivatives_ = room(3 * form_.tangents);
    arguments.add(in_form(job.change->values, job.change->floats_a_pixel),
                  static_cast<cl_int>(job.change->floats_a_pixel), keep(cl.upload(job.change->by_wave)),
                  derivatives_);
  }
  bytes_ += sizeof(float) * (job.system.records.size() + job.view.texels.size());
}

int DevicePicture::multiple() const { return form_.waves * form_.in_flight * (form_.tile ? 1 : form_.lanes); }

DevicePicture::Slice DevicePicture::items_of(const Band& band) const {
  return {first_items_[band.first], first_items_[band.end]};
}

std::size_t DevicePicture::items_a_call(int samples) const {
  const std::int64_t rays =
      cl_.info().compute_units *
      (job_.system.has(Operation::every_triangle) ? rays_a_call_every_triangle : rays_a_call);
  return static_cast<std::size_t>(
             std::max<std::int64_t>(work_group, rays / samples / work_group * work_group)) /
         order_.together;
}

std::size_t DevicePicture::calls(const std::vector<Band>& bands, int samples) const {
  std::size_t calls = 0;
  for (const Band& band : bands) {
    const Slice items = items_of(band);
    calls += (items.end - items.first + items_a_call(samples) - 1) / items_a_call(samples);
  }
  return calls;
}

void DevicePicture::trace(const std::vector<Band>& bands, std::uint64_t seed, int first_sample, int samples,
                          Progress& progress) {
  last_samples_ = samples;
  kernel_.setArg(place_of_slice_ + 2, static_cast<cl_int>(samples));
  kernel_.setArg(place_of_slice_ + 3, static_cast<cl_uint>(first_sample));
  kernel_.setArg(place_of_slice_ + 4, static_cast<cl_uint>(seed * 2654435761U + (seed >> 32U)));
  for (const Band& band : bands) {
    const Slice items = items_of(band);
    for (std::size_t first = items.first; first < items.end; first += items_a_call(samples)) {
      const std::size_t count = std::min(items_a_call(samples), items.end - first);
      kernel_.setArg(place_of_slice_, static_cast<cl_int>(first));
      kernel_.setArg(place_of_slice_ + 1, static_cast<cl_int>(count));
      cl_.queue().enqueueNDRangeKernel(kernel_, cl::NullRange,
                                       cl::NDRange((count + group() - 1) / group() * group()),
                                       cl::NDRange(group()));
      cl_.queue().finish();
      progress.advance();
    }
  }
}

void DevicePicture::add_to(PictureSums& sums, const std::vector<Band>& bands) {
  const int changes = 3 * static_cast<int>(form_.tangents);
  const auto read = [&](const cl::Buffer& buffer, std::size_t values, const Slice& items, auto& into) {
    into.resize((items.end - items.first) * order_.together * values);
    const std::size_t one = sizeof(into[0]);
    if (!into.empty())
      cl_.queue().enqueueReadBuffer(buffer, CL_TRUE, items.first * order_.together * values * one,
                                    into.size() * one, into.data());
  };
  std::vector<float> image, derivatives;
  std::vector<cl_int> states;
  for (const Band& band : bands) {
    const Slice items = items_of(band);
    read(image_, outputs, items, image);
    read(states_, state_counts, items, states);
    if (changes > 0) read(derivatives_, changes, items, derivatives);
    const std::size_t first_place = items.first * order_.together;
    for (std::size_t place = 0; place < (items.end - items.first) * order_.together; ++place) {
      if (order_.pixels[first_place + place] < 0) continue;
      const std::size_t pixel = order_.pixels[first_place + place];
      if (job_.pixels.is_unseen(pixel)) continue;
      const float weight = image[order_.at(place, outputs, 3)] * static_cast<float>(last_samples_);
      for (int c = 0; c < 3; ++c) sums.light[pixel * 3 + c] += weight * image[order_.at(place, outputs, c)];
      sums.weight[pixel] += weight;
      for (int k = 0; k < changes; ++k)
        sums.derivatives[pixel * changes + k] += weight * derivatives[order_.at(place, changes, k)];
      for (int s = 0; s < state_counts; ++s) sums.counts[s] += states[order_.at(place, state_counts, s)];
    }
  }
}

}  // namespace emmetrope::raytrace
