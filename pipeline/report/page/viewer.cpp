#include "pipeline/report/page/viewer.hpp"

#include <fmt/format.h>
#include <zlib.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "pipeline/base/error.hpp"
#include "pipeline/report/figures/encoding.hpp"
#include "pipeline/report/figures/slices.hpp"

namespace emmetrope::report {

// viewer_library.cpp, made by CMake
extern const char* const viewer_library;
extern const unsigned long viewer_library_size;

namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;
using Eigen::Vector3i;

constexpr double shown_half_width_mm = 24;  ///< around each globe's centre
constexpr int coarsest = 4;                 ///< every fourth voxel along rows and columns

template <typename T>
void append(std::string& bytes, const T& value) {
  std::array<char, sizeof value> raw{};
  std::memcpy(raw.data(), &value, sizeof value);
  bytes.append(raw.data(), raw.size());
}

/// gzip without time or name, so that equal data give equal bytes.
std::string gzipped(const std::string& bytes) {
  z_stream stream{};
  constexpr int gzip_format = 15 + 16;
  if (deflateInit2(&stream, 9, Z_DEFLATED, gzip_format, 9, Z_DEFAULT_STRATEGY) != Z_OK)
    throw Error(ExitStatus::fault, "cannot compress a volume");
  std::string packed(deflateBound(&stream, bytes.size()) + 32, '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_out = static_cast<uInt>(packed.size());
  const int result = deflate(&stream, Z_FINISH);
  packed.resize(stream.total_out);
  deflateEnd(&stream);
  if (result != Z_STREAM_END) throw Error(ExitStatus::fault, "cannot compress a volume");
  return packed;
}

/// NIfTI-1 header of an 8-bit volume, RAS.
std::string nifti_header(const Vector3i& size, const Eigen::Matrix4d& lps_from_voxel) {
  std::string header(352, '\0');
  const auto put = [&](std::size_t at, auto value) { std::memcpy(header.data() + at, &value, sizeof value); };
  put(0, std::int32_t{348});
  put(40, std::int16_t{3});
  for (int axis = 0; axis < 3; ++axis) {
    put(42 + 2 * static_cast<std::size_t>(axis), static_cast<std::int16_t>(size[axis]));
    put(80 + 4 * static_cast<std::size_t>(axis),
        static_cast<float>(lps_from_voxel.block<3, 1>(0, axis).norm()));
    put(48 + 2 * static_cast<std::size_t>(axis), std::int16_t{1});
  }
  put(54, std::int16_t{1});
  put(70, std::int16_t{2});  // unsigned char
  put(72, std::int16_t{8});
  put(76, 1.0F);
  put(108, 352.0F);
  put(112, 1.0F);
  header[123] = 2;  // mm
  put(254, std::int16_t{1});
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 4; ++column)
      put(280 + 16 * static_cast<std::size_t>(row) + 4 * static_cast<std::size_t>(column),
          static_cast<float>((row < 2 ? -1 : 1) * lps_from_voxel(row, column)));
  std::memcpy(header.data() + 344, "n+1", 4);
  return header;
}

/// Every `step`-th voxel of a box.
struct Crop {
  Vector3i first, size;  ///< of the box, in voxels
  Vector3i step = Vector3i::Ones();

