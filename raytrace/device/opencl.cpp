#include "raytrace/device/opencl.hpp"

#include <fcntl.h>
#include <pwd.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <cstdlib>
#include <thread>

#include "pipeline/base/error.hpp"
#include "pipeline/base/memory_limit.hpp"

namespace emmetrope {
extern const char kernel_lanes[];
extern const char kernel_surfaces[];
extern const char kernel_fast[];
extern const char kernel_paper[];
extern const char kernel_textures[];
extern const char kernel_meshes[];
extern const char kernel_scene[];
extern const char kernel_light[];
extern const char kernel_trace[];
}  // namespace emmetrope

namespace emmetrope::raytrace {
namespace {

Error device_error(const std::string& what, const std::string& remedy) {
  return {ExitStatus::no_device, what, remedy};
}

constexpr off_t kernel_cache_bytes = 20'000'000;

/// What PoCL's library for the machine's layout (hwloc) should take for granted where /sys, from which it reads
/// cores and memory, is not mounted: PoCL ends the process otherwise. Children, and what else of this process asks hwloc,
/// are told the same.
void describe_machine_without_sys() {
  std::error_code hidden;
  if (std::filesystem::exists("/sys/devices/system/cpu", hidden)) return;
  const auto memory_bytes =
      static_cast<std::uint64_t>(sysconf(_SC_PHYS_PAGES)) * static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE));
  const std::string layout = "node:1(memory=" + std::to_string(memory_bytes) +
                             ") core:" + std::to_string(std::max(1U, std::thread::hardware_concurrency())) +
                             " pu:1";
  setenv("HWLOC_SYNTHETIC", layout.c_str(), 0);
}

/// PoCL compiles to files, which it maps to run; in a folder where it cannot write or run them it finds no device
/// or ends the process. So the folder is chosen and tried before the first OpenCL call, and is private: never
/// below a shared temporary folder.
void prepare_kernel_cache(int threads) {
  static std::once_flag once;
  std::call_once(once, [threads] {
    const std::filesystem::path folder = kernel_cache_folder();
    std::error_code fault;
    std::filesystem::create_directories(folder, fault);
    std::string probe = (folder / "probe-XXXXXX").string();
    const int file = fault ? -1 : mkstemp(probe.data());
    // PoCL ends the process where its compiler cannot write.
    const bool written = file >= 0 && posix_fallocate(file, 0, kernel_cache_bytes) == 0;
    bool may_run = false;
    if (file >= 0) {
      void* code = mmap(nullptr, 1, PROT_READ | PROT_EXEC, MAP_PRIVATE, file, 0);
      may_run = code != MAP_FAILED;
      if (may_run) munmap(code, 1);
      close(file);
      unlink(probe.c_str());
    }
    if (!written)
      throw device_error("the folder for compiled OpenCL kernels, " + folder.string() +
                             ", cannot be written, or has not 20 MB free",
                         "set POCL_CACHE_DIR to a private writable folder with some 20 MB free");
    if (!may_run)
      throw device_error("nothing may be run from the folder for PoCL's compiled kernels, " +
                             folder.string() + " (mounted noexec, say)",
                         "set POCL_CACHE_DIR to a private folder from which programs may be run");
    setenv("POCL_CACHE_DIR", folder.c_str(), 1);
    describe_machine_without_sys();
    if (threads > 0) setenv("POCL_MAX_PTHREAD_COUNT", std::to_string(threads).c_str(), 0);
  });
}

std::string lower(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

std::string trimmed(std::string text) {
  while (!text.empty() && (text.back() == '\0' || std::isspace(static_cast<unsigned char>(text.back()))))
    text.pop_back();
  return text;
}

std::vector<cl::Device> all_devices(int threads) {
  prepare_kernel_cache(threads);
  std::vector<cl::Platform> platforms;
  try {
    cl::Platform::get(&platforms);
  } catch (const cl::Error&) {
    platforms.clear();
  }
  std::vector<cl::Device> devices;
  for (auto& platform : platforms) {
    std::vector<cl::Device> some;
    try {
      platform.getDevices(CL_DEVICE_TYPE_ALL, &some);
    } catch (const cl::Error&) {
      continue;  // a platform without devices
    }
    devices.insert(devices.end(), some.begin(), some.end());
  }
  if (devices.empty())
    throw device_error(
        platforms.empty() ? "there is no OpenCL platform on this machine"
                          : "no OpenCL platform of this machine offers a device",
        "install pocl-opencl-icd, which computes on the CPU, or your GPU's OpenCL driver" +
            (memory_limit_bytes() ? "; or it found too little memory" + memory_limit_note() : ""));
  return devices;
}

DeviceInfo describe(const cl::Device& device, int index) {
  DeviceInfo info;
  info.index = index;
  info.name = trimmed(device.getInfo<CL_DEVICE_NAME>());
  info.vendor = trimmed(device.getInfo<CL_DEVICE_VENDOR>());
  info.platform = trimmed(cl::Platform(device.getInfo<CL_DEVICE_PLATFORM>()).getInfo<CL_PLATFORM_NAME>());
  info.driver = trimmed(device.getInfo<CL_DRIVER_VERSION>());
  info.opencl_version = trimmed(device.getInfo<CL_DEVICE_VERSION>());
  const cl_device_type type = device.getInfo<CL_DEVICE_TYPE>();
  info.type = (type & CL_DEVICE_TYPE_CPU) != 0 ? "CPU" : (type & CL_DEVICE_TYPE_GPU) != 0 ? "GPU" : "other";
  info.compute_units = static_cast<int>(device.getInfo<CL_DEVICE_MAX_COMPUTE_UNITS>());
  info.clock_MHz = static_cast<int>(device.getInfo<CL_DEVICE_MAX_CLOCK_FREQUENCY>());
  info.float_vector_width = static_cast<int>(device.getInfo<CL_DEVICE_NATIVE_VECTOR_WIDTH_FLOAT>());
  info.memory_bytes = device.getInfo<CL_DEVICE_GLOBAL_MEM_SIZE>();
  info.local_memory_bytes = device.getInfo<CL_DEVICE_LOCAL_MEM_SIZE>();
  info.float64 = device.getInfo<CL_DEVICE_DOUBLE_FP_CONFIG>() != 0;
  return info;
}

}  // namespace

