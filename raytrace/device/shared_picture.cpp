#include "raytrace/device/shared_picture.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <mutex>

#include "pipeline/base/parallel.hpp"

namespace emmetrope::raytrace {
namespace {

/// Which rows of blocks each device takes: all of them where there is one, else bands dealt out by speed, so
/// that the split depends on nothing but the devices.
std::vector<std::vector<Band>> split(const std::vector<std::unique_ptr<OpenCl>>& devices, int height) {
  const int rows = static_cast<int>(block_edges(height).size()) - 1;
  if (devices.size() == 1) return {{{0, rows}}};
  std::vector<std::vector<Band>> bands(devices.size());
  const auto speed = [&](std::size_t i) {
    const DeviceInfo& info = devices[i]->info();
    return 1.0 * info.compute_units * std::max(1, info.clock_MHz) * (info.type == "CPU" ? 16 : 64);
  };
  for (int row = 0; row < rows; ++row) {
    std::size_t next = 0;
    const auto loaded = [&](std::size_t i) { return static_cast<double>(bands[i].size() + 1) / speed(i); };
    for (std::size_t i = 1; i < devices.size(); ++i)
      if (loaded(i) < loaded(next)) next = i;
    bands[next].push_back({row, row + 1});
  }
  return bands;
}

/// Of the mean of two halves, rms over the channels of pixels that see anything, in levels of 255.
double standard_error(const PictureSums& a, const PictureSums& b) {
  double sum = 0;
  std::size_t values = 0;
  for (std::size_t i = 0; i < a.light.size(); ++i) {
    const double wa = a.weight[i / 3], wb = b.weight[i / 3];
    if (!(wa > 0 && wb > 0)) continue;
    sum += std::pow((a.light[i] / wa - b.light[i] / wb) / 2, 2);
    ++values;
  }
  return values > 0 ? 255 * std::sqrt(sum / static_cast<double>(values)) : 0;
}

}  // namespace

SharedPicture::SharedPicture(const std::vector<std::unique_ptr<OpenCl>>& devices, const PictureJob& job)
    : devices_(devices), job_(job), bands_(split(devices, job.grid.height)), parts_(devices.size()) {
  on_all([&](std::size_t i) { parts_[i].emplace(*devices_[i], job); });
}

void SharedPicture::on_all(const std::function<void(std::size_t)>& work) const {
  on_threads(static_cast<int>(devices_.size()), devices_.size(), [&](std::size_t i) {
    try {
      work(i);
    } catch (const cl::Error& fault) {
      throw_device_error(fault, devices_[i]->info().name);
    }
  });
}

int SharedPicture::rounded_up(double samples) const {
  int multiple = 1;  // they are powers of two
  for (const auto& part : parts_) multiple = std::max(multiple, part->multiple());
  return static_cast<int>(std::ceil(samples / multiple)) * multiple;
}

std::uint64_t SharedPicture::bytes() const {
  std::uint64_t sum = 0;
  for (const auto& part : parts_) sum += part->bytes();
  return sum;
}

PictureSums SharedPicture::no_samples() const {
  const std::size_t pixels = job_.pixels.area_mm2.size();
  PictureSums sums;
  sums.light.resize(3 * pixels);
  sums.weight.resize(pixels);
  sums.derivatives.resize(3 * pixels * job_.form.tangents);
  return sums;
}

void SharedPicture::add_samples(PictureSums& sums, std::uint64_t seed, int wanted, const std::string& doing,
                                Verbosity verbosity) {
  const int samples = rounded_up(wanted);
  std::size_t calls = 0;
  for (std::size_t i = 0; i < parts_.size(); ++i) calls += parts_[i]->calls(bands_[i], samples);
  Progress progress(doing, calls, verbosity);
  std::mutex adding;
  on_all([&](std::size_t i) {
    parts_[i]->trace(bands_[i], seed, sums.samples, samples, progress);
    const std::lock_guard<std::mutex> lock(adding);
    parts_[i]->add_to(sums, bands_[i]);
  });
  sums.samples += samples;
}

SharedPicture::Estimate SharedPicture::until(double wanted, std::uint64_t seed, int most,
                                             Verbosity verbosity) {
  const int most_of_half = rounded_up(most / 2.0);
  PictureSums sums = no_samples(), other = no_samples();
  int samples = std::min(most_of_half, rounded_up(16));
  double error = 0;
  std::string doing = "tracing";
  for (;;) {
    add_samples(sums, seed, samples, doing, verbosity);
    add_samples(other, seed + (std::uint64_t{1} << 33U) + 1, samples, doing, verbosity);
    error = standard_error(sums, other);
    if (error <= wanted || sums.samples >= most_of_half) break;
    // Errors fall about as the number of samples rises; never more than three times as many at once.
    const double more = std::clamp(error / wanted - 1, 0.1, 2.0) * sums.samples;
    samples = std::min(most_of_half - sums.samples, rounded_up(more));
    doing = fmt::format("tracing, standard error {:.3g} of {:.3g}", error, wanted);
  }
  const auto add = [](auto& to, const auto& from) {
    std::transform(to.begin(), to.end(), from.begin(), to.begin(), std::plus<>());
  };
  add(sums.light, other.light);
  add(sums.weight, other.weight);
  add(sums.derivatives, other.derivatives);
  add(sums.counts, other.counts);
  sums.samples += other.samples;
  return {std::move(sums), error};
}

}  // namespace emmetrope::raytrace
