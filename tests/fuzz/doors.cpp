#include "tests/fuzz/doors.hpp"

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>
#include <fmt/format.h>

#include <cmath>
#include <iterator>

#include "pipeline/base/files.hpp"
#include "pipeline/eye/exchange/eye_file.hpp"
#include "pipeline/eye/instruments/instruments.hpp"
#include "pipeline/eye/model/mesh_shape.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "raytrace/movement/movement.hpp"
#include "segmentation/intake/dicom_header.hpp"
#include "segmentation/intake/dicom_pixels.hpp"
#include "segmentation/intake/nifti.hpp"
#include "segmentation/intake/series_checks.hpp"
#include "segmentation/intake/sidecar.hpp"
#include "segmentation/intake/study.hpp"
#include "tests/fuzz/door_groups.hpp"
#include "tests/support/generated_series.hpp"
#include "tests/support/sheet.hpp"
#include "tests/support/vtp_files.hpp"

namespace emmetrope::fuzz {
namespace {

namespace fs = std::filesystem;
using Folder = const fs::path&;
using Seeds = std::vector<std::string>;

Seeds files_in(Folder folder) {
  Seeds seeds;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file()) seeds.push_back(read_file(entry.path()));
  return seeds;
}

// ---- studies

Seeds dicom_files(Folder folder) {
  segmentation::register_decoders();
  test::register_encoders();
  for (const E_TransferSyntax syntax :
       {EXS_LittleEndianExplicit, EXS_RLELossless, EXS_JPEGLSLossless, EXS_JPEGProcess14SV1}) {
    test::GeneratedSeries series;
    while (series.size() > 1) series.remove(1);
    series.write(folder / std::to_string(static_cast<int>(syntax)), syntax);
  }
  return files_in(folder);
}

void decode(const fs::path& file) {
  constexpr std::uint64_t most_bytes = 200'000'000;
  DcmFileFormat parsed;
  const segmentation::ImageHeader header =
      segmentation::read_header(file, parsed, segmentation::Request::everything);
  if (header.kind == segmentation::FileKind::image)
    segmentation::decode_pixels(parsed, most_bytes, [](const std::vector<std::int32_t>&) {});
}

segmentation::IntakeOptions quiet() {
  segmentation::IntakeOptions options;
  options.verbosity.quiet = true;
  return options;
}

/// One file of twelve is replaced: the others' geometry must come out, or a word about it.
void replace_one_of_a_series(const fs::path& file) {
  const fs::path folder = file.parent_path() / "study";
  static const segmentation::SeriesInfo whole = [&] {
    test::GeneratedSeries().write(folder);
    return segmentation::read_inventory(folder, quiet()).series.at(0);
  }();
  fs::copy_file(file, folder / whole.slices.at(5).file, fs::copy_options::overwrite_existing);
  const segmentation::StudyInventory inventory = segmentation::read_inventory(folder, quiet());
  if (!inventory.skipped.empty() || inventory.series.size() != 1) return;
  const segmentation::SeriesInfo& now = inventory.series[0];
  if (!now.usable || now.warnings != whole.warnings) return;
  const auto differs = [](const std::optional<double>& a, const std::optional<double>& b) {
    return a.has_value() != b.has_value() || (a && std::abs(*a / *b - 1) > 1e-4);
  };
  bool changed = now.slices.size() != whole.slices.size() || now.rows != whole.rows ||
                 now.columns != whole.columns || differs(now.row_spacing_mm, whole.row_spacing_mm) ||
                 differs(now.column_spacing_mm, whole.column_spacing_mm);
  for (std::size_t k = 0; !changed && k < whole.slices.size(); ++k)
    changed = (now.slices[k].position_mm - whole.slices[k].position_mm).norm() > 0.02;
  if (changed) throw std::logic_error("geometry changed without a word");
}

Seeds one_of_a_series(Folder folder) {
  test::GeneratedSeries series;
  return {read_file(series.write(folder).at(5))};
}

segmentation::Stack small_volume() {
  segmentation::Stack stack;
  stack.name = "volume";
  stack.rows = 6;
  stack.columns = 5;
  stack.row_spacing_mm = 0.7;
  stack.column_spacing_mm = 0.8;
  stack.slice_thickness_mm = 1.5;
  stack.along_row = Eigen::Vector3d::UnitX();
  stack.along_column = Eigen::Vector3d::UnitY();
  stack.normal = Eigen::Vector3d::UnitZ();
  for (int slice = 0; slice < 4; ++slice) {
    stack.slice_intensity.emplace_back(30, static_cast<float>(slice));
    stack.slice_position.emplace_back(0, 0, 1.5 * slice);
  }
  return stack;
}

Seeds volumes(Folder folder) {
  segmentation::write_nifti(folder / "volume.nii", small_volume());
  fs::remove(folder / "volume.json");
  return files_in(folder);
}

void read_volume(const fs::path& file) {
  std::vector<std::string> warnings;
  segmentation::read_nifti(file, warnings);
}

Seeds sidecars(Folder) {
  return {
      R"({"Modality": "MR", "ImageType": ["ORIGINAL", "PRIMARY", "M"], "ScanningSequence": "GR\\IR", "EchoTime": 0.003,
          "MRAcquisitionType": "3D", "PixelBandwidth": 190, "MagneticFieldStrength": 3, "PhaseEncodingDirection": "j-"})",
      R"({"ImageOrientationPatientDICOM": [0, 1, 0, 0, 0, -1], "InPlanePhaseEncodingDirectionDICOM": "ROW",
          "SliceThickness": 1, "BodyPartExamined": "HEAD", "FlipAngle": 9, "RepetitionTime": 2.3})"};
}

