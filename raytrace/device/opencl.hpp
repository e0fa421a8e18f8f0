#pragma once
// The only header that sees OpenCL; included by the tracer's own .cpp files.
#define CL_HPP_ENABLE_EXCEPTIONS
#define CL_HPP_MINIMUM_OPENCL_VERSION 120
#define CL_HPP_TARGET_OPENCL_VERSION 120
#include <CL/opencl.hpp>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "raytrace/device/devices.hpp"

namespace emmetrope::raytrace {

/// A device with its context, queue and compiled programs.
class OpenCl {
 public:
  /// \param device  of list_devices()
  /// \param lanes  rays a work-item carries, 1 or 16; 0: what suits the device
  /// \throw Error (no_device)
  OpenCl(const DeviceInfo& device, int threads, int lanes);

  const DeviceInfo& info() const { return info_; }
  /// Lanes a work-item should carry: 16 on a CPU, 1 elsewhere.
  int lanes() const { return lanes_ > 0 ? lanes_ : info_.type == "CPU" ? 16 : 1; }
  cl::CommandQueue& queue() { return queue_; }

  /// The kernels, compiled with these definitions ("-DCHANNELS=1 ..."), from memory or from the disk cache.
  /// \throw Error (no_device) with the compiler's words
  cl::Program& program(const std::string& definitions);

  /// A copy of `values` on the device; one element where there are none.
  template <typename T>
  cl::Buffer upload(const std::vector<T>& values) const {
    static const T nothing{};
    const T* data = values.empty() ? &nothing : values.data();
    const std::size_t bytes = std::max<std::size_t>(1, values.size()) * sizeof(T);
    // Written at once: NVIDIA's driver puts off copies that a buffer is made with to the first kernel that reads it.
    cl::Buffer buffer(context_, CL_MEM_READ_ONLY, bytes);
    queue_.enqueueWriteBuffer(buffer, CL_TRUE, 0, bytes, data);
    return buffer;
  }
  /// `values` where a device computes in the host's memory, which must then outlive the buffer; else a copy.
  template <typename T>
  cl::Buffer share(const std::vector<T>& values) const {
    if (values.empty() || info_.type != "CPU") return upload(values);
    return {context_, CL_MEM_READ_ONLY | CL_MEM_USE_HOST_PTR, values.size() * sizeof(T),
            const_cast<T*>(values.data())};
  }
  cl::Buffer allocate(std::size_t bytes) const { return {context_, CL_MEM_READ_WRITE, bytes}; }

 private:
  DeviceInfo info_;
  int lanes_;
  cl::Device device_;
  cl::Context context_;
  cl::CommandQueue queue_;
  std::map<std::string, cl::Program> programs_;
  std::mutex mutex_;
};

/// What an OpenCL call's failure means for the user.
[[noreturn]] void throw_device_error(const cl::Error& fault, const std::string& device);

}  // namespace emmetrope::raytrace