std::filesystem::path kernel_cache_folder() {
  const auto variable = [](const char* name) {
    const char* value = std::getenv(name);
    return std::string(value == nullptr ? "" : value);
  };
  if (const auto set = variable("POCL_CACHE_DIR"); !set.empty()) return set;
  if (const auto cache = variable("XDG_CACHE_HOME"); !cache.empty())
    return std::filesystem::path(cache) / "emmetrope" / "kernels";
  std::string home = variable("HOME");
  if (const passwd* user = ::getpwuid(::getuid()); home.empty() && user != nullptr) home = user->pw_dir;
  if (!home.empty()) return std::filesystem::path(home) / ".cache" / "emmetrope" / "kernels";
  throw device_error(
      "there is no folder for compiled OpenCL kernels: neither POCL_CACHE_DIR nor XDG_CACHE_HOME is set, and "
      "this user has no home",
      "set POCL_CACHE_DIR to a private writable folder");
}

namespace {

DeviceInfo device_called(const std::vector<DeviceInfo>& devices, const std::string& wanted) {
  if (!wanted.empty() && wanted.find_first_not_of("0123456789") == std::string::npos && wanted.size() < 9) {
    const int index = std::stoi(wanted);
    if (index < static_cast<int>(devices.size())) return devices[static_cast<std::size_t>(index)];
  } else if (!wanted.empty()) {
    for (const auto& device : devices)
      if (lower(device.name).find(lower(wanted)) != std::string::npos) return device;
  }
  std::string known;
  for (const auto& device : devices)
    known += (known.empty() ? "" : "; ") + std::to_string(device.index) + " " + device.name;
  throw device_error("--device: no OpenCL device is called \"" + wanted + "\"",
                     "this machine has: " + known + "; several are separated by commas, all takes every one");
}

}  // namespace

std::vector<DeviceInfo> chosen_devices(const std::vector<DeviceInfo>& devices, const std::string& wanted) {
  if (wanted.empty()) return {devices.front()};
  if (lower(wanted) == "all") return devices;
  std::vector<DeviceInfo> chosen;
  for (std::size_t first = 0; first <= wanted.size();) {
    const std::size_t end = std::min(wanted.find(',', first), wanted.size());
    const DeviceInfo device = device_called(devices, wanted.substr(first, end - first));
    for (const auto& other : chosen)
      if (other.index == device.index)
        throw device_error("--device: \"" + wanted + "\" names " + device.name + " twice",
                           "tell like devices apart by their indices; see emmetrope devices");
    chosen.push_back(device);
    first = end + 1;
  }
  return chosen;
}

std::vector<DeviceInfo> list_devices(int threads) {
  std::vector<DeviceInfo> result;
  for (const auto& device : all_devices(threads))
    result.push_back(describe(device, static_cast<int>(result.size())));
  return result;
}

void throw_device_error(const cl::Error& fault, const std::string& device) {
  const bool memory = fault.err() == CL_MEM_OBJECT_ALLOCATION_FAILURE || fault.err() == CL_OUT_OF_RESOURCES ||
                      fault.err() == CL_OUT_OF_HOST_MEMORY;
  throw device_error(
      "OpenCL device " + device + ": " + fault.what() + " failed with error " + std::to_string(fault.err()),
      memory ? "use a smaller image or another --device" : "try another --device; see emmetrope devices");
}

OpenCl::OpenCl(const DeviceInfo& device, int threads, int lanes) : info_(device), lanes_(lanes) {
  device_ = all_devices(threads).at(static_cast<std::size_t>(device.index));
  try {
    context_ = cl::Context(device_);
    queue_ = cl::CommandQueue(context_, device_);
  } catch (const cl::Error& fault) {
    throw_device_error(fault, info_.name);
  }
}

cl::Program& OpenCl::program(const std::string& definitions) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const auto known = programs_.find(definitions);
  if (known != programs_.end()) return known->second;
  const std::string source = std::string(kernel_lanes) + kernel_surfaces + kernel_paper + kernel_fast +
                             kernel_textures + kernel_meshes + kernel_scene + kernel_light + kernel_trace;
  cl::Program program(context_, source);
  try {
    program.build(std::vector<cl::Device>{device_}, definitions.c_str());
  } catch (const cl::Error&) {
    throw device_error(
        "OpenCL device " + info_.name + " cannot compile the kernels with " + definitions + ":\n" +
            program.getBuildInfo<CL_PROGRAM_BUILD_LOG>(device_),
        "delete " + kernel_cache_folder().string() + " and try again, or use another --device");
  }
  return programs_.emplace(definitions, std::move(program)).first->second;
}

}  // namespace emmetrope::raytrace