/// In the decoder's process and in that which judges.
void read_sidecar_of_volume(const fs::path& file) {
  std::vector<std::string> warnings;
  segmentation::ScannedFile sidecar;
  sidecar.file = file.filename();
  sidecar.is_sidecar = true;
  sidecar.header.data_set =
      segmentation::read_sidecar(fs::path(file).replace_extension(".nii"), small_volume(), warnings);
  segmentation::SeriesInfo info;
  segmentation::judge_sidecar(sidecar, quiet(), info);
}

// ---- meshes

TriangleMesh cube() {
  TriangleMesh mesh;
  for (const double x : {-1.0, 1.0})
    for (const double y : {-1.0, 1.0})
      for (const double z : {-1.0, 1.0}) mesh.vertices.emplace_back(x, y, z);
  mesh.triangles = {{0, 1, 3}, {0, 3, 2}, {4, 6, 7}, {4, 7, 5}, {0, 4, 5}, {0, 5, 1}, {2, 3, 7}, {2, 7, 6}};
  return mesh;
}

Door mesh_door(const std::string& ending) {
  const auto seeds = [ending](Folder folder) -> Seeds {
    const fs::path file = folder / ("mesh" + ending);
    write_mesh(file, cube(), true);
    return {read_file(file)};
  };
  return {ending.substr(1), "mesh" + ending, seeds, ending == ".obj" ? mutate_text : mutate_bytes,
          [](const fs::path& file) { read_mesh(file); }};
}

Door vtp_door() {
  const auto seeds = [](Folder) {
    auto files = testing_eye::vtp_files(cube());
    files.erase("lz4");  // is refused
    Seeds inputs;
    for (auto& [name, bytes] : files) inputs.push_back(std::move(bytes));
    return inputs;
  };
  const auto mutate = [](const std::string& input, Random& random) {
    return random() % 2 == 0 ? mutate_text(input, random) : mutate_bytes(input, random);
  };
  return {"vtp", "mesh.vtp", seeds, mutate, [](const fs::path& file) { read_mesh(file); }};
}

// ---- eyes, tables

