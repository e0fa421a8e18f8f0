#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "pipeline/base/command_line.hpp"
#include "raytrace/device/devices.hpp"

namespace {

emmetrope::Answer list(const emmetrope::CommonOptions& common) {
  using emmetrope::Json;
  emmetrope::Answer answer;
  Json devices = Json::array();
  auto listed = emmetrope::raytrace::list_devices(common.threads);
  if (!common.device.empty()) listed = emmetrope::raytrace::chosen_devices(listed, common.device);
  for (const auto& d : listed) {
    devices.push_back({{"index", d.index},
                       {"name", d.name},
                       {"type", d.type},
                       {"vendor", d.vendor},
                       {"platform", d.platform},
                       {"driver", d.driver},
                       {"opencl", d.opencl_version},
                       {"compute_units", d.compute_units},
                       {"clock_MHz", d.clock_MHz},
                       {"float_vector_width", d.float_vector_width},
                       {"memory_bytes", d.memory_bytes},
                       {"local_memory_bytes", d.local_memory_bytes},
                       {"float64", d.float64}});
    answer.text +=
        fmt::format("{}  {} {} ({}, driver {}): {} compute units, {:.1f} GB\n", d.index, d.type, d.name,
                    d.platform, d.driver, d.compute_units, static_cast<double>(d.memory_bytes) / 1e9);
  }
  const std::string folder = emmetrope::raytrace::kernel_cache_folder().string();
  answer.json = {{"devices", devices}, {"kernel_cache", folder}};
  answer.text += "compiled kernels are kept in " + folder + "\n";
  return answer;
}

}  // namespace

int main(int argc, char** argv) {
  emmetrope::Command command;
  command.name = "devices";
  command.summary = "Lists the OpenCL devices of this machine; --device takes an index or a name from here.";
  command.example = "emmetrope devices";
  command.declare = [](CLI::App&) {};
  command.run = list;
  return emmetrope::run_command(argc, argv, command);
}
