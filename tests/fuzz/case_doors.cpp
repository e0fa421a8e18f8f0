#include <fstream>
#include <nlohmann/json.hpp>

#include "pipeline/base/case_folder.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/cohort/subjects/subjects.hpp"
#include "pipeline/cohort/sweep/sweep_table.hpp"
#include "pipeline/eye/measured/uncertain_optics.hpp"
#include "pipeline/eye/uncertainty/uncertain_eye.hpp"
#include "pipeline/pacs/archive_settings.hpp"
#include "pipeline/report/case/case_data.hpp"
#include "pipeline/report/content/content.hpp"
#include "raytrace/case/measured_eye.hpp"
#include "segmentation/labels/hand_labels.hpp"
#include "tests/fuzz/door_groups.hpp"
#include "tests/support/fixture_case.hpp"
#include "tests/support/measured_optics.hpp"
#include "tests/support/random_eye.hpp"

namespace emmetrope::fuzz {
namespace {

namespace fs = std::filesystem;
using Folder = const fs::path&;
using Seeds = std::vector<std::string>;

Seeds stage_files(Folder) {
  return {
      R"({"version": "1", "parameters": {"laterality": "both"}, "seed": 1, "inputs": {}, "outputs": {}, "warnings": [],
      "verdict": {"status": 8, "reasons": ["one eye"]}})"};
}

void read_stage_file(const fs::path& file) {
  const fs::path folder = file.parent_path() / "case" / "meshing";
  fs::create_directories(folder);
  fs::copy_file(file, folder / "stage.json", fs::copy_options::overwrite_existing);
  read_verdict(folder.parent_path(), "meshing");
}

void read_optics(const fs::path& file) {
  try {
    uncertain_optics_from_json(read_json(file), ".", 0.005);
  } catch (const nlohmann::json::exception&) {
    throw std::logic_error("optics.json: a key is not checked");
  }
}

void read_fit(const fs::path& file) { fitted_eye(parametric_eye_from_json(read_json(file))); }

// ---- labels drawn by hand, on the grid of a stack

const segmentation::Stack& grid() {
  static const segmentation::Stack stack = [] {
    segmentation::Stack made;
    made.name = "stack1";
    made.rows = 5;
    made.columns = 6;
    made.row_spacing_mm = made.column_spacing_mm = 1;
    made.slice_thickness_mm = 2;
    made.along_row = Eigen::Vector3d::UnitX();
    made.along_column = Eigen::Vector3d::UnitY();
    made.normal = Eigen::Vector3d::UnitZ();
    for (int slice = 0; slice < 4; ++slice) {
      made.slice_position.emplace_back(3, 4, 2.0 * slice);
      made.slice_intensity.emplace_back(30, 1.0F);
    }
    return made;
  }();
  return stack;
}

Seeds labels(Folder folder) {
  std::vector<std::vector<std::uint8_t>> values(4, std::vector<std::uint8_t>(30, 0));
  values[2][7] = 15;
  segmentation::write_label_nifti(folder / "labels.nii", grid(), values);
  return {read_file(folder / "labels.nii")};
}

void read_labels(const fs::path& file) { segmentation::read_hand_labels({file}, {&grid()}); }

// ---- a finished case: the input's first line names the file that the rest is put in place of

Seeds files_of_a_case(Folder folder) {
  const fs::path made = folder / "case";
  test::make_fixture_case(made);
  Seeds seeds;
  for (const auto& entry : fs::recursive_directory_iterator(made)) {
    const fs::path kind = entry.path().extension();
    if (kind == ".json" || kind == ".csv" || kind == ".ply")
      seeds.push_back(entry.path().lexically_relative(made).string() + "\n" + read_file(entry.path()));
  }
  return seeds;
}

std::string mutate_file_of_a_case(const std::string& input, Random& random) {
  const std::size_t end = std::min(input.find('\n'), input.size() - 1) + 1;
  const std::string name = input.substr(0, end), bytes = input.substr(end);
  if (name == "\n" || input.empty()) return input;
  return name + (name.find(".json") != std::string::npos  ? mutate_json(bytes, random)
                 : name.find(".csv") != std::string::npos ? mutate_text(bytes, random)
                                                          : mutate_bytes(bytes, random));
}

void read_a_case(const fs::path& file) {
  const fs::path whole = file.parent_path() / "case";
  if (!fs::exists(whole)) test::make_fixture_case(whole);
  const std::string input = read_file(file);
  const std::size_t end = std::min(input.find('\n'), input.size());
  const fs::path changed = whole / input.substr(0, end);
  if (input.find("..") < end || !fs::is_regular_file(changed)) return;
  const std::string before = read_file(changed);
  const auto put = [&](const std::string& bytes) { std::ofstream(changed, std::ios::binary) << bytes; };
  put(input.substr(std::min(end + 1, input.size())));
  try {
    // The sections without figures, which take a second.
    const report::CaseData data = report::read_case(whole, LateralityChoice::both);
    for (const auto section : {report::measured_section, report::peripheral_section, report::lenses_section,
                               report::methods_section, report::provenance_section})
      section(data);
    report::limits_section(data, {});
    raytrace::read_measured_eye(whole, Laterality::od, {});
  } catch (const nlohmann::json::exception&) {  // write_report() makes a refusal of it
    put(before);
    return;
  } catch (...) {
    put(before);
    throw;
  }
  put(before);
}

// ---- cohorts

Seeds participants(Folder) {
  return {
      "participant_id\tstudy\tage\tkeratometry_od\taxial_length_os\tacd_od\tlens_thickness_od\trefraction_od\n"
      "a\t.\t41\t43.25@175/44.75@85+-0.25\t23.6\t3.4\tn/a\t-2.25/-1.00x180@12\n"
      "b\t.\tn/a\t\t23.60+-0.05\t\t3.7\tPL\n"};
}

constexpr auto sweep = R"(command = "trace"
[all]
samples = 64
diffraction = true
[vary]
eye = ["navarro", "arizona"]
pupil = [2, 4.5]
disc = [["od:4,0", "os:-4,0"]]
[columns]
coma_um = "/zernike_um/8"
)";

