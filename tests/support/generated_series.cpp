#include "tests/support/generated_series.hpp"

#include <dcmtk/dcmdata/dcpixel.h>
#include <dcmtk/dcmdata/dcpixseq.h>
#include <dcmtk/dcmdata/dcpxitem.h>
#include <dcmtk/dcmdata/dcrleerg.h>
#include <dcmtk/dcmjpeg/djencode.h>
#include <dcmtk/dcmjpls/djencode.h>
#include <dcmtk/oflog/oflog.h>
#include <fmt/format.h>
#include <openjpeg.h>

#include <stdexcept>

namespace emmetrope::test {
namespace {

void require(const OFCondition& condition) {
  if (condition.bad()) throw std::runtime_error(condition.text());
}

void put(DcmItem& item, const DcmTagKey& tag, const std::string& value) {
  require(item.putAndInsertString(tag, value.c_str()));
}

std::string text_of(const Eigen::Vector3d& vector) {
  return fmt::format("{:.9g}\\{:.9g}\\{:.9g}", vector.x(), vector.y(), vector.z());
}

std::string orientation_text() {
  return text_of(GeneratedSeries::along_row()) + "\\" + text_of(GeneratedSeries::along_column());
}

void put_common(DcmDataset& data_set, const std::string& series_uid, int number) {
  put(data_set, DCM_Modality, "MR");
  put(data_set, DCM_PatientName, "SECRET^NAME");
  put(data_set, DCM_PatientID, "SECRET-ID-77");
  put(data_set, DCM_PatientBirthDate, "19860101");
  put(data_set, DCM_PatientAge, "038Y");
  put(data_set, DCM_PatientSex, "F");
  put(data_set, DCM_StudyInstanceUID, "1.2.826.0.1.3680043.9.7");
  put(data_set, DCM_SeriesInstanceUID, series_uid);
  put(data_set, DCM_SeriesNumber, std::to_string(number));
  put(data_set, DCM_SeriesDescription, "orbit T2");
  put(data_set, DCM_FrameOfReferenceUID, "1.2.826.0.1.3680043.9.7.9");
  put(data_set, DCM_Rows, std::to_string(GeneratedSeries::rows));
  put(data_set, DCM_Columns, std::to_string(GeneratedSeries::columns));
  put(data_set, DCM_SamplesPerPixel, "1");
  put(data_set, DCM_PhotometricInterpretation, "MONOCHROME2");
  put(data_set, DCM_BitsAllocated, "16");
  put(data_set, DCM_BitsStored, "12");
  put(data_set, DCM_HighBit, "11");
  put(data_set, DCM_PixelRepresentation, "0");
}

}  // namespace

std::string file_name(int slice) { return fmt::format("scan/im{:02d}", slice * 7 % 31); }

Eigen::Vector3d GeneratedSeries::position(double slice) {
  return Eigen::Vector3d(-40, -70, 30) + normal() * slice_spacing_mm * slice;
}

Uint16 GeneratedSeries::value(int column, int row, int slice) {
  return static_cast<Uint16>(100 + 31 * column + 17 * row + 150 * slice + (column * row) % 5);
}

std::vector<Uint16> GeneratedSeries::pixels(int slice) {
  std::vector<Uint16> words;
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < columns; ++column) words.push_back(value(column, row, slice));
  return words;
}

GeneratedSeries::GeneratedSeries(const std::string& series_uid, int number) {
  for (int slice = 0; slice < slices; ++slice) {
    files_.push_back(std::make_unique<DcmFileFormat>());
    auto& data_set = *files_.back()->getDataset();
    put_common(data_set, series_uid, number);
    put(data_set, DCM_SOPClassUID, UID_MRImageStorage);
    put(data_set, DCM_SOPInstanceUID, fmt::format("{}.{}", series_uid, slice + 1));
    put(data_set, DCM_ImageType, "ORIGINAL\\PRIMARY\\M\\ND");
    put(data_set, DCM_InstanceNumber, std::to_string((slice * 5) % slices));
    put(data_set, DCM_MRAcquisitionType, "2D");
    put(data_set, DCM_SliceThickness, "2");
    put(data_set, DCM_SpacingBetweenSlices, "2");
    put(data_set, DCM_RepetitionTime, "3000");
    put(data_set, DCM_EchoTime, "91");
    put(data_set, DCM_EchoNumbers, "1");
    put(data_set, DCM_AcquisitionNumber, "1");
    put(data_set, DCM_PixelSpacing, "0.5\\0.4");
    put(data_set, DCM_ImageOrientationPatient, orientation_text());
    put(data_set, DCM_ImagePositionPatient, text_of(position(slice)));
    set_pixels(slice, pixels(slice));
  }
}

