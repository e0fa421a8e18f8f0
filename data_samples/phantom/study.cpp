#include "data_samples/phantom/study.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

#include "data_samples/phantom/truth.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/base/interrupt.hpp"

namespace emmetrope::phantom {
namespace {

namespace fs = std::filesystem;

const char* name_of(SliceProfile profile) {
  switch (profile) {
    case SliceProfile::box:
      return "box";
    case SliceProfile::trapezoid:
      return "trapezoid";
    case SliceProfile::gaussian:
      return "gaussian";
    case SliceProfile::encoded:
      return "encoded";
  }
  return "";
}
const char* name_of(Window window) {
  return window == Window::none ? "none" : window == Window::hann ? "hann" : "fermi";
}
const char* name_of(Coil coil) {
  return coil == Coil::uniform ? "uniform" : coil == Coil::surface ? "surface" : "head";
}

Json to_json(const StackPlan& plan) {
  Json json{{"name", plan.name},
            {"contrast", to_string(plan.contrast)},
            {"columns", plan.columns},
            {"rows", plan.rows},
            {"slices", plan.slices},
            {"pixel_mm", plan.pixel_mm},
            {"slice_thickness_mm", plan.slice_thickness_mm},
            {"slice_spacing_mm", plan.slice_spacing_mm},
            {"profile", name_of(plan.profile)},
            {"coil", name_of(plan.coil)},
            {"acquired_readout", plan.acquired_readout},
            {"acquired_phase", plan.acquired_phase},
            {"centre_lps_mm", to_json_vector(plan.centre)},
            {"along_row", to_json_vector(plan.along_row)},
            {"along_column", to_json_vector(plan.along_column)}};
  // Without fat suppression the text, and the identifiers made from it, are as they always were.
  if (plan.fat_left < 1) json["fat_left"] = plan.fat_left;
  return json;
}

Json to_json(const Disturbances& d) {
  Json json{{"snr", d.snr},
            {"motion_mm", d.motion_mm},
            {"motion_deg", d.motion_deg},
            {"slice_motion_mm", d.slice_motion_mm},
            {"scale_error", d.scale_error},
            {"chemical_shift_px", d.chemical_shift_px},
            {"seed", d.seed}};
  // Of a world; without one the text, and the identifiers made from it, are as they always were.
  if (d.window != Window::none) json["window"] = name_of(d.window);
  for (const auto& [name, amount] : {std::pair{"noise_variation", d.noise_variation},
                                     {"echo_train", d.echo_train},
                                     {"ghost", d.ghost},
                                     {"slice_gain", d.slice_gain}})
    if (amount != 0) json[name] = amount;
  return json;
}

Json to_json(const Protocol& protocol) {
  Json stacks = Json::array();
  for (const StackPlan& plan : protocol.stacks) stacks.push_back(to_json(plan));
  return {{"protocol", protocol.name}, {"disturbances", to_json(protocol.disturbances)}, {"stacks", stacks}};
}

/// "od coronal T2" as a folder's name: "1_od_coronal_t2".
std::string folder_name(const StackPlan& plan, std::size_t index) {
  std::string name = fmt::format("{}_{}", index + 1, plan.name);
  std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) {
    return std::isalnum(c) != 0 ? static_cast<char>(std::tolower(c)) : '_';
  });
  return name;
}

void check_target(const fs::path& out, bool replace) {
  if (!fs::exists(out) || (fs::is_directory(out) && fs::is_empty(out))) return;
  if (!fs::exists(out / "truth.json"))
    throw output_error(
        fmt::format("{} is no phantom study (it has no truth.json), so it is not replaced", out.string()),
        "choose another folder");
  if (!replace)
    throw output_error(fmt::format("{} exists", out.string()), "choose another folder or use --force");
}

/// An earlier study gives way, whatever else lies in its folder stays.
void put_in_place(const fs::path& fresh, const fs::path& target) {
  if (!fs::exists(target)) return fs::rename(fresh, target);
  const fs::path old = fresh / "old";
  fs::create_directory(old);
  for (const char* part : {"dicom", "truth.json"}) {
    if (fs::exists(target / part)) fs::rename(target / part, old / part);
    fs::rename(fresh / part, target / part);
  }
  fs::remove_all(fresh);
}

}  // namespace

Json write_study(const fs::path& out, const StudyRequest& request, bool replace, int threads,
                 Verbosity verbosity) {
  check_target(out, replace);
  const Anatomy anatomy(request.head);
  const Protocol& protocol = request.protocol;
  Json answer = truth(request.head);
  const Json acquisition = to_json(protocol);
  const StudyIdentity identity{answer["head"].dump() + acquisition.dump(), request.head.age_years};

  fs::path target = fs::absolute(out).lexically_normal();
  if (!target.has_filename()) target = target.parent_path();  // "study/"
  const fs::path beside = target.parent_path() / fmt::format(".{}.part", target.filename().string());
  std::error_code fault;
  fs::remove_all(beside, fault);
  fs::create_directories(beside, fault);
  if (fault)
    throw output_error(fmt::format("{}: {}", beside.string(), fault.message()), "choose another folder");
  const RemoveOnInterrupt temporary(beside);

  try {
    std::size_t slices = 0;
    for (const StackPlan& plan : protocol.stacks) slices += static_cast<std::size_t>(plan.slices);
    Progress progress("rendering slices", slices, verbosity);
    answer["acquisition"] = acquisition;
    for (std::size_t i = 0; i < protocol.stacks.size(); ++i) {
      const RenderedStack stack = render(anatomy, protocol, i, threads, [&] { progress.advance(); });
      const int number = static_cast<int>(i) + 1;
      const std::string folder = folder_name(stack.plan, i);
      write_series(beside / "dicom" / folder, stack, number, identity, request.compression);
      Json& entry = answer["acquisition"]["stacks"][i];
      entry["folder"] = "dicom/" + folder;
      entry["series_uid"] = identity.uid(fmt::format("series {}", number));
      entry["sigma"] = stack.sigma;
      entry["scanner_from_reference"] = to_json_matrix(stack.scanner_from_reference);
    }
    write_json(beside / "truth.json", answer);
    const auto hold = hold_interrupts();
    put_in_place(beside, target);
  } catch (const fs::filesystem_error& problem) {
    fs::remove_all(beside, fault);
    throw output_error(problem.what(), "check the disk's space and permissions");
  } catch (...) {
    fs::remove_all(beside, fault);
    throw;
  }
  return answer;
}

}  // namespace emmetrope::phantom