constexpr auto archive =
    R"({"host": "localhost", "port": 4242, "called_ae_title": "ORTHANC", "calling_ae_title": "EMMETROPE",
  "timeout_s": 60, "tls": {"authority": "ca.pem", "certificate": "own.pem", "key": "own.key"}})";

Seeds archive_settings(Folder folder) {
  for (const char* name : {"ca.pem", "own.pem", "own.key"}) write_file(folder.parent_path() / name, "");
  return {archive};
}

}  // namespace

std::vector<Door> case_doors() {
  return {
      {"stage.json", "stage.json", stage_files, mutate_json, read_stage_file},
      {"optics.json", "optics.json", [](Folder) { return Seeds{measured_optics().dump()}; }, mutate_json,
       read_optics},
      {"fit.json", "fit.json", [](Folder) { return Seeds{to_json(random_eye(3)).dump()}; }, mutate_json,
       read_fit},
      {"labels", "labels.nii", labels, mutate_bytes, read_labels},
      {"case", "file", files_of_a_case, mutate_file_of_a_case, read_a_case},
      {"participants.tsv", "participants.tsv", participants, mutate_text,
       [](const fs::path& file) { cohort::find_subjects(file); }},
      {"sweep.toml", "sweep.toml", [](Folder) { return Seeds{sweep}; }, mutate_text,
       [](const fs::path& file) { cohort::read_sweep(file); }},
      {"archive.json", "archive.json", archive_settings, mutate_json,
       [](const fs::path& file) { pacs::read_settings(file); }},
  };
}

}  // namespace emmetrope::fuzz