Seeds eye_files(Folder folder, const char* ending) {
  for (const char* name : {"navarro", "liou-brennan", "gullstrand", "arizona"})
    write_eye_file(folder / (name + std::string(ending)), make_eye(name));
  Seeds seeds;
  for (const auto& entry : fs::directory_iterator(folder))
    if (entry.path().extension() == ending) seeds.push_back(read_file(entry.path()));
  return seeds;
}

/// One of them with a mesh, which stays beside the eye.
Seeds eye_jsons(Folder folder) {
  Seeds seeds = eye_files(folder, ".json");
  const fs::path file = folder.parent_path() / "eye.json", mesh = folder.parent_path() / "cornea.ply";
  write_mesh(mesh, testing_eye::jittered_sheet(*make_sphere(7.8), 5, 200, 1), false);
  EyeModel eye = make_eye("navarro");
  eye.surfaces.front() = read_mesh_surface("cornea_anterior", mesh, {}, "cornea");
  write_eye_file(file, eye);
  seeds.push_back(read_file(file));
  return seeds;
}

/// Its glass catalogue stays beside the lens.
Seeds zemax_lens(Folder folder) {
  const fs::path file = folder.parent_path() / "lens.zmx";
  write_eye_file(file, make_eye("navarro"));
  return {read_file(file)};
}

double cornea_um(double x, double y) { return -1e3 * (x * x + y * y) / 2 / 7.8; }

Seeds topographies(Folder) {
  std::string columns = "x_mm,y_mm,elevation_um\n", matrix = "elevation_um";
  for (int i = -6; i <= 6; ++i) matrix += fmt::format(",{:.1f}", 0.6 * i);
  for (int i = -6; i <= 6; ++i) {
    matrix += fmt::format("\n{:.1f}", 0.6 * i);
    for (int j = -6; j <= 6; ++j) {
      const double x = 0.6 * j, y = 0.6 * i;
      columns += fmt::format("{:.1f},{:.1f},{:.2f}\n", x, y, cornea_um(x, y));
      matrix += fmt::format(",{:.2f}", cornea_um(x, y));
    }
  }
  return {columns, matrix + "\n"};
}

void read_topography(const fs::path& file) { analyse_topography(read_elevation_map(file), 0.25); }

Seeds movements(Folder) { return {"time_s,horizontal_deg,vertical_deg\n0,0,0\n0.01,0.1,0\n0.02,0.3,-0.1\n"}; }

std::vector<Door> reader_doors() {
  return {
      {"dicom", "image.dcm", dicom_files, mutate_dicom, decode},
      {"study", "image.dcm", one_of_a_series, mutate_dicom, replace_one_of_a_series},
      {"nifti", "volume.nii", volumes, mutate_bytes, read_volume},
      {"sidecar", "volume.json", sidecars, mutate_json, read_sidecar_of_volume},
      mesh_door(".ply"),
      mesh_door(".stl"),
      mesh_door(".obj"),
      vtp_door(),
      {"eye.json", "eye.json", eye_jsons, mutate_json, [](const fs::path& file) { read_eye_file(file); }},
      {"zmx", "lens.zmx", zemax_lens, mutate_text, [](const fs::path& file) { read_eye_file(file); }},
      {"topography.csv", "map.csv", topographies, mutate_text, read_topography},
      {"topography.json", "map.json",
       [](Folder) {
         return Seeds{R"({"zone_mm": 8, "zernike_um": [0, 0, 0, 3, 296, -5, 1, 0.5, -0.2, 0.1]})"};
       },
       mutate_json, read_topography},
      {"movement.csv", "eye.csv", movements, mutate_text,
       [](const fs::path& file) { raytrace::read_movement(file); }},
  };
}

}  // namespace

const std::vector<Door>& doors() {
  static const std::vector<Door> all = [] {
    std::vector<Door> joined;
    for (auto group : {reader_doors(), scene_doors(), case_doors(), option_doors()})
      joined.insert(joined.end(), std::make_move_iterator(group.begin()),
                    std::make_move_iterator(group.end()));
    return joined;
  }();
  return all;
}

}  // namespace emmetrope::fuzz
