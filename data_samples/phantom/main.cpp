#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <optional>

#include "data_samples/phantom/phantom.hpp"
#include "pipeline/base/command_line.hpp"

namespace {

using namespace emmetrope;
using namespace emmetrope::phantom;

struct Options {
  std::string out;
  std::string protocol = "surface-coil";
  std::vector<std::string> stacks;
  std::optional<std::uint64_t> random, keratoconus;
  std::string geometry, od, os, head;
  std::vector<double> gaze;
  std::optional<double> roll, snr;
  std::string world;
  Disturbances disturbances;
  Compression compression = Compression::none;
};

HeadGeometry geometry_of(const Options& options) {
  HeadGeometry head = options.random        ? random_head(*options.random)
                      : options.keratoconus ? random_keratoconus(*options.keratoconus)
                                            : sample_head();
  if (!options.geometry.empty()) {
    const Json json = read_json(options.geometry);
    head = head_from_json(json.contains("head") ? json["head"] : json);  // a truth.json will do
  }
  set_fields(head, options.head);
  set_fields(head.od, options.od);
  set_fields(head.os, options.os);
  if (!options.gaze.empty())
    for (const Laterality eye : both_eyes) {
      head.eye(eye).gaze_horizontal_deg = options.gaze[0];
      head.eye(eye).gaze_vertical_deg = options.gaze[1];
    }
  if (options.roll) head.roll_deg = *options.roll;
  if (!options.world.empty()) furnish(head, options.world, options.random.value_or(0));
  return head;
}

Protocol protocol_of(const Options& options, const CommonOptions& common, const Anatomy& anatomy) {
  Protocol protocol = make_protocol(options.protocol, anatomy);
  const double preset_snr = protocol.disturbances.snr;
  if (!options.stacks.empty()) {
    protocol.name = "custom";
    protocol.stacks.clear();
    for (const std::string& words : options.stacks) protocol.stacks.push_back(make_stack(words, anatomy));
  }
  auto& stacks = protocol.stacks;
  stacks.erase(std::remove_if(stacks.begin(), stacks.end(),
                              [&](const StackPlan& plan) {
                                return plan.coil == Coil::surface &&
                                       !includes(common.laterality, plan.coil_eye);
                              }),
               stacks.end());
  if (stacks.empty())
    throw usage_error(
        "no stack is left: the surface coils of the stacks are not over the eye of --laterality",
        "give --laterality both or a --stack of that eye");
  protocol.disturbances = options.disturbances;
  protocol.disturbances.snr = options.snr.value_or(preset_snr);
  protocol.disturbances.seed = common.seed;
  if (protocol.disturbances.slice_motion_mm > 0 && all_encoded(protocol))
    throw usage_error("--slice-motion: encoded slices (3-D) are not excited one by one",
                      "give a --stack with another profile");
  if (!options.world.empty()) disturb(protocol, options.world, options.random.value_or(0));
  return protocol;
}

std::string summary(const Json& truth, const std::string& out) {
  std::string text;
  for (const auto& [name, eye] : truth["eyes"].items())
    text += fmt::format(
        "{}  axial length {:.2f} mm  K {:.2f} D at {:.0f} / {:.2f} D at {:.0f}  ACD {:.2f} mm  lens {:.2f} "
        "mm\n",
        name, eye["axial_length_mm"].get<double>(), eye["keratometry"]["flat"]["power_D"].get<double>(),
        eye["keratometry"]["flat"]["axis_deg"].get<double>(),
        eye["keratometry"]["steep"]["power_D"].get<double>(),
        eye["keratometry"]["steep"]["axis_deg"].get<double>(), eye["anterior_chamber_depth_mm"].get<double>(),
        eye["lens_thickness_mm"].get<double>());
  return text + fmt::format("study in {0}/dicom, truth in {0}/truth.json\n", out);
}

void declare_geometry(CLI::App& app, Options& options) {
  app.add_option("-o,--output", options.out, "Folder to make: dicom/ and truth.json")->required();
  const std::string geometry = "Geometry";
  app.add_option("--random", options.random, "Eyes drawn from the population with this seed")
      ->group(geometry);
  app.add_option("--keratoconus", options.keratoconus, "The same eyes, each with a cone on its cornea")
      ->excludes("--random")
      ->group(geometry);
  app.add_option("--world", options.world,
                 fmt::format("Structures that the fit's model has not: {}", fmt::join(world_names(), ", ")))
      ->needs("--random")
      ->check(CLI::IsMember(world_names()).description(""))
      ->type_name("NAME")
      ->group(geometry);
  app.add_option("--geometry", options.geometry, "Geometry from a file (a truth.json will do)")
      ->check(CLI::ExistingFile)
      ->group(geometry);
  app.add_option("--od", options.od, "Right eye: key=value,... (keys in docs/use/phantom.md)")
      ->group(geometry);
  app.add_option("--os", options.os, "Left eye: key=value,...")->group(geometry);
  app.add_option("--head", options.head, "Head: key=value,...")->group(geometry);
  app.add_option("--gaze", options.gaze, "H,V of both eyes (deg; to the patient's left, up)")
      ->delimiter(',')
      ->expected(2)
      ->group(geometry);
  app.add_option("--head-roll", options.roll, "Roll (deg; positive: left eye higher)")->group(geometry);
}

void declare_acquisition(CLI::App& app, Options& options) {
  const std::string acquisition = "Acquisition";
  app.add_option("--protocol", options.protocol, "surface-coil, head-t2 or head-t1")
      ->capture_default_str()
      ->group(acquisition);
  app.add_option("--stack", options.stacks, "A stack instead of the protocol's: od-coronal:key=value,...")
      ->group(acquisition);
  app.add_option("--snr", options.snr, "Vitreous (T2) or fat (T1) over noise; 0: no noise")
      ->check(CLI::NonNegativeNumber)
      ->group(acquisition);
  app.add_option("--motion", options.disturbances.motion_mm, "Head shift between stacks, rms (mm)")
      ->check(CLI::NonNegativeNumber)
      ->group(acquisition);
  app.add_option("--motion-deg", options.disturbances.motion_deg, "Head rotation between stacks, rms (deg)")
      ->check(CLI::NonNegativeNumber)
      ->group(acquisition);
  app.add_option("--slice-motion", options.disturbances.slice_motion_mm, "Shift between slices, rms (mm)")
      ->check(CLI::NonNegativeNumber)
      ->group(acquisition);
  app.add_option("--scale-error", options.disturbances.scale_error, "Relative error of all lengths (0.003)")
      ->check(CLI::Range(-0.1, 0.1))
      ->group(acquisition);
  app.add_option("--chemical-shift", options.disturbances.chemical_shift_px,
                 "Shift of fat along rows (pixels)")
      ->check(CLI::Range(-10.0, 10.0))
      ->group(acquisition);
  const std::map<std::string, Compression> kinds{
      {"none", Compression::none}, {"jpeg", Compression::jpeg_lossless}, {"jpeg-ls", Compression::jpeg_ls}};
  app.add_option_function<std::string>(
         "--compress", [&options, kinds](const std::string& kind) { options.compression = kinds.at(kind); },
         "none, jpeg (lossless) or jpeg-ls")
      ->check(CLI::IsMember(kinds).description(""))
      ->type_name("KIND")
      ->group(acquisition);
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  Command command;
  command.name = "phantom";
  command.summary = "Makes an orbit MRI study with known truth.";
  command.example = "emmetrope phantom -o study --random 7 --protocol head-t2 --motion 0.3";
  command.declare = [&](CLI::App& app) {
    declare_geometry(app, options);
    declare_acquisition(app, options);
  };
  command.run = [&](const CommonOptions& common) {
    StudyRequest request;
    request.head = geometry_of(options);
    request.protocol = protocol_of(options, common, Anatomy(request.head));
    request.compression = options.compression;
    Answer answer;
    answer.json = write_study(options.out, request, common.force, common.thread_count(), common.verbosity);
    answer.text = summary(answer.json, options.out);
    return answer;
  };
  return run_command(argc, argv, command);
}
