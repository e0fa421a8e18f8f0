#include "pipeline/cohort/bids/derivatives.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <vector>

#include "pipeline/base/case_folder.hpp"
#include "pipeline/base/ends_with.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/laterality.hpp"
#include "pipeline/base/version.hpp"
#include "pipeline/cohort/results/cohort_rows.hpp"
#include "pipeline/cohort/subjects/stage_end.hpp"
#include "pipeline/cohort/subjects/subject_plan.hpp"

namespace emmetrope::cohort {
namespace {

namespace fs = std::filesystem;

constexpr const char* labels_ending = "_seg-eyes_dseg";
constexpr const char* rows_ending = "_eyes.tsv";

constexpr const char* readme =
    "Eyes measured by Emmetrope from the anatomical images of the source dataset.\n\n"
    "*_seg-eyes_dseg.nii.gz  the tissues of both eyes at every voxel of an image, with their names (.tsv)\n"
    "*_eyes.tsv              a row an eye: what came of it, and each number with its 95 % interval and source;\n"
    "                        eyes.json tells what the columns are\n"
    "sub-*.html              the report of a visit\n"
    "cohort.tsv cohort.html  the rows and the page of everybody, after the level \"group\"\n"
    "emmetrope/              the cases: meshes, retinal images, spectacle lenses, how each stage ended\n\n"
    "Research use only. Not a medical device. Not for prescribing without an eye examination.\n";

constexpr const char* ignored_by_bids = "emmetrope/\ncohort.*\n*.html\n*_eyes.tsv\neyes.json\n";

std::string without_extension(const std::string& image) {
  for (const char* extension : {".nii.gz", ".nii"})
    if (ends_with(image, extension)) return image.substr(0, image.size() - std::string(extension).size());
  return image;
}

/// sub-X/[ses-Y/]anat
fs::path folder_of(const Subject& subject) {
  const std::size_t session = subject.id.find("_ses-");
  const fs::path person = subject.id.substr(0, session);
  return (session == std::string::npos ? person : person / subject.id.substr(session + 1)) / "anat";
}

/// Images by the hash that a case calls them by.
std::map<std::string, fs::path> images_by_uid(const fs::path& study) {
  std::map<std::string, fs::path> images;
  for (const auto& entry : fs::directory_iterator(study)) {
    const std::string name = entry.path().filename().string();
    if (!ends_with(name, ".nii") && !ends_with(name, ".nii.gz")) continue;
    constexpr std::size_t digits = 16;
    images["nifti-" + sha256_of_file(entry.path()).substr(0, digits)] = entry.path();
  }
  return images;
}

/// Whether the eye's surfaces were fitted and stand: voxels have labels of such eyes alone.
bool is_fitted(const fs::path& case_folder, Laterality eye) {
  const fs::path file = case_folder / "segmentation" / to_string(eye) / "fit.json";
  if (!fs::exists(file)) return false;
  const Json fit = read_json(file);
  return fit.contains("eye") && !fit.at("withheld").contains("fit");
}

/// A stack of the case whose voxels have labels, and the image that it is.
struct LabelledStack {
  std::string name;
  fs::path image;
};

std::vector<LabelledStack> labelled_stacks(const fs::path& case_folder, const Subject& subject) {
  std::vector<LabelledStack> stacks;
  const fs::path file = case_folder / "case.json";
  if (!fs::exists(file)) return stacks;
  const Json json = read_json(file);
  try {
    const std::map<std::string, fs::path> images = images_by_uid(subject.study);
    for (const Json& stack : json.at("stacks")) {
      const std::string name = stack.at("name");
      const bool is_labelled = std::any_of(both_eyes.begin(), both_eyes.end(), [&](Laterality eye) {
        const Json& eyes = json.at("eyes");
        if (!eyes.contains(to_string(eye))) return false;
        const Json& seen_in = eyes.at(to_string(eye)).at("stacks");
        return is_fitted(case_folder, eye) &&
               std::find(seen_in.begin(), seen_in.end(), Json(name)) != seen_in.end();
      });
      const auto image = images.find(stack.at("uid").get<std::string>());
      if (is_labelled && image != images.end()) stacks.push_back({name, image->second});
    }
  } catch (const Json::exception& fault) {
    throw input_error(file.string() + ": " + fault.what(), "run it again with --force");
  }
  return stacks;
}

std::string label_table(const fs::path& case_folder) {
  const Json labels = read_json(case_folder / "segmentation" / "labels.json");
  std::string text = "index\tname\n";
  for (const Json& label : labels.at("labels"))
    text += fmt::format("{}\t{}\n", label.at("value").get<int>(), label.at("name").get<std::string>());
  return text;
}

Json side_car(const fs::path& image, const fs::path& dataset) {
  const std::string source = "bids:raw:" + image.lexically_relative(dataset).generic_string();
  return {{"Description", "Tissues of the eyes, from surfaces that were fitted to the image's intensities"},
          {"Sources", {source}},
          {"SpatialReference", source},
          {"Manual", false}};
}

void remove_published(const fs::path& folder, const std::string& id) {
  std::error_code missing;
  std::vector<fs::path> old;
  for (const auto& entry : fs::directory_iterator(folder, missing)) {
    const std::string name = entry.path().filename().string();
    if (name.find(labels_ending) != std::string::npos || name == id + rows_ending)
      old.push_back(entry.path());
  }
  for (const fs::path& file : old) fs::remove(file);
}

/// One file on the disk under two names, where the file system can.
void link_or_copy(const fs::path& from, const fs::path& to) {
  fs::remove(to);
  std::error_code cannot;
  fs::create_hard_link(from, to, cannot);
  if (cannot) fs::copy_file(from, to);
}

}  // namespace

std::string label_name(const std::string& image, bool with_space) {
  const std::string name = without_extension(image);
  const std::size_t suffix = name.rfind('_');
  const std::string entities = name.substr(0, suffix);
  const std::string space = with_space ? "_space-" + name.substr(suffix + 1) : "";
  return entities + space + labels_ending;
}

void Derivatives::describe(const fs::path& dataset) const {
  fs::create_directories(root_);
  const std::string raw = dataset.lexically_relative(root_).generic_string();
  const Json description{{"Name", "Emmetrope: eyes measured from anatomical images"},
                         {"BIDSVersion", "1.10.0"},
                         {"DatasetType", "derivative"},
                         {"GeneratedBy", {{{"Name", "Emmetrope"}, {"Version", version()}}}},
                         {"SourceDatasets", {{{"URL", raw}}}},
                         {"DatasetLinks", {{"raw", raw}}}};
  write_if_new(root_ / "dataset_description.json", description.dump(2) + "\n");
  write_if_new(root_ / "README", readme);
  write_if_new(root_ / ".bidsignore", ignored_by_bids);
  write_if_new(root_ / "eyes.json", table_dictionary().dump(2) + "\n");
}

void Derivatives::publish(const Subject& subject, const fs::path& dataset) const {
  const fs::path case_folder = cohort().case_folder(subject.id), folder = root_ / folder_of(subject);
  fs::create_directories(folder);
  remove_published(folder, subject.id);
  const std::vector<LabelledStack> stacks = has_come_to_its_end(cohort(), subject.id, "segment")
                                                ? labelled_stacks(case_folder, subject)
                                                : std::vector<LabelledStack>();
  for (const LabelledStack& stack : stacks) {
    const std::string image = stack.image.filename().string();
    const bool is_alone =
        std::count_if(stacks.begin(), stacks.end(), [&](const LabelledStack& other) {
          return label_name(other.image.filename().string(), false) == label_name(image, false);
        }) == 1;
    const std::string name = label_name(image, !is_alone);
    link_or_copy(case_folder / "segmentation" / (stack.name + "_labels.nii.gz"), folder / (name + ".nii.gz"));
    write_json(folder / (name + ".json"), side_car(stack.image, dataset));
    write_file(folder / (name + ".tsv"), label_table(case_folder));
  }
  write_file(folder / (subject.id + rows_ending), table_text(read_rows(cohort(), {subject.id})));
  const fs::path report = case_folder / "report" / "report.html", page = root_ / (subject.id + ".html");
  if (has_come_to_its_end(cohort(), subject.id, "report") && fs::exists(report))
    link_or_copy(report, page);
  else
    fs::remove(page);
}

}  // namespace emmetrope::cohort
