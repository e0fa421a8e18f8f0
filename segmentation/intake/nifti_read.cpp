#include <fmt/format.h>
#include <zlib.h>

#include <array>
#include <cmath>
#include <cstring>
#include <memory>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "segmentation/intake/nifti.hpp"
#include "segmentation/intake/plausible.hpp"

namespace emmetrope::segmentation {
namespace {

constexpr std::uint64_t largest_volume_bytes = 4'000'000'000;
constexpr double largest_shear_deg = 0.1;

/// Bytes of a file, gzipped or not, in the order that they come.
class ByteReader {
 public:
  explicit ByteReader(const std::filesystem::path& file)
      : file_(file), stream_(::gzopen(file.c_str(), "rb"), &::gzclose) {
    if (!stream_) throw input_error(file.string() + ": cannot be opened");
    ::gzbuffer(stream_.get(), 1 << 17);
  }
  /// \throw Error when the file ends before
  void read(void* target, std::uint64_t size, const char* what) {
    auto* bytes = static_cast<char*>(target);
    while (size > 0) {
      const int got =
          ::gzread(stream_.get(), bytes, static_cast<unsigned>(std::min<std::uint64_t>(size, 1 << 24)));
      if (got <= 0) fail(what);
      bytes += got;
      size -= static_cast<std::uint64_t>(got);
    }
  }
  /// Nothing more is wanted; at the end of a gzip stream its checksum is compared.
  /// \throw Error
  void finish() {
    char unused = 0;
    if (::gzread(stream_.get(), &unused, 1) < 0) fail("end");
  }
  void skip(std::uint64_t size, const char* what) {
    std::vector<char> unused(size);
    read(unused.data(), size, what);
  }

 private:
  [[noreturn]] void fail(const char* what) {
    int code = Z_OK;
    ::gzerror(stream_.get(), &code);
    if (code == Z_DATA_ERROR)
      throw input_error(file_.string() + ": its gzip stream is damaged (contents or checksum)",
                        "copy or export it again");
    throw input_error(fmt::format("{}: ends within its {}", file_.string(), what), "copy or export it again");
  }

  std::filesystem::path file_;
  std::unique_ptr<gzFile_s, decltype(&::gzclose)> stream_;
};

/// Fields of a header in either byte order.
class Fields {
 public:
  Fields(std::vector<unsigned char> bytes, bool swapped) : bytes_(std::move(bytes)), swapped_(swapped) {}
  template <typename T>
  T at(std::size_t offset) const {
    std::array<unsigned char, sizeof(T)> raw{};
    std::copy_n(bytes_.begin() + static_cast<std::ptrdiff_t>(offset), sizeof(T), raw.begin());
    if (swapped_) std::reverse(raw.begin(), raw.end());
    T value;
    std::memcpy(&value, raw.data(), sizeof(T));
    return value;
  }

