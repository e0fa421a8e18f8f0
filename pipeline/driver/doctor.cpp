#include "pipeline/driver/doctor.hpp"

#include <dcmtk/config/osconfig.h>
#include <fmt/format.h>
#include <fontconfig/fontconfig.h>
#include <unistd.h>

#include <cstdlib>
#include <memory>
#include <sstream>

#include "pipeline/base/files.hpp"
#include "pipeline/base/process.hpp"
#include "pipeline/driver/commands.hpp"

namespace emmetrope::driver {
namespace {

namespace fs = std::filesystem;

struct Check {
  std::string name;
  bool good = true;
  std::string found;
  std::string remedy;                    ///< where it is not good
  ExitStatus status = ExitStatus::done;  ///< what commands would end with; done for an optional thing
};

Check check_commands() {
  Check check{"commands", true, "all in " + executable_folder().string(), {}, ExitStatus::done};
  for (const auto& command : commands) {
    const auto program = executable_folder() / (std::string("emmetrope-") + command.name);
    if (std::string(command.name) == "help" || ::access(program.c_str(), X_OK) == 0) continue;
    return {"commands", false, program.string() + " is missing",
            "install Emmetrope again with cmake --install", ExitStatus::fault};
  }
  return check;
}

/// Asks in a process of its own: a damaged kernel cache or a broken driver may end the process that loads it.
Check check_opencl(const CommonOptions& common) {
  std::vector<std::string> arguments{"--json", "--quiet"};
  if (!common.device.empty()) arguments.insert(arguments.end(), {"--device", common.device});
  const ProcessResult asked =
      run_process(executable_folder() / "emmetrope-devices", arguments, ChildOutput::capture);
  const Json answer = Json::parse(asked.output, nullptr, false);
  if (asked.status == 0 && answer.contains("devices") && !answer["devices"].empty()) {
    const Json& device = answer["devices"][0];
    return {"OpenCL",
            true,
            device.value("name", "a device") + ", kernel cache " + answer.value("kernel_cache", "default"),
            {},
            ExitStatus::done};
  }
  std::string found = fmt::format("emmetrope devices ended with status {}", asked.status);
  std::string remedy =
      "apt-get install pocl-opencl-icd; if it is there, remove its kernel cache (~/.cache/emmetrope)";
  if (answer.is_object() && answer.contains("error")) {
    found = answer["error"].value("message", found);
    if (const std::string said = answer["error"].value("remedy", ""); !said.empty()) remedy = said;
  }
  return {"OpenCL", false, found, remedy, ExitStatus::no_device};
}

Check check_disk() {
  constexpr double needed_GB = 1;  // a case with its report is 50 to 300 MB
  std::error_code fault;
  const fs::path here = fs::current_path(fault);
  if (fault)
    return {"disk", false, "the current folder: " + fault.message(), "work in a folder of yours",
            ExitStatus::not_writable};
  const auto space = fs::space(here, fault);
  const double free_GB = fault ? 0 : static_cast<double>(space.available) / 1e9;
  const std::string found = fmt::format("{:.1f} GB free in {}", free_GB, here.string());
  if (::access(".", W_OK) != 0)
    return {"disk", false, here.string() + " is not writable", "work in a folder of yours",
            ExitStatus::not_writable};
  if (free_GB < needed_GB)
    return {"disk", false, found, "free some disk space: 1 GB", ExitStatus::not_writable};
  return {"disk", true, found, {}, ExitStatus::done};
}

/// The report's PDF is set in a sans-serif font that has the minus sign and the degree sign.
Check check_fonts() {
  const std::unique_ptr<FcPattern, decltype(&FcPatternDestroy)> pattern(
      FcNameParse(reinterpret_cast<const FcChar8*>("DejaVu Sans")), &FcPatternDestroy);
  FcConfigSubstitute(nullptr, pattern.get(), FcMatchPattern);
  FcDefaultSubstitute(pattern.get());
  FcResult result = FcResultNoMatch;
  const std::unique_ptr<FcPattern, decltype(&FcPatternDestroy)> match(
      FcFontMatch(nullptr, pattern.get(), &result), &FcPatternDestroy);
  FcChar8* family = nullptr;
  if (match == nullptr || FcPatternGetString(match.get(), FC_FAMILY, 0, &family) != FcResultMatch)
    return {"fonts", false, "no font at all", "apt-get install fonts-dejavu-core", ExitStatus::fault};
  const std::string name = reinterpret_cast<const char*>(family);
  if (name != "DejaVu Sans")
    return {"fonts", false, "only " + name, "apt-get install fonts-dejavu-core", ExitStatus::done};
  return {"fonts", true, name, {}, ExitStatus::done};
}

/// Files of unknown origin are parsed in a process that can do little else; what of that this kernel grants.
Check check_confinement() {
  const ProcessResult asked =
      run_process(executable_folder() / "emmetrope-decode", {"--confinement"}, ChildOutput::capture);
  std::string granted = asked.output.substr(0, asked.output.find('\n'));
  if (asked.status != 0 || granted.empty())
    return {"decoder", false, fmt::format("emmetrope-decode ended with status {}", asked.status),
            "install Emmetrope again with cmake --install", ExitStatus::fault};
  const bool whole = granted == "seccomp and Landlock";
  return {"decoder", whole, "reads files of unknown origin confined by " + granted,
          "a kernel with seccomp and Landlock (Linux 5.13 and later) confines it further", ExitStatus::done};
}

Check check_charts() {
  if (find_program("gnuplot")) return {"charts", true, "gnuplot", {}, ExitStatus::done};
  return {"charts", false, "gnuplot is missing: reports come without charts", "apt-get install gnuplot-nox",
          ExitStatus::done};
}

Check check_cohorts() {
  if (find_program("snakemake")) return {"cohorts", true, "snakemake", {}, ExitStatus::done};
  return {"cohorts", false, "snakemake is missing: emmetrope cohort does not run",
          "apt-get install --no-install-recommends snakemake", ExitStatus::done};
}

/// Where this build of DCMTK looks first.
fs::path default_dictionary() {
  const std::string searched = DCM_DICT_DEFAULT_PATH;
  return searched.substr(0, searched.find(':'));
}

Check check_dictionary() {
  const char* given = std::getenv("DCMDICTPATH");
  const fs::path dictionary = given == nullptr ? default_dictionary() : given;
  if (fs::exists(dictionary)) return {"DICOM dictionary", true, dictionary.string(), {}, ExitStatus::done};
  return {"DICOM dictionary", false, dictionary.string() + " is missing",
          "apt-get install --reinstall dcmtk-data (libdcmtk17 on Debian 12), and unset DCMDICTPATH",
          ExitStatus::input_invalid};
}

}  // namespace

Answer examine_machine(const CommonOptions& common) {
  Answer answer;
  answer.json = Json{{"checks", Json::array()}};
  for (const Check& check : {check_commands(), check_opencl(common), check_disk(), check_fonts(),
                             check_charts(), check_cohorts(), check_dictionary(), check_confinement()}) {
    answer.json["checks"].push_back(
        Json{{"name", check.name}, {"good", check.good}, {"found", check.found}, {"remedy", check.remedy}});
    answer.text += fmt::format("{:<5}{:<18}{}\n", check.good ? "ok" : "bad", check.name, check.found);
    if (!check.good) answer.text += fmt::format("     {:<18}remedy: {}\n", "", check.remedy);
    if (answer.status == ExitStatus::done) answer.status = check.status;
  }
  return answer;
}

}  // namespace emmetrope::driver
