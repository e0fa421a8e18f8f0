#include <fmt/format.h>
#include <zlib.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cstring>
#include <limits>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/json.hpp"
#include "segmentation/intake/nifti.hpp"
#include "segmentation/intake/sidecar_files.hpp"
#include "segmentation/intake/slice_grid.hpp"

namespace emmetrope::segmentation {
namespace {

template <typename T>
void put(std::string& bytes, std::size_t offset, T value) {
  std::memcpy(bytes.data() + offset, &value, sizeof value);
}

/// Position of voxel (0, 0, 0): the mean of what each slice says.
Eigen::Vector3d origin_of(const Stack& stack, const SliceGrid& grid) {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  for (int i = 0; i < stack.slices(); ++i)
    origin += (stack.slice_position[i] - stack.normal * grid.spacing_mm * grid.plane[i]) / stack.slices();
  return origin;
}

/// A NIfTI-1 header and its empty extension flag (nifti1.h), little endian as every machine we run on.
std::string header_of(const Stack& stack, const SliceGrid& grid, std::int16_t datatype, std::int16_t bits) {
  std::string bytes(352, '\0');
  put<std::int32_t>(bytes, 0, 348);
  const std::array<std::int16_t, 8> dim{3,
                                        static_cast<std::int16_t>(stack.columns),
                                        static_cast<std::int16_t>(stack.rows),
                                        static_cast<std::int16_t>(grid.planes()),
                                        1,
                                        1,
                                        1,
                                        1};
  const std::array<double, 8> pixdim{
      1, stack.column_spacing_mm, stack.row_spacing_mm, grid.spacing_mm, 0, 0, 0, 0};
  for (std::size_t i = 0; i < 8; ++i) {
    put(bytes, 40 + 2 * i, dim[i]);
    put(bytes, 76 + 4 * i, static_cast<float>(pixdim[i]));
  }
  put(bytes, 70, datatype);
  put(bytes, 72, bits);
  put(bytes, 108, 352.0F);
  put(bytes, 112, 1.0F);
  bytes[123] = 2;  // mm
  const std::string description =
      fmt::format("Emmetrope; slices within {:.3f} mm of this grid", grid.deviation_mm);
  bytes.replace(148, description.size(), description);
  put<std::int16_t>(bytes, 252, 1);  // scanner
  put<std::int16_t>(bytes, 254, 1);

  Eigen::Matrix3d rotation;
  rotation << stack.along_row, stack.along_column, stack.normal;
  const Eigen::Vector3d ras_from_lps(-1, -1, 1);
  rotation = ras_from_lps.asDiagonal() * rotation;
  const Eigen::Vector3d origin = ras_from_lps.cwiseProduct(origin_of(stack, grid));
  Eigen::Quaterniond turn(rotation);
  if (turn.w() < 0) turn.coeffs() *= -1;
  const std::array<double, 6> quaternion_offset{turn.x(),   turn.y(),   turn.z(),
                                                origin.x(), origin.y(), origin.z()};
  for (std::size_t i = 0; i < 6; ++i) put(bytes, 256 + 4 * i, static_cast<float>(quaternion_offset[i]));
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k)
      put(bytes, 280 + 16 * static_cast<std::size_t>(i) + 4 * static_cast<std::size_t>(k),
          static_cast<float>(rotation(i, k) * pixdim[static_cast<std::size_t>(k) + 1]));
    put(bytes, 292 + 16 * static_cast<std::size_t>(i), static_cast<float>(origin[i]));
  }
  std::memcpy(bytes.data() + 344, "n+1", 4);
  return bytes;
}

