#include "segmentation/intake/study.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>
#include <string_view>

#include "pipeline/base/clean_text.hpp"
#include "pipeline/base/files.hpp"
#include "segmentation/intake/decoder.hpp"
#include "segmentation/intake/file_list.hpp"
#include "segmentation/intake/file_mention.hpp"
#include "segmentation/intake/identity.hpp"
#include "segmentation/intake/repeated_planes.hpp"
#include "segmentation/intake/series_checks.hpp"
#include "segmentation/intake/series_warnings.hpp"
#include "segmentation/intake/slice_grid.hpp"
#include "segmentation/intake/subject.hpp"
#include "segmentation/intake/tag_values.hpp"

namespace emmetrope::segmentation {
namespace {

namespace fs = std::filesystem;

constexpr const char* nifti_uid_prefix = "nifti-";

using SeriesFiles = std::map<std::string, std::vector<ScannedFile>>;  // by SeriesInstanceUID

FrameStatistics statistics_of(const std::vector<std::int32_t>& samples) {
  const auto [low, high] = std::minmax_element(samples.begin(), samples.end());
  FrameStatistics statistics{*low, *high, 0, samples.size(), 0};
  for (const auto sample : samples) statistics.sum += sample;
  statistics.hash = std::hash<std::string_view>{}(
      {reinterpret_cast<const char*>(samples.data()), samples.size() * sizeof samples[0]});
  return statistics;
}

ScannedFile scan(Decoder& decoder, const fs::path& root, const fs::path& file, std::size_t number) {
  ScannedFile scanned{file, number};
  auto decoded = decoder.decode(root / file, [&](int, const std::vector<std::int32_t>& samples) {
    scanned.frames.push_back(statistics_of(samples));
  });
  scanned.header = std::move(decoded.header);
  scanned.end = std::move(decoded.end);
  return scanned;
}

/// A damaged file that does not say which series it belongs to spoils every series of its folder: a slice may
/// be missing anywhere.
void assign_damaged(const std::vector<ScannedFile>& damaged, SeriesFiles& series, StudyInventory& inventory) {
  for (const auto& file : damaged) {
    bool assigned = false;
    for (auto& [uid, files] : series) {
      const bool beside = std::any_of(files.begin(), files.end(), [&](const ScannedFile& other) {
        return other.file.parent_path() == file.file.parent_path();
      });
      if (beside) files.push_back(file);
      assigned = assigned || beside;
    }
    inventory.skipped.push_back({file.file, file.header.reason});
  }
}

/// Of files with one SOPInstanceUID keeps the first when they are the same byte for byte.
/// \return why not, when they differ
std::string drop_copies(std::vector<ScannedFile>& files, const fs::path& root, StudyInventory& inventory) {
  std::map<std::string, ScannedFile> first;
  std::string fault;
  const auto is_copy = [&](const ScannedFile& file) {
    const auto& uid = file.header.value(tag::sop_instance);
    const auto [entry, is_new] = first.try_emplace(uid, file);
    if (is_new || uid.empty()) return false;
    if (sha256_of_file(root / file.file) != sha256_of_file(root / entry->second.file)) {
      fault = fmt::format("{} and {}: the same {}, but different contents", entry->second.name(), file.name(),
                          to_string(tag::sop_instance));
      return false;
    }
    inventory.skipped.push_back({file.file, "a copy of " + entry->second.file.string()});
    return true;
  };
  files.erase(std::remove_if(files.begin(), files.end(), is_copy), files.end());
  return fault;
}

void refuse(SeriesInfo& info, const std::string& reason) {
  info.usable = false;
  info.reason = reason;
  info.refusal = ExitStatus::input_invalid;
}

SeriesInfo judge(std::vector<ScannedFile> files, const IntakeOptions& options, const Patients& patients,
                 StudyInventory& inventory) {
  const std::size_t all = files.size();
  const std::string fault = drop_copies(files, inventory.root, inventory);
  const std::size_t kept = files.size();
  SeriesInfo info = judge_series(std::move(files), options);
  if (kept < all)
    info.warnings.push_back(fmt::format("{} of {} files are copies of others, {}; one of each is used",
                                        all - kept, all, to_string(tag::sop_instance)));
  for (const auto& warning : patients.warnings(info.uid)) info.warnings.push_back(warning);
  if (!fault.empty()) refuse(info, fault);
  return info;
}

/// A NIfTI volume tells where its first voxel lies, and no more: what lies behind a plane too many is in another place.
/// \throw Error (input_invalid) naming the planes
void judge_repeated_planes(const Stack& stack, const std::string& name, std::vector<std::string>& warnings) {
  for (const RepeatedPlanes& repeated : find_repeated_planes(stack)) {
    const std::string planes = described(repeated, stack);
    if (!repeated.throughout)
      throw input_error(
          fmt::format("{}: {}, hold the same voxels, which no two that were acquired do: lengths "
                      "across them cannot be told",
                      name, planes));
    warnings.push_back(
        fmt::format("{}: its voxels were repeated to enlarge it ({}): it tells no more than it did before",
                    name, planes));
  }
}

/// As the decoding process, which tells its words in UTF-8, spells a path.
std::string as_told(const std::string& path) {
  return Json::parse(Json(path).dump(-1, ' ', false, Json::error_handler_t::replace)).get<std::string>();
}

/// \param sidecars  the nearest first
SeriesInfo judge_nifti(Decoder& decoder, const IntakeOptions& options, const fs::path& root,
                       const fs::path& file, const std::vector<fs::path>& sidecars) {
  SeriesInfo info;
  info.uid = nifti_uid_prefix + sha256_of_file(root / file).substr(0, 16);
  info.modality = "NIfTI";
  info.description = clean_utf8(file.string());
  info.files = 1 + static_cast<std::size_t>(
                       std::count_if(sidecars.begin(), sidecars.end(),
                                     [&](const fs::path& sidecar) { return is_file(root / sidecar); }));
  try {
    const auto [stack, sidecar, warnings] = decoder.decode_volume(root / file);
    info.warnings = warnings;
    info.rows = stack.rows;
    info.columns = stack.columns;
    info.row_spacing_mm = stack.row_spacing_mm;
    info.column_spacing_mm = stack.column_spacing_mm;
    info.slice_spacing_mm = stack.slice_spacing_mm();
    info.slice_thickness_mm = stack.slice_thickness_mm;
    info.uniform = !fit_slice_grid(stack).has_gaps();
    if (std::string few = too_few_slices(stack.slices()); !few.empty())
      info.warnings.push_back(std::move(few));
    judge_repeated_planes(stack, (root / file).string(), info.warnings);
    for (int i = 0; i < 3; ++i) {
      info.orientation[i] = stack.along_row[i];
      info.orientation[i + 3] = stack.along_column[i];
    }
    double sum = 0, count = 0;
    for (int slice = 0; slice < stack.slices(); ++slice) {
      info.slices.push_back({file, slice, stack.slice_position[slice], 1, 0});
      for (const float value : stack.slice_intensity[slice]) {
        info.minimum = std::min(info.minimum.value_or(value), static_cast<double>(value));
        info.maximum = std::max(info.maximum.value_or(value), static_cast<double>(value));
        sum += value;
      }
      count += static_cast<double>(stack.slice_intensity[slice].size());
    }
    info.mean = sum / count;
    if (!sidecar.empty()) {
      ScannedFile told;
      // Which of several told what is not known here.
      for (const fs::path& one : sidecars) told.file += (told.file.empty() ? "" : ", ") + one.string();
      told.header.data_set = sidecar;
      told.is_sidecar = true;
      judge_sidecar(told, options, info);
    }
    info.usable = true;
  } catch (const Error& fault) {
    info.reason = fault.what();
    info.refusal = fault.status();
    info.damaged = info.refusal == ExitStatus::input_invalid;
  }
  std::vector<std::pair<fs::path, const char*>> mentioned{{file, "the volume"}};
  for (const fs::path& one : sidecars) mentioned.emplace_back(one, "the volume's sidecar");
  const auto mention_file = [&](std::string& text) {
    for (const auto& [of_study, neutral] : mentioned) {
      const std::string path = (root / of_study).string();
      for (const std::string& spelling : {path, as_told(path)})
        if (const auto at = text.find(spelling); at != std::string::npos) {
          text.replace(at, spelling.size(), mention(of_study, neutral));
          return;
        }
    }
  };
  for (auto& warning : info.warnings) mention_file(warning);
  mention_file(info.reason);
  return info;
}

/// Thinner than 2-D acquisitions of heads have them.
bool slices_are_thin(const Stack& stack) {
  constexpr double thinnest_of_2d_mm = 1.65;
  return stack.slice_spacing_mm() <= thinnest_of_2d_mm;
}

/// One standard deviation of the displacement of fat along row, column and slices: what 3.5 ppm of the resonance
/// frequency are in pixels, one pixel where the bandwidth is not told; along the readout, where that is told.
Eigen::Vector3d fat_shift_sigma_mm(const SeriesInfo& info, const Stack& stack) {
  constexpr double fat_water_Hz_per_T = 3.5 * 42.577;
  const double bandwidth_Hz = info.pixel_bandwidth_Hz.value_or(0),
               field_T = info.field_strength_T.value_or(0);
  const double pixels = bandwidth_Hz > 0 && field_T > 0 ? fat_water_Hz_per_T * field_T / bandwidth_Hz : 1;
  const bool is_read_through = info.phase_encoding == both_phase_encodings;
  const auto along = [&](const char* encoded, double spacing_mm) {
    return is_read_through || info.phase_encoding == encoded ? 0 : spacing_mm;
  };
  return pixels * Eigen::Vector3d(along("ROW", stack.column_spacing_mm), along("COL", stack.row_spacing_mm),
                                  is_read_through ? stack.slice_spacing_mm() : 0);
}

/// How the voxels came about, as far as header or sidecar tell.
void describe_acquisition(const SeriesInfo& info, Stack& stack) {
  const Eigen::Vector3d fat_shift = fat_shift_sigma_mm(info, stack);
  stack.fat_shift_sigma_mm = fat_shift.head<2>();
  stack.fat_shift_sigma_through_mm = fat_shift.z();
  const bool is_told = !info.acquisition_type.empty();
  stack.slices_are_encoded = is_told ? info.acquisition_type == "3D" : slices_are_thin(stack);
  // A volume may have been turned since it was acquired.
  stack.slices_are_told = !stack.slices_are_encoded && (is_told || !info.is_nifti());
  stack.told_weighting = weighting_by_times({info.repetition_time_ms, info.echo_time_ms,
                                             info.inversion_time_ms, info.flip_angle_deg, info.sequence});
}

/// Each study's series can be used, but not together with another's.
void warn_of_studies(std::vector<SeriesInfo>& series) {
  const auto of_study = [](const SeriesInfo& info) { return info.usable && !info.is_nifti(); };
  std::set<std::string> studies;
  for (const auto& info : series)
    if (of_study(info)) studies.insert(info.study_uid);
  if (studies.size() < 2) return;
  for (auto& info : series)
    if (of_study(info))
      info.warnings.push_back(fmt::format(
          "{} is {}, one of {} studies here; series of one only can be used, --series chooses them",
          to_string(tag::study_instance), in_quotes(info.study_uid), studies.size()));
}

/// Of two people or visits under one StudyInstanceUID each series can be used, but not with the other's.
void warn_of_visits(StudyInventory& inventory) {
  std::vector<const SeriesInfo*> usable;
  for (const auto& info : inventory.series)
    if (info.usable) usable.push_back(&info);
  const std::vector<const SeriesInfo*> visits = inventory.one_of_each_visit(usable);
  for (auto& info : inventory.series)
    for (const SeriesInfo* other : visits)
      if (const std::string reason = info.usable ? inventory.contradiction(info, *other) : "";
          !reason.empty()) {
        info.warnings.push_back(reason + "; they are not used together, --series chooses");
        break;
      }
}

/// DICOM names its patient, NIfTI does not.
void warn_of_volumes(std::vector<SeriesInfo>& series) {
  const bool has_dicom = std::any_of(series.begin(), series.end(),
                                     [](const SeriesInfo& info) { return info.usable && !info.is_nifti(); });
  for (auto& info : series)
    if (has_dicom && info.usable && info.is_nifti())
      info.warnings.emplace_back(
          "a NIfTI volume beside DICOM series: nothing tells that it is of their patient; both are used only where "
          "--series names both, under a pseudonym");
}

/// Texts for the terminal and for the case from those with mentions of files.
void separate_file_names(SeriesInfo& info) {
  info.kept.description = info.is_nifti() ? "NIfTI volume" : info.description;
  for (auto& warning : info.warnings) {
    info.kept.warnings.push_back(without_file_names(warning));
    warning = with_file_names(warning);
  }
  info.kept.reason = without_file_names(info.reason);
  info.reason = with_file_names(info.reason);
}

}  // namespace

const SeriesInfo& StudyInventory::find(const std::string& uid) const {
  std::string known;
  for (const auto& info : series) {
    if (info.uid == uid) return info;
    known += fmt::format("{}{} = {} ({})", known.empty() ? "" : ", ", info.name, info.uid, info.description);
  }
  throw input_error("the study has no series " + uid, known.empty() ? "" : "it has " + known);
}

Subject StudyInventory::subject_of(const SeriesInfo& info) const {
  if (info.is_nifti()) return {info.uid.substr(std::string(nifti_uid_prefix).size()), {}, {}};
  const auto found = subjects.find(info.study_uid);
  return found != subjects.end() ? found->second : Subject{};
}

bool StudyInventory::any_usable() const {
  return std::any_of(series.begin(), series.end(), [](const SeriesInfo& info) { return info.usable; });
}

std::string StudyInventory::why_not_used(const SeriesInfo& info) const {
  if (!info.usable) return info.reason;
  const std::string unfit = why_unfit(info.dixon_part);
  const bool is_named = std::any_of(choices.begin(), choices.end(),
                                    [&](const SeriesChoice& choice) { return choice.series == info.uid; });
  return unfit.empty() || is_named ? std::string() : unfit + used_on_demand;
}

ExitStatus StudyInventory::status() const {
  if (std::any_of(series.begin(), series.end(), [&](const auto& info) { return why_not_used(info).empty(); }))
    return ExitStatus::done;
  if (any_usable()) return ExitStatus::unsupported;
  const bool all_unsupported = std::all_of(series.begin(), series.end(), [](const SeriesInfo& info) {
    return info.refusal == ExitStatus::unsupported;
  });
  return !series.empty() && all_unsupported ? ExitStatus::unsupported : ExitStatus::input_invalid;
}

StudyInventory read_inventory(const fs::path& study, const IntakeOptions& options) {
  StudyInventory inventory;
  auto list = list_files(study, options.limits);
  inventory.study = study;
  inventory.root = list.root;
  inventory.choices = options.choices;
  inventory.skipped = std::move(list.skipped);

  SeriesFiles series;
  std::vector<ScannedFile> damaged;
  Patients patients;
  Identity identity;
  Decoder decoder(options.limits);
  Progress progress("reading the study", list.files.size(), options.verbosity);
  std::size_t number = 0;
  std::set<fs::path> sidecars;
  for (const auto& [volume, files] : list.sidecars) sidecars.insert(files.begin(), files.end());
  // A link to a file that is listed under another name is read all the same.
  auto& skipped = inventory.skipped;
  skipped.erase(std::remove_if(skipped.begin(), skipped.end(),
                               [&](const SkippedFile& one) {
                                 return sidecars.count(one.file) > 0 && is_file(inventory.root / one.file);
                               }),
                skipped.end());
  for (const auto& file : list.files) {
    progress.advance();
    if (sidecars.count(file) > 0) continue;  // read with its volume
    if (is_nifti_name(file)) {
      inventory.series.push_back(judge_nifti(decoder, options, inventory.root, file, list.sidecars[file]));
      continue;
    }
    ScannedFile scanned = scan(decoder, inventory.root, file, ++number);
    const auto& header = scanned.header;
    if (header.kind == FileKind::image || header.kind == FileKind::no_image) patients.add(scanned);
    identity.add(header);
    if (header.kind == FileKind::damaged && !header.has(tag::series_instance))
      damaged.push_back(std::move(scanned));
    else if (header.kind == FileKind::image || header.kind == FileKind::damaged)
      series[header.value(tag::series_instance)].push_back(std::move(scanned));
    else
      inventory.skipped.push_back({file, header.reason});
  }
  assign_damaged(damaged, series, inventory);
  for (auto& [uid, files] : series)
    for (auto& file : files) identity.remove_from(file.header);
  for (auto& [uid, files] : series)
    inventory.series.push_back(judge(std::move(files), options, patients, inventory));
  // A NIfTI volume beside them may be either's.
  if (const auto conflict = patients.conflict(); !conflict.empty())
    for (auto& info : inventory.series) refuse(info, conflict);
  inventory.subjects = patients.subjects();
  inventory.visits = patients.visits();
  warn_of_studies(inventory.series);
  warn_of_volumes(inventory.series);

  std::sort(inventory.series.begin(), inventory.series.end(), [](const SeriesInfo& a, const SeriesInfo& b) {
    return std::tie(a.number, a.uid) < std::tie(b.number, b.uid);
  });
  for (std::size_t i = 0; i < inventory.series.size(); ++i)
    inventory.series[i].name = fmt::format("stack{}", i + 1);
  warn_of_visits(inventory);
  for (auto& info : inventory.series) separate_file_names(info);
  for (const SeriesChoice& choice : options.choices) inventory.find(choice.series);
  std::sort(inventory.skipped.begin(), inventory.skipped.end(),
            [](const SkippedFile& a, const SkippedFile& b) { return a.file < b.file; });
  return inventory;
}

std::vector<const SeriesInfo*> StudyInventory::one_of_each_visit(
    const std::vector<const SeriesInfo*>& series) const {
  std::set<std::pair<std::string, std::map<std::string, std::string>>> seen;
  std::vector<const SeriesInfo*> first;
  for (const SeriesInfo* info : series) {
    const auto visit = visits.find(info->uid);
    if (visit != visits.end() && seen.emplace(info->study_uid, visit->second).second) first.push_back(info);
  }
  return first;
}

std::string StudyInventory::contradiction(const SeriesInfo& one, const SeriesInfo& other) const {
  const auto a = visits.find(one.uid), b = visits.find(other.uid);
  if (one.study_uid != other.study_uid || a == visits.end() || b == visits.end()) return {};
  const std::string tag = segmentation::contradiction(a->second, b->second);
  return tag.empty() ? tag
                     : fmt::format("{} and {} of one study are of two people or visits: {} differs", one.name,
                                   other.name, tag);
}

Stack read_series(const StudyInventory& inventory, const std::string& uid, const IntakeOptions& options) {
  const SeriesInfo& info = inventory.find(uid);
  if (!info.usable)
    throw Error(info.refusal, fmt::format("series {} cannot be used: {}", info.uid, info.reason));
  if (info.is_nifti()) {
    Stack stack = Decoder(options.limits).decode_volume(inventory.root / info.slices.front().file).stack;
    stack.name = info.name;
    stack.slice_thickness_mm = info.slice_thickness_mm.value_or(stack.slice_thickness_mm);
    describe_acquisition(info, stack);
    return stack;
  }
  Stack stack;
  stack.name = info.name;
  stack.columns = info.columns;
  stack.rows = info.rows;
  stack.along_row = Eigen::Vector3d(info.orientation.data());
  stack.along_column = Eigen::Vector3d(info.orientation.data() + 3);
  stack.normal = stack.along_row.cross(stack.along_column);
  stack.row_spacing_mm = *info.row_spacing_mm;
  stack.column_spacing_mm = *info.column_spacing_mm;
  stack.slice_thickness_mm = info.slice_thickness_mm.value_or(info.slice_spacing_mm.value_or(0));
  stack.slice_intensity.resize(info.slices.size());

  // Slices by file, as a multi-frame file is decoded once.
  std::map<fs::path, std::map<int, std::size_t>> slices_of;
  for (std::size_t i = 0; i < info.slices.size(); ++i) {
    stack.slice_position.push_back(info.slices[i].position_mm);
    slices_of[info.slices[i].file][info.slices[i].frame] = i;
  }
  describe_acquisition(info, stack);
  const std::size_t voxels = static_cast<std::size_t>(info.rows) * static_cast<std::size_t>(info.columns);
  Decoder decoder(options.limits);
  Progress progress("decoding " + info.name, slices_of.size(), options.verbosity);
  for (const auto& [file, slice_of_frame] : slices_of) {
    const auto decoded =
        decoder.decode(inventory.root / file, [&, &frames = slice_of_frame](int frame, const auto& samples) {
          const auto slice = frames.find(frame);
          if (slice == frames.end() || samples.size() != voxels) return;
          const auto& source = info.slices[slice->second];
          auto& target = stack.slice_intensity[slice->second];
          target.reserve(voxels);
          for (const auto sample : samples)
            target.push_back(static_cast<float>(source.rescale_slope * sample + source.rescale_intercept));
        });
    progress.advance();
    for (const auto& [frame, slice] : slice_of_frame)
      if (!decoded.end.error.empty() || stack.slice_intensity[slice].size() != voxels)
        throw input_error(fmt::format("{}: changed while it was read, {}", file.string(), decoded.end.error));
  }
  return stack;
}

}  // namespace emmetrope::segmentation