  Vector3i count() const { return (size + step - Vector3i::Ones()).cwiseQuotient(step); }
};

/// The voxels within reach of any globe's centre; nothing where the volume shows none.
std::optional<Crop> crop_of(const Volume& volume, const std::vector<Vector3d>& centres) {
  const Eigen::Matrix4d voxel_from_lps = volume.lps_from_voxel().inverse();
  Vector3d low = Vector3d::Constant(std::numeric_limits<double>::max()), high = -low;
  for (const auto& centre : centres) {
    if (volume.coverage(centre, 11) < 0.5) continue;
    for (int corner = 0; corner < 8; ++corner) {
      const Vector3d offset((corner & 1) != 0 ? 1 : -1, (corner & 2) != 0 ? 1 : -1,
                            (corner & 4) != 0 ? 1 : -1);
      const Vector3d voxel =
          (voxel_from_lps * (centre + shown_half_width_mm * offset).eval().homogeneous()).head<3>();
      low = low.cwiseMin(voxel);
      high = high.cwiseMax(voxel);
    }
  }
  Crop crop{Vector3i::Zero(), Vector3i::Zero(), Vector3i::Ones()};
  for (int axis = 0; axis < 3; ++axis) {
    const int last =
        std::min(volume.size()[axis] - 1, static_cast<int>(std::floor(std::min(high[axis], 1e6))));
    crop.first[axis] = std::max(0, static_cast<int>(std::ceil(std::max(low[axis], -1e6))));
    crop.size[axis] = last - crop.first[axis] + 1;
    if (low[axis] > high[axis] || crop.size[axis] < 2) return std::nullopt;
  }
  return crop;
}

/// Behind all centres of globes, or within one with its lids.
bool is_no_face(const Vector3d& place_lps, const std::vector<Vector3d>& centres) {
  constexpr double globe_and_lids_mm = 14;
  return std::all_of(centres.begin(), centres.end(),
                     [&](const Vector3d& centre) { return place_lps.y() >= centre.y(); }) ||
         std::any_of(centres.begin(), centres.end(), [&](const Vector3d& centre) {
           return (place_lps - centre).norm() <= globe_and_lids_mm;
         });
}

/// Calls `use` with each voxel of the crop in file order.
template <typename Use>
void each_voxel(const Volume& volume, const Crop& crop, const Use& use) {
  for (int k = 0; k < crop.size.z(); k += crop.step.z())
    for (int j = 0; j < crop.size.y(); j += crop.step.y())
      for (int i = 0; i < crop.size.x(); i += crop.step.x())
        use(volume.at(crop.first.x() + i, crop.first.y() + j, crop.first.z() + k));
}

/// Blackens the crop's voxels, in file order, that are of the face.
void take_face_off(std::string& voxels, const Volume& volume, const Crop& crop,
                   const std::vector<Vector3d>& centres) {
  const Eigen::Matrix4d lps_from_voxel = volume.lps_from_voxel();
  auto voxel = voxels.begin();
  for (int k = 0; k < crop.size.z(); k += crop.step.z())
    for (int j = 0; j < crop.size.y(); j += crop.step.y())
      for (int i = 0; i < crop.size.x(); i += crop.step.x(), ++voxel) {
        const Vector3d place = (crop.first + Vector3i(i, j, k)).cast<double>();
        if (!is_no_face((lps_from_voxel * place.homogeneous()).head<3>(), centres)) *voxel = 0;
      }
}

/// \param shift_mm  from the stack to where the surfaces are
std::string packed_nifti(const Volume& volume, const Crop& crop, const std::string& voxels,
                         const Vector3d& shift_mm) {
  Eigen::Matrix4d lps_from_voxel = volume.lps_from_voxel();
  lps_from_voxel.col(3) = volume.lps_from_voxel() * crop.first.cast<double>().eval().homogeneous();
  lps_from_voxel.block<3, 1>(0, 3) += shift_mm;
  lps_from_voxel.leftCols<3>() *= crop.step.cast<double>().asDiagonal();
  return base64(gzipped(nifti_header(crop.count(), lps_from_voxel) + voxels));
}

std::string windowed(const Volume& volume, const Crop& crop) {
  std::vector<float> values;
  each_voxel(volume, crop, [&](float value) { values.push_back(std::isfinite(value) ? value : 0); });
  std::vector<float> sorted = values;
  const auto percentile = [&](double share) {
    const auto at =
        sorted.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(sorted.size() - 1));
    std::nth_element(sorted.begin(), at, sorted.end());
    return *at;
  };
  const float low = percentile(0.01), high = std::max(percentile(0.995), low + 1e-6F);
  std::string voxels;
  for (const float value : values)
    voxels.push_back(
        static_cast<char>(std::lround(255 * std::clamp((value - low) / (high - low), 0.0F, 1.0F))));
  return voxels;
}

/// Binary STL in RAS, the viewer's frame.
std::string ras_stl(const TriangleMesh& mesh_lps) {
  std::string stl(80, ' ');
  append(stl, static_cast<std::uint32_t>(mesh_lps.triangles.size()));
  for (const auto& triangle : mesh_lps.triangles) {
    for (int i = 0; i < 3; ++i) append(stl, 0.0F);  // readers take the normal from the vertices
    for (const int corner : triangle) {
      const Vector3d& point = mesh_lps.vertices[static_cast<std::size_t>(corner)];
      append(stl, static_cast<float>(-point.x()));
      append(stl, static_cast<float>(-point.y()));
      append(stl, static_cast<float>(point.z()));
    }
    append(stl, std::uint16_t{0});
  }
  return stl;
}

std::vector<Vector3d> globe_centres(const CaseData& data) {
  std::vector<Vector3d> centres;
  for (const auto& eye : data.eyes)
    if (const auto centre = globe_centre(eye)) centres.push_back(*centre);
  return centres;
}

