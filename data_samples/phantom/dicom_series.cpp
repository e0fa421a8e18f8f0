#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmjpeg/djencode.h>
#include <dcmtk/dcmjpls/djencode.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "data_samples/phantom/slice_sampler.hpp"
#include "data_samples/phantom/study.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/version.hpp"

namespace emmetrope::phantom {
namespace {

constexpr int bits_stored = 12;
constexpr const char* study_date = "20260101";  // fixed, so that a study made again has the same bytes

void require(const OFCondition& condition, const std::string& doing) {
  if (condition.bad())
    throw output_error(fmt::format("{}: {}", doing, condition.text()),
                       "check the disk's space and permissions");
}

/// A decimal string: at most 16 characters.
std::string ds(double value) {
  if (std::abs(value) < 1e-10) return "0";
  for (int digits = 15; digits > 5; --digits) {
    std::string text = fmt::format("{:.{}g}", value, digits);
    if (text.size() <= 16) return text;
  }
  return fmt::format("{:.6g}", value);
}

std::string ds(const Eigen::Vector3d& v) { return ds(v.x()) + "\\" + ds(v.y()) + "\\" + ds(v.z()); }

void put(DcmDataset& data, const DcmTagKey& tag, const std::string& value) {
  require(data.putAndInsertString(tag, value.c_str()), "making a DICOM tag");
}

void put_us(DcmDataset& data, const DcmTagKey& tag, int value) {
  require(data.putAndInsertUint16(tag, static_cast<Uint16>(value)), "making a DICOM tag");
}

void put_patient_and_study(DcmDataset& data, const StudyIdentity& identity) {
  put(data, DCM_PatientName, "PHANTOM^SYNTHETIC");
  put(data, DCM_PatientID, "PHANTOM-" + sha256_of(identity.parameters).substr(0, 8));
  put(data, DCM_PatientBirthDate, "");
  put(data, DCM_PatientSex, "O");
  put(data, DCM_PatientAge, fmt::format("{:03d}Y", static_cast<int>(std::lround(identity.age_years))));
  put(data, DCM_PatientComments, "Computed phantom, no person");
  put(data, DCM_StudyInstanceUID, identity.uid("study"));
  put(data, DCM_StudyDate, study_date);
  put(data, DCM_StudyTime, "120000");
  put(data, DCM_ReferringPhysicianName, "");
  put(data, DCM_StudyID, "1");
  put(data, DCM_AccessionNumber, "");
  put(data, DCM_StudyDescription, "Synthetic orbit MRI");
}

void put_series(DcmDataset& data, const StackPlan& plan, int number, const StudyIdentity& identity) {
  put(data, DCM_Modality, "MR");
  put(data, DCM_SeriesInstanceUID, identity.uid(fmt::format("series {}", number)));
  put(data, DCM_SeriesNumber, std::to_string(number));
  put(data, DCM_SeriesDescription, plan.name);
  put(data, DCM_SeriesDate, study_date);
  put(data, DCM_SeriesTime, fmt::format("12{:02d}00", std::min(59, number)));
  put(data, DCM_BodyPartExamined, "HEAD");
  put(data, DCM_PatientPosition, "HFS");
  put(data, DCM_FrameOfReferenceUID, identity.uid("frame of reference"));
  put(data, DCM_PositionReferenceIndicator, "");
  put(data, DCM_Manufacturer, "Emmetrope");
  put(data, DCM_ManufacturerModelName, "phantom");
  put(data, DCM_SoftwareVersions, version());
}

void put_acquisition(DcmDataset& data, const StackPlan& plan) {
  const bool gradient_echo = plan.profile == SliceProfile::encoded && plan.contrast == Contrast::T1;
  put(data, DCM_ScanningSequence, gradient_echo ? "GR\\IR" : "SE");
  put(data, DCM_SequenceVariant, gradient_echo ? "SP\\MP" : "SK");
  put(data, DCM_ScanOptions, plan.fat_left < 1 ? "FS" : "");
  put(data, DCM_MRAcquisitionType, plan.profile == SliceProfile::encoded ? "3D" : "2D");
  put(data, DCM_SliceThickness, ds(plan.slice_thickness_mm));
  put(data, DCM_SpacingBetweenSlices, ds(plan.slice_spacing_mm));
  put(data, DCM_RepetitionTime, ds(plan.repetition_time_ms));
  put(data, DCM_EchoTime, ds(plan.echo_time_ms));
  if (gradient_echo) put(data, DCM_InversionTime, "900");
  put(data, DCM_EchoTrainLength, gradient_echo ? "1" : "15");
  put(data, DCM_FlipAngle, ds(plan.flip_angle_deg));
  put(data, DCM_MagneticFieldStrength, "3");
  put(data, DCM_ImagingFrequency, "123.25");
  put(data, DCM_ImagedNucleus, "1H");
  put(data, DCM_NumberOfAverages, "1");
  put(data, DCM_InPlanePhaseEncodingDirection, "COL");  // readout along the rows
  put(data, DCM_PercentSampling, ds(100 * plan.acquired_phase));
  put(data, DCM_ReceiveCoilName,
      plan.coil == Coil::surface ? "LOOP70"
      : plan.coil == Coil::head  ? "HEAD"
                                 : "BODY");
}

void put_image(DcmDataset& data, const RenderedStack& stack, int slice, int series_number,
               const StudyIdentity& identity) {
  const StackPlan& plan = stack.plan;
  put(data, DCM_SOPClassUID, UID_MRImageStorage);
  put(data, DCM_SOPInstanceUID, identity.uid(fmt::format("series {} instance {}", series_number, slice + 1)));
  put(data, DCM_SpecificCharacterSet, "ISO_IR 100");
  put(data, DCM_ImageType, "ORIGINAL\\PRIMARY\\OTHER");
  put(data, DCM_InstanceNumber, std::to_string(slice + 1));
  put(data, DCM_AcquisitionNumber, "1");
  put(data, DCM_ContentDate, study_date);
  put(data, DCM_ContentTime, fmt::format("12{:02d}30", std::min(59, series_number)));
  put(data, DCM_ImagePositionPatient, ds(plan.slice_position(slice)));
  put(data, DCM_ImageOrientationPatient, ds(plan.along_row) + "\\" + ds(plan.along_column));
  put(data, DCM_SliceLocation, ds(plan.normal().dot(plan.slice_position(slice))));
  put(data, DCM_PixelSpacing, ds(plan.pixel_mm) + "\\" + ds(plan.pixel_mm));
  put_us(data, DCM_SamplesPerPixel, 1);
  put(data, DCM_PhotometricInterpretation, "MONOCHROME2");
  put_us(data, DCM_Rows, plan.rows);
  put_us(data, DCM_Columns, plan.columns);
  put_us(data, DCM_BitsAllocated, 16);
  put_us(data, DCM_BitsStored, bits_stored);
  put_us(data, DCM_HighBit, bits_stored - 1);
  put_us(data, DCM_PixelRepresentation, 0);
  put(data, DCM_WindowCenter, ds(0.6 * reference_intensity));
  put(data, DCM_WindowWidth, ds(1.2 * reference_intensity));

  std::vector<Uint16> pixels(stack.slices[slice].size());
  std::transform(stack.slices[slice].begin(), stack.slices[slice].end(), pixels.begin(), [](float value) {
    return static_cast<Uint16>(std::clamp(std::lround(value), 0L, (1L << bits_stored) - 1));
  });
  require(
      data.putAndInsertUint16Array(DCM_PixelData, pixels.data(), static_cast<unsigned long>(pixels.size())),
      "making DICOM pixel data");
}

E_TransferSyntax compress(DcmDataset& data, Compression compression) {
  if (compression == Compression::none) return EXS_LittleEndianExplicit;
  const E_TransferSyntax syntax =
      compression == Compression::jpeg_ls ? EXS_JPEGLSLossless : EXS_JPEGProcess14SV1;
  require(data.chooseRepresentation(syntax, nullptr), "compressing DICOM pixel data");
  return syntax;
}

/// DCMTK keeps its encoders in a global table.
class Encoders {
 public:
  Encoders() {
    DJEncoderRegistration::registerCodecs(ECC_lossyYCbCr, EUC_never);
    DJLSEncoderRegistration::registerCodecs(0, 0, 0, 0, OFFalse, 0, OFTrue, EJLSUC_never);
  }
  ~Encoders() {
    DJEncoderRegistration::cleanup();
    DJLSEncoderRegistration::cleanup();
  }
  Encoders(const Encoders&) = delete;
  Encoders& operator=(const Encoders&) = delete;
};

}  // namespace

std::string StudyIdentity::uid(const std::string& of_what) const {
  // 2.25 and an integer of 128 bits, from its 32 hexadecimal digits by long division.
  std::string digits = sha256_of(parameters + "|" + of_what).substr(0, 32);
  std::vector<int> number;
  for (const char digit : digits) number.push_back(digit <= '9' ? digit - '0' : digit - 'a' + 10);
  std::string decimal;
  while (std::any_of(number.begin(), number.end(), [](int d) { return d != 0; })) {
    int remainder = 0;
    for (int& digit : number) {
      const int value = 16 * remainder + digit;
      digit = value / 10;
      remainder = value % 10;
    }
    decimal.insert(decimal.begin(), static_cast<char>('0' + remainder));
  }
  return "2.25." + decimal;
}

void write_series(const std::filesystem::path& folder, const RenderedStack& stack, int series_number,
                  const StudyIdentity& identity, Compression compression) {
  const Encoders encoders;
  std::error_code fault;
  std::filesystem::create_directories(folder, fault);
  if (fault) throw output_error(fmt::format("{}: {}", folder.string(), fault.message()));
  for (int slice = 0; slice < stack.plan.slices; ++slice) {
    DcmFileFormat file;
    DcmDataset& data = *file.getDataset();
    put_patient_and_study(data, identity);
    put_series(data, stack.plan, series_number, identity);
    put_acquisition(data, stack.plan);
    put_image(data, stack, slice, series_number, identity);
    const E_TransferSyntax syntax = compress(data, compression);
    const std::filesystem::path path = folder / fmt::format("{:04d}.dcm", slice + 1);
    require(file.saveFile(path.c_str(), syntax), fmt::format("writing {}", path.string()));
  }
}

}  // namespace emmetrope::phantom