 private:
  std::vector<unsigned char> bytes_;
  bool swapped_;
};

/// What matters of a NIfTI-1 or NIfTI-2 header (nifti1.h, nifti2.h).
struct Header {
  bool swapped = false;
  std::array<std::int64_t, 8> dim{};
  std::array<double, 8> pixdim{};
  int datatype = 0, bits = 0;
  std::int64_t offset = 0;
  double slope = 0, intercept = 0;
  int qform_code = 0, sform_code = 0, units = 0, intent = 0;
  std::array<double, 3> quaternion{}, q_offset{};
  Eigen::Matrix4d sform = Eigen::Matrix4d::Identity();
};

/// Offsets of the fields; Int, Real and Code are the types of dim, of real numbers and of the form codes.
struct Offsets {
  std::size_t dim, pixdim, datatype, bitpix, offset, slope, quaternion, q_offset, qform_code, sform_code,
      srow, units, intent;
};
constexpr Offsets nifti1{40, 76, 70, 72, 108, 112, 256, 268, 252, 254, 280, 123, 68};
constexpr Offsets nifti2{16, 104, 12, 14, 168, 176, 352, 376, 344, 348, 400, 500, 504};

template <typename Int, typename Real, typename Code>
void read_fields(const Fields& fields, const Offsets& at, Header& header) {
  for (std::size_t i = 0; i < 8; ++i) {
    header.dim[i] = fields.at<Int>(at.dim + i * sizeof(Int));
    header.pixdim[i] = fields.at<Real>(at.pixdim + i * sizeof(Real));
  }
  header.datatype = fields.at<std::int16_t>(at.datatype);
  header.bits = fields.at<std::int16_t>(at.bitpix);
  header.slope = fields.at<Real>(at.slope);
  header.intercept = fields.at<Real>(at.slope + sizeof(Real));
  header.qform_code = fields.at<Code>(at.qform_code);
  header.sform_code = fields.at<Code>(at.sform_code);
  header.intent = fields.at<Code>(at.intent);
  for (std::size_t i = 0; i < 3; ++i) {
    header.quaternion[i] = fields.at<Real>(at.quaternion + i * sizeof(Real));
    header.q_offset[i] = fields.at<Real>(at.q_offset + i * sizeof(Real));
    for (std::size_t k = 0; k < 4; ++k)
      header.sform(static_cast<int>(i), static_cast<int>(k)) =
          fields.at<Real>(at.srow + (4 * i + k) * sizeof(Real));
  }
}

Header read_header(ByteReader& reader, const std::string& name) {
  std::vector<unsigned char> bytes(348);
  reader.read(bytes.data(), bytes.size(), "header");
  Header header;
  const std::array<unsigned char, 4> size{bytes[0], bytes[1], bytes[2], bytes[3]};
  using Size = std::array<unsigned char, 4>;
  const bool first = size == Size{0x5C, 1, 0, 0} || size == Size{0, 0, 1, 0x5C};   // 348
  const bool second = size == Size{0x1C, 2, 0, 0} || size == Size{0, 0, 2, 0x1C};  // 540
  if (!first && !second) throw input_error(name + ": not a NIfTI file, sizeof_hdr is neither 348 nor 540");
  header.swapped = size[0] == 0;
  if (first) {
    if (std::memcmp(bytes.data() + 344, "n+1", 4) != 0)
      throw unsupported_error(
          name + ": magic is not n+1; header and image in one .nii or .nii.gz file are required");
    const Fields fields(bytes, header.swapped);
    read_fields<std::int16_t, float, std::int16_t>(fields, nifti1, header);
    header.units = bytes[nifti1.units];
    const double offset = fields.at<float>(nifti1.offset);
    if (!std::isfinite(offset))
      throw input_error(fmt::format("{}: vox_offset {} is impossible", name, offset));
    header.offset = static_cast<std::int64_t>(std::clamp(offset, -1e9, 1e9));
  } else {
    bytes.resize(540);
    reader.read(bytes.data() + 348, 540 - 348, "header");
    if (std::memcmp(bytes.data() + 4, "n+2", 4) != 0)
      throw unsupported_error(
          name + ": magic is not n+2; header and image in one .nii or .nii.gz file are required");
    const Fields fields(bytes, header.swapped);
    read_fields<std::int64_t, double, std::int32_t>(fields, nifti2, header);
    header.units = fields.at<std::int32_t>(nifti2.units);
    header.offset = fields.at<std::int64_t>(nifti2.offset);
  }
  const std::int64_t header_bytes = first ? 348 : 540;
  if (header.offset < header_bytes || header.offset > header_bytes + (1 << 26))
    throw input_error(fmt::format("{}: vox_offset {} is impossible", name, header.offset));
  reader.skip(static_cast<std::uint64_t>(header.offset - header_bytes), "header extensions");
  return header;
}

void check_sizes(const Header& header, const std::string& name) {
  const auto& dim = header.dim;
  if (dim[0] < 3 || dim[0] > 7)
    throw unsupported_error(fmt::format("{}: dim[0] is {}; a volume has 3", name, dim[0]));
  for (std::int64_t i = 1; i <= dim[0]; ++i) {
    const std::int64_t size = dim[static_cast<std::size_t>(i)];
    if (size < 1 || (i <= 3 && size > 65'535))
      throw input_error(fmt::format("{}: dim[{}] is {}", name, i, size));
    if (i > 3 && size > 1)
      throw unsupported_error(
          i == 4 ? fmt::format("{}: dim[4] is {}: several volumes; give one", name, size)
                 : fmt::format("{}: dim[{}] is {}: several values of each voxel (colours, a vector?); give a "
                               "volume of one",
                               name, i, size));
  }
  if (static_cast<double>(dim[1]) * static_cast<double>(dim[2]) * static_cast<double>(dim[3]) *
          sizeof(float) >
      static_cast<double>(largest_volume_bytes))
    throw input_error(fmt::format("{}: dim {} x {} x {} is too large", name, dim[1], dim[2], dim[3]));
}

Eigen::Matrix4d affine_of_qform(const Header& header) {
  const auto [b, c, d] = header.quaternion;
  const double a = std::sqrt(std::max(0.0, 1 - b * b - c * c - d * d));
  Eigen::Matrix3d rotation = Eigen::Quaterniond(a, b, c, d).normalized().toRotationMatrix();
  const double qfac = header.pixdim[0] < 0 ? -1 : 1;
  rotation.col(2) *= qfac;
  Eigen::Matrix4d affine = Eigen::Matrix4d::Identity();
  for (int i = 0; i < 3; ++i) {
    affine.block<3, 1>(0, i) = rotation.col(i) * header.pixdim[static_cast<std::size_t>(i) + 1];
    affine(i, 3) = header.q_offset[static_cast<std::size_t>(i)];
  }
  return affine;
}

/// Of the header's unit of length; none stated is taken as mm, as all programs do.
double mm_of_unit(const Header& header, const std::string& name) {
  switch (header.units & 7) {
    case 0:
    case 2:
      return 1;
    case 1:
      return 1000;
    case 3:
      return 1e-3;
    default:
      throw input_error(
          fmt::format("{}: xyzt_units is {}: its unit of length is not known", name, header.units),
          "1 (m), 2 (mm) and 3 (um) are");
  }
}

/// Whether a form's coordinates are Talairach's, MNI's or another template's.
bool is_of_template(int form_code) { return form_code >= 3; }

/// Largest relative difference of the voxels' sides in the sform from pixdim, which is the qform's; 0 where that is none.
double sides_differ_by(const Header& header) {
  const Eigen::Vector3d told(header.pixdim[1], header.pixdim[2], header.pixdim[3]),
      used = header.sform.topLeftCorner<3, 3>().colwise().norm().transpose();
  return told.minCoeff() > 0 && told.allFinite() ? (used.array() / told.array() - 1).abs().maxCoeff() : 0;
}
constexpr double same_side = 0.01;

/// The sform, where there is one; but the scanner's own qform before a template's, and before one that is aligned to
/// another scan (2) and scaled.
bool uses_sform(const Header& header) {
  if (header.sform_code <= 0 || header.qform_code <= 0) return header.sform_code > 0;
  const bool is_templates = is_of_template(header.sform_code) && !is_of_template(header.qform_code);
  const bool is_scaled =
      header.sform_code == 2 && header.qform_code == 1 && sides_differ_by(header) > same_side;
  return !is_templates && !is_scaled;
}

/// NIfTI's intent codes (nifti1.h) name statistics (2 to 24) and estimates, labels, vectors and shapes (1001 to 1010), whose
/// values are no signal. Labels that are given as such have them by right.
void judge_intent(const Header& header, const std::string& name, std::vector<std::string>& warnings) {
  const int code = header.intent;
  if ((code >= 2 && code <= 24) || (code >= 1001 && code <= 1010))
    warnings.push_back(fmt::format(
        "{}: intent_code is {}, a statistic's, a label's or a map's, which is no image", name, code));
}

/// Whether the header's two forms are one, but for rounding; what differs is warned of.
bool compare_forms(const Header& header, double to_mm, const std::string& name,
                   std::vector<std::string>& warnings) {
  const Eigen::Matrix4d sform = header.sform, qform = affine_of_qform(header);
  const bool both_are_the_scanners = !is_of_template(header.sform_code) && !is_of_template(header.qform_code);
  if (both_are_the_scanners &&
      sform.topLeftCorner<3, 3>().determinant() * qform.topLeftCorner<3, 3>().determinant() < 0)
    throw input_error(name + ": sform and qform contradict each other about left and right",
                      "convert the scan again with a program that keeps its orientation");
  const Eigen::Vector4d far(static_cast<double>(header.dim[1]), static_cast<double>(header.dim[2]),
                            static_cast<double>(header.dim[3]), 1);
  const Eigen::Matrix4d difference = sform - qform;
  const double distance =
      to_mm * std::max((difference * far).head<3>().norm(), difference.col(3).head<3>().norm());
  if (distance < 0.1) return true;
  warnings.push_back(fmt::format(
      "{}: sform and qform differ by {:.2f} mm; the {}", name, distance,
      uses_sform(header) ? "sform is used"
      : is_of_template(header.sform_code)
          ? "qform is used, as the sform is a template's"
          : "qform is used, the scanner's own, as the sform is aligned to another scan and scaled"));
  return false;
}

/// lps_from_voxel, mm.
Eigen::Matrix4d affine_of(const Header& header, const std::string& name) {
  if (header.sform_code <= 0 && header.qform_code <= 0)
    throw input_error(name + ": sform_code and qform_code are 0: left and right cannot be told",
                      "convert the scan again with a program that keeps its orientation");
  Eigen::Matrix4d affine = uses_sform(header) ? header.sform : affine_of_qform(header);
  if (!affine.allFinite()) throw input_error(name + ": its orientation is not finite");
  affine.topRows<3>() *= mm_of_unit(header, name);
  affine.topRows<2>() *= -1;  // RAS to LPS
  return affine;
}

/// Sides of the voxels that an sform contradicts, which is used.
void compare_voxel_sides(const Header& header, double to_mm, const std::string& name,
                         std::vector<std::string>& warnings) {
  const double difference = sides_differ_by(header);
  if (difference <= same_side) return;
  const Eigen::Vector3d told = to_mm * Eigen::Vector3d(header.pixdim[1], header.pixdim[2], header.pixdim[3]),
                        used = to_mm * header.sform.topLeftCorner<3, 3>().colwise().norm().transpose();
  warnings.push_back(fmt::format(
      "{}: pixdim is {:.4g} x {:.4g} x {:.4g} mm, but voxels of the sform are {:.4g} x {:.4g} x {:.4g} mm; "
      "the sform is used, and where pixdim is right lengths are wrong by up to {:.0f} %",
      name, told.x(), told.y(), told.z(), used.x(), used.y(), used.z(), 100 * difference));
}

/// Whether the voxels are those in which programs write what they registered to a template, along its axes, whatever their
/// codes say: FSL's in 1 and 2 mm, MNI 2009c, SPM's bounding box, MNI305, CAT12.
bool lies_on_template_grid(const Header& header) {
  struct Grid {
    std::array<int, 3> voxels;
    double side_mm;
  };
  constexpr Grid grids[] = {{{182, 218, 182}, 1},   {{91, 109, 91}, 2},   {{193, 229, 193}, 1},
                            {{197, 233, 189}, 1},   {{181, 217, 181}, 1}, {{79, 95, 79}, 2},
                            {{121, 145, 121}, 1.5}, {{157, 189, 156}, 1}, {{113, 137, 113}, 1.5}};
  const Eigen::Matrix3d axes = affine_of(header, "").topLeftCorner<3, 3>();
  for (const Grid& grid : grids) {
    const bool same_voxels =
        header.dim[1] == grid.voxels[0] && header.dim[2] == grid.voxels[1] && header.dim[3] == grid.voxels[2];
    const Eigen::Matrix3d along = axes.cwiseAbs() - grid.side_mm * Eigen::Matrix3d::Identity();
    if (same_voxels && along.cwiseAbs().maxCoeff() < 1e-3) return true;
  }
  return false;
}

/// What the codes of the forms say of lengths and sides.
void judge_forms(const Header& header, const std::string& name, std::vector<std::string>& warnings) {
  const bool are_one = header.sform_code > 0 && header.qform_code > 0 &&
                       compare_forms(header, mm_of_unit(header, name), name, warnings);
  if (uses_sform(header)) compare_voxel_sides(header, mm_of_unit(header, name), name, warnings);
  const bool by_sform = uses_sform(header) || (are_one && is_of_template(header.sform_code));
  if (const int code = by_sform ? header.sform_code : header.qform_code; is_of_template(code))
    warnings.push_back(
        fmt::format("{}: {} is {}, a template's coordinates (Talairach, MNI): where the head was "
                    "scaled to fit it, every length is the template's and not the person's",
                    name, by_sform ? "sform_code" : "qform_code", code));
  else if (lies_on_template_grid(header))
    warnings.push_back(fmt::format(
        "{}: its {} x {} x {} voxels along the axes are those of the MNI template: where the head was "
        "scaled to fit it, every length is the template's and not the person's",
        name, header.dim[1], header.dim[2], header.dim[3]));
}

template <typename T>
void convert(const std::vector<unsigned char>& bytes, bool swapped, double slope, double intercept,
             std::vector<float>& values) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    std::array<unsigned char, sizeof(T)> raw{};
    std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(i * sizeof(T)), sizeof(T), raw.begin());
    if (swapped) std::reverse(raw.begin(), raw.end());
    T value;
    std::memcpy(&value, raw.data(), sizeof(T));
    values[i] = static_cast<float>(slope * static_cast<double>(value) + intercept);
  }
}

struct Format {
  std::size_t bytes;
  void (*convert)(const std::vector<unsigned char>&, bool, double, double, std::vector<float>&);
};

Format format_of_datatype(const Header& header, const std::string& name) {
  switch (header.datatype) {
    case 2:
      return {1, convert<std::uint8_t>};
    case 4:
      return {2, convert<std::int16_t>};
    case 8:
      return {4, convert<std::int32_t>};
    case 16:
      return {4, convert<float>};
    case 64:
      return {8, convert<double>};
    case 256:
      return {1, convert<std::int8_t>};
    case 512:
      return {2, convert<std::uint16_t>};
    case 768:
      return {4, convert<std::uint32_t>};
    default:
      throw unsupported_error(
          fmt::format("{}: datatype {} is not one real number a voxel", name, header.datatype));
  }
}

Format format_of(const Header& header, const std::string& name) {
  const Format format = format_of_datatype(header, name);
  if (header.bits != static_cast<int>(8 * format.bytes))
    throw input_error(fmt::format("{}: bitpix is {}, but datatype {} has {} bits", name, header.bits,
                                  header.datatype, 8 * format.bytes));
  return format;
}

Stack geometry_of(const Header& header, const Eigen::Matrix4d& affine, const std::string& name) {
  Stack stack;
  stack.columns = static_cast<int>(header.dim[1]);
  stack.rows = static_cast<int>(header.dim[2]);
  const Eigen::Vector3d i = affine.block<3, 1>(0, 0), j = affine.block<3, 1>(0, 1),
                        k = affine.block<3, 1>(0, 2);
  for (const Eigen::Vector3d& side : {i, j, k})
    if (!is_plausible_spacing(side.norm()))
      throw input_error(
          fmt::format("{}: voxels of {:g} x {:g} x {:g} mm by {} and xyzt_units; sides of {:g} to "
                      "{:g} mm are read",
                      name, i.norm(), j.norm(), k.norm(), uses_sform(header) ? "srow_x, y, z" : "pixdim",
                      least_spacing_mm, largest_spacing_mm));
  stack.column_spacing_mm = i.norm();
  stack.row_spacing_mm = j.norm();
  stack.slice_thickness_mm = k.norm();
  stack.along_row = i.normalized();
  const double skew = stack.along_row.dot(j.normalized());
  stack.along_column = (j - stack.along_row * stack.along_row.dot(j)).normalized();
  stack.normal = stack.along_row.cross(stack.along_column);
  const double shear = std::acos(std::min(1.0, std::abs(k.normalized().dot(stack.normal)))) / degree;
  if (std::abs(skew) > 1e-3 || shear > largest_shear_deg)
    throw input_error(
        fmt::format("{}: its axes are not at right angles (rows {:.2f}, slices {:.2f} degrees off)", name,
                    std::abs(std::asin(std::clamp(skew, -1.0, 1.0))) / degree, shear));
  return stack;
}

}  // namespace

