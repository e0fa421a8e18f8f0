#pragma once
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>

#include <Eigen/Geometry>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace emmetrope::test {

/// A small MR series in memory, valid until a test breaks it: 12 oblique coronal slices of 20 rows x 24
/// columns, 2 mm apart, rows 0.5 and columns 0.4 mm apart, 12 of 16 bits, unsigned, no rescale.
class GeneratedSeries {
 public:
  static constexpr int rows = 20, columns = 24, slices = 12;
  static constexpr double slice_spacing_mm = 2.0;

  explicit GeneratedSeries(const std::string& series_uid = "1.2.826.0.1.3680043.9.7.1", int number = 1);

  DcmDataset& operator[](int slice) { return *files_.at(static_cast<std::size_t>(slice))->getDataset(); }
  DcmFileFormat& file(int slice) { return *files_.at(static_cast<std::size_t>(slice)); }
  int size() const { return static_cast<int>(files_.size()); }

  void set(int slice, const DcmTagKey& tag, const std::string& value);
  void set_all(const DcmTagKey& tag, const std::string& value);
  void erase_all(const DcmTagKey& tag);
  void remove(int slice) { files_.erase(files_.begin() + slice); }
  /// Adds a copy of a slice with a SOPInstanceUID of its own.
  /// \return its index
  int duplicate(int slice);
  void set_position(int slice, const Eigen::Vector3d& position);
  void set_pixels(int slice, const std::vector<Uint16>& words);

  /// Writes all files with names that tell nothing: "scan/im07", ...
  /// \return the files in the order of the slices
  std::vector<std::filesystem::path> write(const std::filesystem::path& folder,
                                           E_TransferSyntax syntax = EXS_LittleEndianExplicit);

  static Eigen::Vector3d along_row() { return {0.96, 0.28, 0}; }
  static Eigen::Vector3d along_column() { return {0, 0, -1}; }
  static Eigen::Vector3d normal() { return along_row().cross(along_column()); }
  static Eigen::Vector3d position(double slice);
  /// The stored value of a voxel.
  static Uint16 value(int column, int row, int slice);
  static std::vector<Uint16> pixels(int slice);

 private:
  std::vector<std::unique_ptr<DcmFileFormat>> files_;
};

/// The name of a slice's file as GeneratedSeries::write makes it.
std::string file_name(int slice);

/// An enhanced multi-frame MR image of the same volume.
/// \param shared  put spacing and orientation into the shared groups, else into each frame's
std::unique_ptr<DcmFileFormat> enhanced_series(bool shared);

/// A functional group of a frame, made where it is not there.
DcmItem& functional_group(DcmFileFormat& file, int frame, const DcmTagKey& macro);

/// Registers DCMTK's encoders for the tests' files.
void register_encoders();

/// One frame as a JPEG 2000 lossless codestream.
std::vector<Uint8> encode_jpeg2000(const std::vector<Uint16>& words, int rows, int columns, int bits);

bool is_jpeg2000(E_TransferSyntax syntax);

/// Makes the codestream the slice's pixels.
/// \param syntax  one of the two of JPEG 2000
void compress_jpeg2000(DcmFileFormat& file, const std::vector<Uint8>& stream, E_TransferSyntax syntax);

}  // namespace emmetrope::test