/// A stack as the viewer takes it; null where it shows no globe.
/// \param step  every step-th voxel along rows and columns; slices are few and all kept
Json volume_entry(const CaseData& data, const fs::path& file, int step, Face face) {
  const Volume volume(file);
  const std::vector<Vector3d> centres = globe_centres(data);
  auto crop = crop_of(volume, centres);
  if (!crop) return {};
  crop->step = Vector3i(step, step, 1);
  const std::string name = file.filename().string().substr(0, file.filename().string().size() - 7);
  const auto eye = std::find_if(data.eyes.begin(), data.eyes.end(), [&](const EyeData& candidate) {
    const auto centre = globe_centre(candidate);
    return centre && is_fitted_to(candidate, name) && volume.coverage(*centre, 11) >= 0.5;
  });
  if (eye == data.eyes.end()) return {};
  const Vector3d shift = head_shift(*eye, name), start = *globe_centre(*eye);
  std::string voxels = windowed(volume, *crop);
  if (face == Face::taken_off) {
    std::vector<Vector3d> in_stack = centres;
    for (Vector3d& centre : in_stack) centre -= shift;
    take_face_off(voxels, volume, *crop, in_stack);
  }
  Json entry{{"name", name},
             {"start_ras_mm", {-start.x(), -start.y(), start.z()}},
             {"data", packed_nifti(volume, *crop, voxels, shift)}};
  const fs::path labels = file.parent_path() / (name + "_labels.nii.gz");
  if (!fs::exists(labels)) return entry;
  const Volume label_volume(labels);
  if (label_volume.size() != volume.size()) return entry;
  voxels.clear();
  each_voxel(label_volume, *crop,
             [&](float value) { voxels.push_back(static_cast<char>(std::lround(value))); });
  entry["labels"] = packed_nifti(label_volume, *crop, voxels, shift);
  return entry;
}

Json mesh_entries(const CaseData& data) {
  Json meshes = Json::array();
  for (const auto& eye : data.eyes)
    for (const auto& [surface, colour] : {std::pair{"cornea_anterior", std::array<int, 3>{0, 210, 230}},
                                          std::pair{"lens_anterior", std::array<int, 3>{255, 140, 0}},
                                          std::pair{"lens_posterior", std::array<int, 3>{255, 140, 0}},
                                          std::pair{"retina", std::array<int, 3>{60, 220, 80}}})
      if (fs::exists(eye.mesh(surface)))
        meshes.push_back({{"name", eye.id() + "_" + surface},
                          {"colour", colour},
                          {"data", base64(ras_stl(read_mesh(eye.mesh(surface)).mesh))}});
  return meshes;
}

/// The stacks at one step, in their order, as many as there is room for.
struct Volumes {
  Json entries = Json::array();
  std::vector<std::string> left_out;
};

Volumes volumes_at(const CaseData& data, int step, std::size_t most_bytes, Face face) {
  Volumes volumes;
  std::size_t bytes = 0;
  for (const auto& file : data.stacks) {
    const Json entry = volume_entry(data, file, step, face);
    if (entry.is_null()) continue;
    const std::size_t added = entry.dump().size() + 1;
    if (bytes + added > most_bytes) {
      volumes.left_out.push_back(entry.at("name"));
      continue;
    }
    bytes += added;
    volumes.entries.push_back(entry);
  }
  return volumes;
}

}  // namespace

bool has_viewer_library() { return viewer_library_size > 0; }

ViewerData make_viewer_data(const CaseData& data, std::size_t most_bytes, Face face) {
  if (!has_viewer_library())
    return {"", "", "The interactive viewer is not part of this build of Emmetrope."};
  const Json meshes = mesh_entries(data);
  const std::size_t fixed_bytes = viewer_library_size + meshes.dump().size() + 100;
  Volumes volumes;
  int step = 1;
  if (fixed_bytes < most_bytes)
    for (; step <= coarsest; ++step) {
      volumes = volumes_at(data, step, most_bytes - fixed_bytes, face);
      if (volumes.left_out.empty()) break;
    }
  const std::string size = "the page would be larger than 10 MB.";
  if (fixed_bytes >= most_bytes || (volumes.entries.empty() && !volumes.left_out.empty()))
    return {"", "", "The interactive viewer is left out: with it " + size};
  if (volumes.entries.empty()) return {};
  std::string note;
  if (step > 1)
    note = fmt::format("The viewer shows every {} voxel of the slices, as otherwise {}",
                       std::array<const char*, 3>{"second", "third", "fourth"}.at(
                           static_cast<std::size_t>(std::min(step, coarsest)) - 2),
                       size);
  if (face == Face::taken_off)
    note +=
        std::string(note.empty() ? "" : " ") +
        "The face is taken off the viewer's slices: in front of the eyes' centres there are only eyes and lids.";
  if (!volumes.left_out.empty()) note += fmt::format(" It leaves out {}.", fmt::join(volumes.left_out, ", "));
  return {std::string(viewer_library, viewer_library_size),
          Json{{"volumes", volumes.entries}, {"meshes", meshes}}.dump(), note};
}

}  // namespace emmetrope::report
