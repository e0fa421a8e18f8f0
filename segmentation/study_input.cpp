#include "segmentation/study_input.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "pipeline/base/case_folder.hpp"
#include "segmentation/intake/file_list.hpp"
#include "segmentation/intake/series_warnings.hpp"
#include "segmentation/intake/tags.hpp"
#include "segmentation/intake/wire.hpp"

namespace emmetrope::segmentation {
namespace {

namespace fs = std::filesystem;

/// Whether the file lies somewhere below the folder.
bool is_below(const fs::path& file, const fs::path& folder) {
  const fs::path relative = fs::weakly_canonical(file).lexically_relative(fs::weakly_canonical(folder));
  return !relative.empty() && *relative.begin() != "..";
}

bool may_hold_images(const fs::path& path) {
  const fs::path extension = path.extension();
  return fs::is_directory(path) || is_nifti_name(path) || extension.empty() || extension == ".dcm" ||
         extension == ".IMA";
}

/// A study in the case's folder would be read as a case, not as images, from then on.
/// \pre the study exists
void check_case_folder(const SegmentOptions& options) {
  const fs::path study = fs::weakly_canonical(fs::absolute(options.study)),
                 folder = fs::weakly_canonical(fs::absolute(options.case_folder)),
                 images = fs::is_directory(study) ? study : study.parent_path();
  if (folder == images)
    throw usage_error("the case " + options.case_folder.string() +
                          " is the study's own folder; nothing is written among the images",
                      "give another folder with -o");
  if (!is_below(images, folder) || looks_like_a_case(folder)) return;
  // A patient's folder may hold the study and the case, but no other images, which the case would hide.
  for (fs::path path = images; path != folder; path = path.parent_path()) {
    std::error_code unreadable;
    for (const fs::path& other : fs::directory_iterator(path.parent_path(), unreadable))
      if (other != path && other.filename().string().front() != '.' && may_hold_images(other))
        throw usage_error(
            fmt::format("the case {} is a folder around the study, and {} lies in it too, which "
                        "may hold images; nothing is written among images",
                        options.case_folder.string(), other.string()),
            "give another folder with -o");
  }
}

/// Labels are the user's own: none where the stage would overwrite it, or take it for an image.
void check_labels(const fs::path& file, const SegmentOptions& options) {
  if (!fs::is_regular_file(file)) throw input_error("--labels " + file.string() + ": there is no such file");
  if (!is_nifti_name(file))
    throw input_error("--labels " + file.string() + ": not a NIfTI volume by its name",
                      "labels are a .nii or .nii.gz file on the grid of a stack");
  for (const auto& [folder, why] :
       {std::pair{options.case_folder / "segmentation", "which this stage writes anew"},
        {options.study, "whose files are read as images"}})
    if (fs::is_directory(folder) && is_below(file, folder))
      throw usage_error(fmt::format("--labels {}: it lies in {}, {}", file.string(), folder.string(), why),
                        "save the corrected labels elsewhere");
}

/// Two visits are two states of the eyes: their stacks are not of one eye.
void require_one_study(const std::vector<const SeriesInfo*>& chosen) {
  std::map<std::string, std::string> stacks_of;  // by StudyInstanceUID
  for (const SeriesInfo* info : chosen) {
    if (info->is_nifti()) continue;
    std::string& stacks = stacks_of[info->study_uid];
    stacks += (stacks.empty() ? "" : ", ") + info->name;
  }
  if (stacks_of.size() < 2) return;
  std::string studies;
  for (const auto& [uid, stacks] : stacks_of) studies += fmt::format("\n  {}: {}", uid, stacks);
  throw input_error(fmt::format("the series are of {} studies by {}{}", stacks_of.size(),
                                to_string(tag::study_instance), studies),
                    "give the folder of one study, or choose series of one with --series");
}

/// Nor are those of one study whose headers say so.
void require_one_visit(const StudyInventory& inventory, const std::vector<const SeriesInfo*>& chosen) {
  const std::vector<const SeriesInfo*> visits = inventory.one_of_each_visit(chosen);
  for (auto one = visits.begin(); one != visits.end(); ++one)
    for (auto other = std::next(one); other != visits.end(); ++other)
      if (const std::string reason = inventory.contradiction(**one, **other); !reason.empty())
        throw input_error(reason, "give the study of one visit, or choose its series with --series");
}

/// Names of the series that are NIfTI volumes, or of the others.
std::vector<std::string> names_of(const std::vector<const SeriesInfo*>& series, bool nifti) {
  std::vector<std::string> names;
  for (const SeriesInfo* info : series)
    if (info->is_nifti() == nifti) names.push_back(info->name);
  return names;
}

/// A NIfTI volume names no patient: beside DICOM it may be anybody's.
void require_one_format(const std::vector<const SeriesInfo*>& chosen) {
  const auto volumes = names_of(chosen, true), series = names_of(chosen, false);
  if (volumes.empty() || series.empty()) return;
  throw input_error(
      fmt::format("NIfTI volumes ({}) lie among DICOM series ({}): nothing tells that they are of one person",
                  fmt::join(volumes, ", "), fmt::join(series, ", ")),
      "give the folder of one of the two, or choose with --series");
}

/// Whether a time or an angle is the same but for rounding; what one header does not tell is no difference.
bool is_same_number(const std::optional<double>& a, const std::optional<double>& b) {
  constexpr double rounding = 0.01;
  return !a || !b || std::abs(*a - *b) <= rounding * std::abs(*b);
}

bool is_same_contrast(const SeriesInfo& a, const SeriesInfo& b) {
  // A separated image may say either of the echoes that it was made of.
  const bool is_separated = a.dixon_part != DixonPart::all && b.dixon_part != DixonPart::all;
  const bool is_told =
      (a.repetition_time_ms && b.repetition_time_ms) || (!is_separated && a.echo_time_ms && b.echo_time_ms);
  return is_told && is_same_number(a.repetition_time_ms, b.repetition_time_ms) &&
         (is_separated || is_same_number(a.echo_time_ms, b.echo_time_ms)) &&
         is_same_number(a.inversion_time_ms, b.inversion_time_ms) &&
         is_same_number(a.flip_angle_deg, b.flip_angle_deg);
}

/// The usable series of the acquisition that a computed one, or one of water alone, was made from, by frame of
/// reference and contrast; null where there is none, headers tell neither TR nor TE to compare, or the series itself is
/// acquired.
const SeriesInfo* acquired_source_of(const SeriesInfo& info, const StudyInventory& inventory) {
  // Of a series that tells too little nothing shows that it is an acquisition once more: left out, a contrast may be
  // lost.
  const bool is_water = info.dixon_part == DixonPart::water;
  if ((!is_water && !info.computed) || info.frame_of_reference_uid.empty()) return nullptr;
  const auto source =
      std::find_if(inventory.series.begin(), inventory.series.end(), [&](const SeriesInfo& other) {
        // What was computed is never the source of what was acquired, or each would be left out for the other.
        const bool is_whole =
            (other.dixon_part == DixonPart::in_phase && (info.computed || !other.computed)) ||
            (other.dixon_part == DixonPart::all && !other.computed);
        const bool is_acquired = !other.computed && why_unfit(other.dixon_part).empty();
        const bool is_source = (is_water && is_whole) || (info.computed && is_acquired);
        return other.usable && is_source && !other.is_nifti() && other.study_uid == info.study_uid &&
               other.frame_of_reference_uid == info.frame_of_reference_uid && is_same_contrast(other, info);
      });
  return source == inventory.series.end() ? nullptr : &*source;
}

}  // namespace

std::vector<StageInput> input_files(const SegmentOptions& options) {
  const FileList study = list_files(options.study, IntakeLimits{});
  check_case_folder(options);
  std::vector<StageInput> inputs;
  for (const fs::path& file : study.files)
    inputs.push_back({fmt::format("study/{}", inputs.size() + 1), study.root / file});
  for (std::size_t i = 0; i < options.labels.size(); ++i) {
    check_labels(options.labels[i], options);
    inputs.push_back({fmt::format("labels/{}", i + 1), options.labels[i]});
  }
  return inputs;
}

void require_same_files(const SegmentOptions& options, const std::vector<StageInput>& noted) {
  const bool study_holds_case = is_below(options.case_folder, options.study);
  const auto of_study = [&](const std::vector<StageInput>& inputs) {
    return std::count_if(inputs.begin(), inputs.end(), [&](const StageInput& input) {
      return !study_holds_case || !is_below(input.path, options.case_folder);  // what this run writes
    });
  };
  const auto then = of_study(noted), now = of_study(input_files(options));
  if (now != then)
    throw input_error(
        fmt::format("{} had {} files when it was begun and has {} now", options.study.string(), then, now),
        "run it again when nothing writes there any more");
}

std::string why_left_out(const SeriesInfo& info, const StudyInventory& inventory) {
  if (!info.usable) return {};
  if (std::string unfit = why_unfit(info.dixon_part); !unfit.empty()) return unfit;
  if (const SeriesInfo* source = acquired_source_of(info, inventory); source != nullptr)
    return fmt::format(
        "{} says that it {}, from {} by frame of reference and contrast, which would count twice",
        to_string(tag::image_type),
        info.dixon_part == DixonPart::water ? "shows water alone" : "was computed", source->name);
  return {};
}

std::vector<const SeriesInfo*> choose_series(const StudyInventory& inventory,
                                             const std::vector<SeriesChoice>& wanted) {
  std::vector<const SeriesInfo*> chosen;
  for (const SeriesChoice& choice : wanted) {
    const std::string& id = choice.series;
    const auto by_number =
        std::find_if(inventory.series.begin(), inventory.series.end(),
                     [&](const SeriesInfo& s) { return s.name == id || s.name == "stack" + id; });
    const SeriesInfo& info = by_number != inventory.series.end() ? *by_number : inventory.find(id);
    if (!info.usable)
      throw Error(info.refusal, fmt::format("series {} cannot be used: {}", info.uid, info.reason));
    chosen.push_back(&info);
  }
  if (wanted.empty())
    for (const SeriesInfo& info : inventory.series)
      if (info.usable && why_left_out(info, inventory).empty()) chosen.push_back(&info);
  if (wanted.empty()) require_one_format(chosen);
  if (chosen.empty()) {
    std::string reasons;
    for (const SeriesInfo& info : inventory.series)
      reasons +=
          fmt::format("\n  {}: {}", info.name, info.usable ? why_left_out(info, inventory) : info.reason);
    if (inventory.series.empty())
      reasons = fmt::format(": none of its {} files is an image", inventory.skipped.size());
    throw Error(inventory.any_usable() ? ExitStatus::unsupported : inventory.status(),
                fmt::format("{}: no series of the study can be used{}", inventory.study.string(), reasons),
                "emmetrope inventory STUDY lists what is wrong with each");
  }
  require_one_study(chosen);
  require_one_visit(inventory, chosen);
  return chosen;
}

Subject subject_of(const StudyInventory& inventory, const std::vector<const SeriesInfo*>& chosen) {
  const auto volume =
      std::find_if(chosen.begin(), chosen.end(), [](const SeriesInfo* info) { return info->is_nifti(); });
  return inventory.subject_of(volume == chosen.end() ? *chosen.front() : **volume);
}

std::string volumes_warning(const std::vector<const SeriesInfo*>& chosen) {
  const auto volumes = names_of(chosen, true);
  if (volumes.size() < 2) return {};
  return fmt::format(
      "{} are NIfTI volumes, which name no patient: nothing tells that they are of one person; --series chooses",
      fmt::join(volumes, ", "));
}

}  // namespace emmetrope::segmentation
