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
#include "pipeline/report/content/judgement.hpp"
#include "pipeline/report/figures/retina_map.hpp"
#include "raytrace/case/measured_eye.hpp"
#include "segmentation/intake/nifti.hpp"
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

// ---- a finished case, of which one file is another

test::FixtureOptions of_one_eye() {
  test::FixtureOptions options;
  options.only_right = true;
  return options;
}

/// The sections of the report without figures, which take a second, and the eye as it is traced.
void read_a_case(const fs::path& whole) {
  try {
    const report::CaseData data = report::read_case(whole, LateralityChoice::both);
    report::Citations citations;
    for (const auto section : {report::measured_section, report::methods_section}) section(data, citations);
    for (const auto section :
         {report::peripheral_section, report::lenses_section, report::provenance_section})
      section(data);
    report::limits_section(data, {});
    for (const report::EyeData& eye : data.eyes) {
      report::judge(data, eye);
      if (eye.biometry.is_object()) report::read_retina_map(eye.biometry.value("retina", Json::object()));
    }
  } catch (const nlohmann::json::exception&) {  // write_report() makes a refusal of it
  }
  raytrace::read_measured_eye(whole, Laterality::od, {});
}

/// \param file  in the case
Door case_door(const fs::path& file) {
  const auto seeds = [file](Folder folder) {
    test::make_fixture_case(folder / "whole", of_one_eye());
    return Seeds{read_file(folder / "whole" / file)};
  };
  const fs::path kind = file.extension();
  std::function<std::string(const std::string&, Random&)> mutate = mutate_bytes;
  if (kind == ".json") mutate = mutate_json;
  if (kind == ".csv") mutate = mutate_text;
  const auto open = [file](const fs::path& changed) {
    const fs::path whole = changed.parent_path() / "case";
    if (!fs::exists(whole)) test::make_fixture_case(whole, of_one_eye());
    fs::copy_file(changed, whole / file, fs::copy_options::overwrite_existing);
    read_a_case(whole);
  };
  return {file.filename().string(), file.filename().string(), seeds, mutate, open};
}

// ---- cohorts

Seeds participants(Folder folder) {
  for (const char* study : {"study-a", "study-b"}) fs::create_directories(folder.parent_path() / study);
  return {
      "participant_id\tstudy\tage\tkeratometry_od\taxial_length_os\tacd_od\tlens_thickness_od\trefraction_od\n"
      "a\tstudy-a\t41\t43.25@175/44.75@85+-0.25\t23.6\t3.4\tn/a\t-2.25/-1.00x180@12\n"
      "b\tstudy-b\tn/a\t\t23.60+-0.05\t\t3.7\tPL\n"};
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
      case_door("case.json"),
      case_door("meshing/od/biometry.json"),
      case_door("meshing/od/cornea_anterior.ply"),
      case_door("raytrace/od/wavefront.json"),
      case_door("correction/od/prescription.json"),
      case_door("correction/od/sweep.csv"),
      {"participants.tsv", "participants.tsv", participants, mutate_text,
       [](const fs::path& file) { cohort::find_subjects(file); }},
      {"sweep.toml", "sweep.toml", [](Folder) { return Seeds{sweep}; }, mutate_text,
       [](const fs::path& file) { cohort::read_sweep(file); }},
      {"archive.json", "archive.json", archive_settings, mutate_json,
       [](const fs::path& file) { pacs::read_settings(file); }},
  };
}

}  // namespace emmetrope::fuzz
