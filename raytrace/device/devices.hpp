#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace emmetrope::raytrace {

/// An OpenCL device as `emmetrope devices` lists it.
struct DeviceInfo {
  int index = 0;
  std::string name, vendor, platform, driver, opencl_version;
  std::string type;  ///< "CPU", "GPU" or "other"
  int compute_units = 0, clock_MHz = 0, float_vector_width = 0;
  std::uint64_t memory_bytes = 0, local_memory_bytes = 0;
  bool float64 = false;
  /// "name (driver)": what provenance records.
  std::string description() const { return name + " (" + platform + ", driver " + driver + ")"; }
};

/// All devices of all platforms, in the order of their indices.
/// \param threads  for CPU devices, where more than 0; has an effect before the first OpenCL call of the
///   process only
/// \throw Error (no_device) where there is no platform or device, or the kernel cache cannot be written
std::vector<DeviceInfo> list_devices(int threads = 0);

/// The devices of a list such as "0,2" or "gpu": indices, or each the first whose name contains the word;
/// "all" of them; the first where nothing is wanted.
/// \throw Error (no_device) naming the devices of this machine
std::vector<DeviceInfo> chosen_devices(const std::vector<DeviceInfo>& devices, const std::string& wanted);

/// The folder for compiled kernels: POCL_CACHE_DIR where it is set, else emmetrope/kernels below
/// XDG_CACHE_HOME or .cache in the home folder. PoCL cannot start where it is not writable.
std::filesystem::path kernel_cache_folder();

}  // namespace emmetrope::raytrace