Stack read_nifti(const std::filesystem::path& file, std::vector<std::string>& warnings) {
  const std::string name = file.string();
  ByteReader reader(file);
  const Header header = read_header(reader, name);
  check_sizes(header, name);
  const Format format = format_of(header, name);
  const double slope = header.slope == 0 ? 1 : header.slope,  // 0: no scale
      intercept = header.slope == 0 ? 0 : header.intercept;
  if (!is_plausible_slope(slope))
    throw input_error(fmt::format("{}: scl_slope is {:g}; 0 (none) or a number from {:g} to {:g} is required",
                                  name, slope, least_slope, largest_slope));
  if (!is_plausible_intercept(intercept, slope))
    throw input_error(fmt::format("{}: scl_inter is {:g}; at most {:g} times scl_slope is read", name,
                                  intercept, largest_intercept));
  const Eigen::Matrix4d affine = affine_of(header, name);
  Stack stack = geometry_of(header, affine, name);
  judge_forms(header, name, warnings);
  judge_intent(header, name, warnings);
  stack.name = "volume";

  const std::size_t voxels = static_cast<std::size_t>(stack.rows) * static_cast<std::size_t>(stack.columns);
  std::vector<unsigned char> bytes(voxels * format.bytes);
  std::vector<float> values(voxels);
  for (std::int64_t k = 0; k < header.dim[3]; ++k) {
    reader.read(bytes.data(), bytes.size(), "voxels");
    format.convert(bytes, header.swapped, slope, intercept, values);
    const auto missing =
        std::count_if(values.begin(), values.end(), [](float value) { return !std::isfinite(value); });
    if (missing == static_cast<std::ptrdiff_t>(voxels)) continue;  // a gap
    if (missing > 0)
      throw input_error(fmt::format("{}: {} voxels of slice {} are no numbers", name, missing, k));
    stack.slice_position.emplace_back((affine * Eigen::Vector4d(0, 0, static_cast<double>(k), 1)).head<3>());
    stack.slice_intensity.push_back(values);
  }
  reader.finish();
  if (stack.slices() == 0) throw input_error(name + ": no voxel holds a number");
  if (affine.block<3, 1>(0, 2).dot(stack.normal) < 0) {
    std::reverse(stack.slice_position.begin(), stack.slice_position.end());
    std::reverse(stack.slice_intensity.begin(), stack.slice_intensity.end());
  }
  return stack;
}

Stack read_nifti(const std::filesystem::path& file) {
  std::vector<std::string> unused;
  return read_nifti(file, unused);
}

}  // namespace emmetrope::segmentation