void GeneratedSeries::set(int slice, const DcmTagKey& tag, const std::string& value) {
  put((*this)[slice], tag, value);
}

void GeneratedSeries::set_all(const DcmTagKey& tag, const std::string& value) {
  for (int slice = 0; slice < size(); ++slice) set(slice, tag, value);
}

void GeneratedSeries::erase_all(const DcmTagKey& tag) {
  for (int slice = 0; slice < size(); ++slice) require((*this)[slice].findAndDeleteElement(tag));
}

int GeneratedSeries::duplicate(int slice) {
  OFString uid;
  (*this)[slice].findAndGetOFString(DCM_SOPInstanceUID, uid);
  files_.push_back(std::make_unique<DcmFileFormat>(file(slice)));
  set(size() - 1, DCM_SOPInstanceUID, std::string(uid.c_str()) + ".1");
  return size() - 1;
}

void GeneratedSeries::set_position(int slice, const Eigen::Vector3d& position) {
  set(slice, DCM_ImagePositionPatient, text_of(position));
}

void GeneratedSeries::set_pixels(int slice, const std::vector<Uint16>& words) {
  require((*this)[slice].putAndInsertUint16Array(DCM_PixelData, words.data(), words.size()));
}

std::vector<std::filesystem::path> GeneratedSeries::write(const std::filesystem::path& folder,
                                                          E_TransferSyntax syntax) {
  std::vector<std::filesystem::path> written;
  for (int slice = 0; slice < size(); ++slice) {
    written.push_back(folder / file_name(slice));
    std::filesystem::create_directories(written.back().parent_path());
    if (!is_jpeg2000(syntax)) require((*this)[slice].chooseRepresentation(syntax, nullptr));
    require(file(slice).saveFile(written.back().c_str(), syntax));
  }
  return written;
}

std::unique_ptr<DcmFileFormat> enhanced_series(bool shared) {
  auto file = std::make_unique<DcmFileFormat>();
  auto& data_set = *file->getDataset();
  put_common(data_set, "1.2.826.0.1.3680043.9.7.2", 2);
  put(data_set, DCM_SOPClassUID, UID_EnhancedMRImageStorage);
  put(data_set, DCM_SOPInstanceUID, "1.2.826.0.1.3680043.9.7.2.1");
  put(data_set, DCM_ImageType, "ORIGINAL\\PRIMARY\\VOLUME\\NONE");
  put(data_set, DCM_NumberOfFrames, std::to_string(GeneratedSeries::slices));
  const auto macro = [](DcmItem& groups, const DcmTagKey& sequence) -> DcmItem& {
    DcmItem* item = nullptr;
    require(groups.findOrCreateSequenceItem(sequence, item, 0));
    return *item;
  };
  const auto put_plane = [&](DcmItem& groups) {
    put(macro(groups, DCM_PixelMeasuresSequence), DCM_PixelSpacing, "0.5\\0.4");
    put(macro(groups, DCM_PixelMeasuresSequence), DCM_SliceThickness, "2");
    put(macro(groups, DCM_PlaneOrientationSequence), DCM_ImageOrientationPatient, orientation_text());
  };
  if (shared) put_plane(macro(data_set, DCM_SharedFunctionalGroupsSequence));
  std::vector<Uint16> words;
  for (int frame = 0; frame < GeneratedSeries::slices; ++frame) {
    const int slice = (frame * 5) % GeneratedSeries::slices;  // frames are stored in any order
    DcmItem* groups = nullptr;
    require(data_set.findOrCreateSequenceItem(DCM_PerFrameFunctionalGroupsSequence, groups, frame));
    if (!shared) put_plane(*groups);
    put(macro(*groups, DCM_PlanePositionSequence), DCM_ImagePositionPatient,
        text_of(GeneratedSeries::position(slice)));
    DcmItem& transformation = macro(*groups, DCM_PixelValueTransformationSequence);
    put(transformation, DCM_RescaleSlope, std::to_string(slice + 1));
    put(transformation, DCM_RescaleIntercept, "-10");
    const auto its = GeneratedSeries::pixels(slice);
    words.insert(words.end(), its.begin(), its.end());
  }
  require(data_set.putAndInsertUint16Array(DCM_PixelData, words.data(), words.size()));
  return file;
}