/// Gzip without name and time, so that equal bytes give equal files.
std::string gzipped(const std::string& bytes) {
  z_stream stream{};
  if (deflateInit2(&stream, 3, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY) != Z_OK)
    throw Error(ExitStatus::fault, "zlib cannot be started");
  std::string packed(deflateBound(&stream, bytes.size()), '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.next_out = reinterpret_cast<Bytef*>(packed.data());
  // zlib counts in 32 bits, so feed and drain in pieces.
  std::uint64_t in_left = bytes.size(), out_left = packed.size();
  int state = Z_OK;
  while (state == Z_OK) {
    constexpr std::uint64_t piece = 1U << 30;
    const auto in = static_cast<uInt>(std::min(in_left, piece)),
               out = static_cast<uInt>(std::min(out_left, piece));
    stream.avail_in = in;
    stream.avail_out = out;
    state = deflate(&stream, in_left <= piece ? Z_FINISH : Z_NO_FLUSH);
    in_left -= in - stream.avail_in;
    out_left -= out - stream.avail_out;
  }
  deflateEnd(&stream);
  if (state != Z_STREAM_END) throw Error(ExitStatus::fault, "zlib failed");
  packed.resize(packed.size() - out_left);
  return packed;
}

void write_volume(const std::filesystem::path& file, const std::string& bytes) {
  write_file(file, file.extension() == ".gz" ? gzipped(bytes) : bytes);
}

void check(const std::filesystem::path& file, const Stack& stack, const SliceGrid& grid) {
  constexpr int largest = std::numeric_limits<std::int16_t>::max();
  if (stack.slices() == 0 || stack.columns > largest || stack.rows > largest || grid.planes() > largest)
    throw output_error(fmt::format("{}: NIfTI-1 cannot hold {} x {} x {} voxels", file.string(),
                                   stack.columns, stack.rows, grid.planes()));
}

/// slices on the planes of the grid, planes without a slice filled with `absent`
template <typename T>
void append_planes(const std::vector<std::vector<T>>& slices, const SliceGrid& grid, T absent,
                   std::string& bytes) {
  const std::size_t voxels = slices.front().size();
  const std::vector<T> gap(voxels, absent);
  bytes.reserve(bytes.size() + static_cast<std::size_t>(grid.planes()) * voxels * sizeof(T));
  for (std::size_t i = 0, plane = 0; i < slices.size(); ++plane) {
    const auto& values = grid.plane[i] == static_cast<int>(plane) ? slices[i++] : gap;
    bytes.append(reinterpret_cast<const char*>(values.data()), voxels * sizeof(T));
  }
}

}  // namespace

void write_nifti(const std::filesystem::path& file, const Stack& stack) {
  const SliceGrid grid = fit_slice_grid(stack);
  check(file, stack, grid);
  std::string bytes = header_of(stack, grid, 16, 32);
  float highest = 0;
  for (const auto& slice : stack.slice_intensity)
    highest = std::max(highest, *std::max_element(slice.begin(), slice.end()));
  put(bytes, 124, highest);  // cal_max: what viewers show as white
  append_planes(stack.slice_intensity, grid, std::numeric_limits<float>::quiet_NaN(), bytes);
  write_volume(file, bytes);

  Json slices = Json::array();
  for (int i = 0; i < stack.slices(); ++i)
    slices.push_back(
        {{"plane", grid.plane[i]},
         {"position_lps_mm",
          {stack.slice_position[i].x(), stack.slice_position[i].y(), stack.slice_position[i].z()}}});
  write_json(sidecar_of(file), {{"largest_distance_from_grid_mm", grid.deviation_mm},
                                {"slice_thickness_mm", stack.slice_thickness_mm},
                                {"slices", slices}});
}

void write_label_nifti(const std::filesystem::path& file, const Stack& stack,
                       const std::vector<std::vector<std::uint8_t>>& labels) {
  const SliceGrid grid = fit_slice_grid(stack);
  check(file, stack, grid);
  std::string bytes = header_of(stack, grid, 2, 8);
  append_planes(labels, grid, std::uint8_t{0}, bytes);
  write_volume(file, bytes);
}

}  // namespace emmetrope::segmentation