DcmItem& functional_group(DcmFileFormat& file, int frame, const DcmTagKey& macro) {
  DcmItem *groups = nullptr, *group = nullptr;
  require(file.getDataset()->findOrCreateSequenceItem(DCM_PerFrameFunctionalGroupsSequence, groups, frame));
  require(groups->findOrCreateSequenceItem(macro, group, 0));
  return *group;
}

void register_encoders() {
  OFLog::configure(OFLogger::ERROR_LOG_LEVEL);
  DJEncoderRegistration::registerCodecs();
  DJLSEncoderRegistration::registerCodecs();
  DcmRLEEncoderRegistration::registerCodecs();
}

std::vector<Uint8> encode_jpeg2000(const std::vector<Uint16>& words, int rows, int columns, int bits) {
  opj_image_cmptparm_t component{};
  component.dx = component.dy = 1;
  component.w = static_cast<OPJ_UINT32>(columns);
  component.h = static_cast<OPJ_UINT32>(rows);
  component.prec = static_cast<OPJ_UINT32>(bits);
  const std::unique_ptr<opj_image_t, decltype(&opj_image_destroy)> image(
      opj_image_create(1, &component, OPJ_CLRSPC_GRAY), &opj_image_destroy);
  image->x1 = component.w;
  image->y1 = component.h;
  std::copy(words.begin(), words.end(), image->comps[0].data);
  opj_cparameters_t parameters;
  opj_set_default_encoder_parameters(&parameters);
  parameters.numresolution = 3;
  parameters.tcp_numlayers = 1;
  parameters.cp_disto_alloc = 1;
  const std::unique_ptr<opj_codec_t, decltype(&opj_destroy_codec)> codec(opj_create_compress(OPJ_CODEC_J2K),
                                                                         &opj_destroy_codec);
  const std::unique_ptr<opj_stream_t, decltype(&opj_stream_destroy)> stream(
      opj_stream_default_create(OPJ_FALSE), &opj_stream_destroy);
  struct Target {
    std::vector<Uint8> bytes;
    std::size_t position = 0;
  } target;
  opj_stream_set_user_data(stream.get(), &target, nullptr);
  opj_stream_set_write_function(stream.get(), [](void* data, OPJ_SIZE_T size, void* user) {
    auto& out = *static_cast<Target*>(user);
    out.bytes.resize(std::max(out.bytes.size(), out.position + size));
    std::copy_n(static_cast<Uint8*>(data), size,
                out.bytes.begin() + static_cast<std::ptrdiff_t>(out.position));
    out.position += size;
    return size;
  });
  opj_stream_set_skip_function(stream.get(), [](OPJ_OFF_T size, void* user) {
    static_cast<Target*>(user)->position += static_cast<std::size_t>(size);
    return size;
  });
  opj_stream_set_seek_function(stream.get(), [](OPJ_OFF_T position, void* user) -> OPJ_BOOL {
    static_cast<Target*>(user)->position = static_cast<std::size_t>(position);
    return OPJ_TRUE;
  });
  if (!opj_setup_encoder(codec.get(), &parameters, image.get()) ||
      !opj_start_compress(codec.get(), image.get(), stream.get()) || !opj_encode(codec.get(), stream.get()) ||
      !opj_end_compress(codec.get(), stream.get()))
    throw std::runtime_error("OpenJPEG cannot encode");
  return target.bytes;
}

bool is_jpeg2000(E_TransferSyntax syntax) {
  return syntax == EXS_JPEG2000LosslessOnly || syntax == EXS_JPEG2000;
}

void compress_jpeg2000(DcmFileFormat& file, const std::vector<Uint8>& stream, E_TransferSyntax syntax) {
  auto sequence = std::make_unique<DcmPixelSequence>(DCM_PixelSequenceTag);
  auto table = std::make_unique<DcmPixelItem>(DCM_PixelItemTag);
  require(sequence->insert(table.release()));
  DcmOffsetList offsets;
  require(sequence->storeCompressedFrame(offsets, const_cast<Uint8*>(stream.data()),
                                         static_cast<Uint32>(stream.size()), 0));
  auto pixels = std::make_unique<DcmPixelData>(DCM_PixelData);
  pixels->putOriginalRepresentation(syntax, nullptr, sequence.release());
  require(file.getDataset()->insert(pixels.release(), OFTrue));
}

}  // namespace emmetrope::test
