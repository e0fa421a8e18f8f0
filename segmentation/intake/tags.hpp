#pragma once
#include <cstdint>
#include <string>

/// The DICOM attributes that intake looks at (PS3.6), by their keywords.
namespace emmetrope::segmentation {

struct Tag {
  std::uint16_t group, element;
  const char* keyword;
};

/// "(0028,0030) PixelSpacing"
std::string to_string(const Tag& tag);

namespace tag {
inline constexpr Tag media_storage_sop_class{0x0002, 0x0002, "MediaStorageSOPClassUID"};
inline constexpr Tag transfer_syntax{0x0002, 0x0010, "TransferSyntaxUID"};
inline constexpr Tag character_set{0x0008, 0x0005, "SpecificCharacterSet"};
inline constexpr Tag image_type{0x0008, 0x0008, "ImageType"};
inline constexpr Tag sop_class{0x0008, 0x0016, "SOPClassUID"};
inline constexpr Tag sop_instance{0x0008, 0x0018, "SOPInstanceUID"};
inline constexpr Tag study_date{0x0008, 0x0020, "StudyDate"};
inline constexpr Tag series_date{0x0008, 0x0021, "SeriesDate"};
inline constexpr Tag acquisition_date{0x0008, 0x0022, "AcquisitionDate"};
inline constexpr Tag study_time{0x0008, 0x0030, "StudyTime"};
inline constexpr Tag referring_physician{0x0008, 0x0090, "ReferringPhysicianName"};
inline constexpr Tag consulting_physician{0x0008, 0x009c, "ConsultingPhysicianName"};
inline constexpr Tag study_description{0x0008, 0x1030, "StudyDescription"};
inline constexpr Tag accession_number{0x0008, 0x0050, "AccessionNumber"};
inline constexpr Tag modality{0x0008, 0x0060, "Modality"};
inline constexpr Tag institution_name{0x0008, 0x0080, "InstitutionName"};
inline constexpr Tag station_name{0x0008, 0x1010, "StationName"};
inline constexpr Tag performing_physician{0x0008, 0x1050, "PerformingPhysicianName"};
inline constexpr Tag reading_physician{0x0008, 0x1060, "NameOfPhysiciansReadingStudy"};
inline constexpr Tag operators_name{0x0008, 0x1070, "OperatorsName"};
inline constexpr Tag series_description{0x0008, 0x103e, "SeriesDescription"};
inline constexpr Tag complex_image_component{0x0008, 0x9208, "ComplexImageComponent"};
inline constexpr Tag frame_type{0x0008, 0x9007, "FrameType"};
inline constexpr Tag volume_calculation{0x0008, 0x9207, "VolumeBasedCalculationTechnique"};
inline constexpr Tag patient_name{0x0010, 0x0010, "PatientName"};
inline constexpr Tag patient_id{0x0010, 0x0020, "PatientID"};
inline constexpr Tag issuer_of_patient_id{0x0010, 0x0021, "IssuerOfPatientID"};
inline constexpr Tag patient_birth_time{0x0010, 0x0032, "PatientBirthTime"};
inline constexpr Tag patient_birth_date{0x0010, 0x0030, "PatientBirthDate"};
inline constexpr Tag patient_sex{0x0010, 0x0040, "PatientSex"};
inline constexpr Tag other_patient_ids{0x0010, 0x1000, "OtherPatientIDs"};
inline constexpr Tag other_patient_names{0x0010, 0x1001, "OtherPatientNames"};
inline constexpr Tag patient_birth_name{0x0010, 0x1005, "PatientBirthName"};
inline constexpr Tag patient_age{0x0010, 0x1010, "PatientAge"};
inline constexpr Tag patient_size{0x0010, 0x1020, "PatientSize"};
inline constexpr Tag patient_weight{0x0010, 0x1030, "PatientWeight"};
inline constexpr Tag patient_address{0x0010, 0x1040, "PatientAddress"};
inline constexpr Tag mothers_birth_name{0x0010, 0x1060, "PatientMotherBirthName"};
inline constexpr Tag medical_record_locator{0x0010, 0x1090, "MedicalRecordLocator"};
inline constexpr Tag patient_telephone{0x0010, 0x2154, "PatientTelephoneNumbers"};
inline constexpr Tag patient_species{0x0010, 0x2201, "PatientSpeciesDescription"};
inline constexpr Tag ethnic_group{0x0010, 0x2160, "EthnicGroup"};
inline constexpr Tag responsible_person{0x0010, 0x2297, "ResponsiblePerson"};
inline constexpr Tag patient_comments{0x0010, 0x4000, "PatientComments"};
inline constexpr Tag trial_subject_id{0x0012, 0x0040, "ClinicalTrialSubjectID"};
inline constexpr Tag trial_reading_id{0x0012, 0x0042, "ClinicalTrialSubjectReadingID"};
inline constexpr Tag identity_removed{0x0012, 0x0062, "PatientIdentityRemoved"};
inline constexpr Tag deidentification_method{0x0012, 0x0063, "DeidentificationMethod"};
inline constexpr Tag body_part{0x0018, 0x0015, "BodyPartExamined"};
inline constexpr Tag scanning_sequence{0x0018, 0x0020, "ScanningSequence"};
inline constexpr Tag acquisition_type{0x0018, 0x0023, "MRAcquisitionType"};
inline constexpr Tag sequence_name{0x0018, 0x0024, "SequenceName"};
inline constexpr Tag slice_thickness{0x0018, 0x0050, "SliceThickness"};
inline constexpr Tag repetition_time{0x0018, 0x0080, "RepetitionTime"};
inline constexpr Tag echo_time{0x0018, 0x0081, "EchoTime"};
inline constexpr Tag inversion_time{0x0018, 0x0082, "InversionTime"};
inline constexpr Tag echo_numbers{0x0018, 0x0086, "EchoNumbers"};
inline constexpr Tag field_strength{0x0018, 0x0087, "MagneticFieldStrength"};
inline constexpr Tag spacing_between_slices{0x0018, 0x0088, "SpacingBetweenSlices"};
inline constexpr Tag pixel_bandwidth{0x0018, 0x0095, "PixelBandwidth"};
inline constexpr Tag device_serial_number{0x0018, 0x1000, "DeviceSerialNumber"};
inline constexpr Tag trigger_time{0x0018, 0x1060, "TriggerTime"};
inline constexpr Tag reconstruction_diameter{0x0018, 0x1100, "ReconstructionDiameter"};
inline constexpr Tag phase_encoding{0x0018, 0x1312, "InPlanePhaseEncodingDirection"};
inline constexpr Tag flip_angle{0x0018, 0x1314, "FlipAngle"};
inline constexpr Tag inversion_times{0x0018, 0x9079, "InversionTimes"};
inline constexpr Tag effective_echo_time{0x0018, 0x9082, "EffectiveEchoTime"};
inline constexpr Tag echo_planar{0x0018, 0x9018, "EchoPlanarPulseSequence"};
inline constexpr Tag diffusion_b_value{0x0018, 0x9087, "DiffusionBValue"};
inline constexpr Tag private_creator_0019{0x0019, 0x0010, "PrivateCreator 0019"};
inline constexpr Tag mosaic_images{0x0019, 0x100a, "NumberOfImagesInMosaic"};
inline constexpr Tag study_instance{0x0020, 0x000d, "StudyInstanceUID"};
inline constexpr Tag series_instance{0x0020, 0x000e, "SeriesInstanceUID"};
inline constexpr Tag study_id{0x0020, 0x0010, "StudyID"};
inline constexpr Tag series_number{0x0020, 0x0011, "SeriesNumber"};
inline constexpr Tag acquisition_number{0x0020, 0x0012, "AcquisitionNumber"};
inline constexpr Tag instance_number{0x0020, 0x0013, "InstanceNumber"};
inline constexpr Tag patient_orientation{0x0020, 0x0020, "PatientOrientation"};
inline constexpr Tag image_position{0x0020, 0x0032, "ImagePositionPatient"};
inline constexpr Tag image_orientation{0x0020, 0x0037, "ImageOrientationPatient"};
inline constexpr Tag frame_of_reference{0x0020, 0x0052, "FrameOfReferenceUID"};
inline constexpr Tag series_laterality{0x0020, 0x0060, "Laterality"};
inline constexpr Tag image_laterality{0x0020, 0x0062, "ImageLaterality"};
inline constexpr Tag temporal_position_identifier{0x0020, 0x0100, "TemporalPositionIdentifier"};
inline constexpr Tag frame_laterality{0x0020, 0x9072, "FrameLaterality"};
inline constexpr Tag temporal_position_index{0x0020, 0x9128, "TemporalPositionIndex"};
inline constexpr Tag stack_id{0x0020, 0x9056, "StackID"};
inline constexpr Tag concatenation{0x0020, 0x9161, "ConcatenationUID"};
inline constexpr Tag in_concatenation{0x0020, 0x9162, "InConcatenationNumber"};
inline constexpr Tag in_concatenation_total{0x0020, 0x9163, "InConcatenationTotalNumber"};
inline constexpr Tag slice_location{0x0020, 0x1041, "SliceLocation"};
inline constexpr Tag samples_per_pixel{0x0028, 0x0002, "SamplesPerPixel"};
inline constexpr Tag photometric_interpretation{0x0028, 0x0004, "PhotometricInterpretation"};
inline constexpr Tag number_of_frames{0x0028, 0x0008, "NumberOfFrames"};
inline constexpr Tag rows{0x0028, 0x0010, "Rows"};
inline constexpr Tag columns{0x0028, 0x0011, "Columns"};
inline constexpr Tag pixel_spacing{0x0028, 0x0030, "PixelSpacing"};
inline constexpr Tag bits_allocated{0x0028, 0x0100, "BitsAllocated"};
inline constexpr Tag bits_stored{0x0028, 0x0101, "BitsStored"};
inline constexpr Tag high_bit{0x0028, 0x0102, "HighBit"};
inline constexpr Tag pixel_representation{0x0028, 0x0103, "PixelRepresentation"};
inline constexpr Tag burned_in_annotation{0x0028, 0x0301, "BurnedInAnnotation"};
inline constexpr Tag rescale_intercept{0x0028, 0x1052, "RescaleIntercept"};
inline constexpr Tag rescale_slope{0x0028, 0x1053, "RescaleSlope"};
inline constexpr Tag modality_lut{0x0028, 0x3000, "ModalityLUTSequence"};
inline constexpr Tag requesting_physician{0x0032, 0x1032, "RequestingPhysician"};
inline constexpr Tag admission_id{0x0038, 0x0010, "AdmissionID"};
inline constexpr Tag performed_step_id{0x0040, 0x0253, "PerformedProcedureStepID"};
inline constexpr Tag requested_procedure_id{0x0040, 0x1001, "RequestedProcedureID"};
inline constexpr Tag placer_order_number{0x0040, 0x2016, "PlacerOrderNumberImagingServiceRequest"};
inline constexpr Tag filler_order_number{0x0040, 0x2017, "FillerOrderNumberImagingServiceRequest"};
inline constexpr Tag private_creator_2005{0x2005, 0x0010, "PrivateCreator 2005"};
inline constexpr Tag lossy_compression{0x0028, 0x2110, "LossyImageCompression"};
inline constexpr Tag philips_scale_intercept{0x2005, 0x100d, "Philips ScaleIntercept"};
inline constexpr Tag philips_scale_slope{0x2005, 0x100e, "Philips ScaleSlope"};
inline constexpr Tag pixel_data{0x7fe0, 0x0010, "PixelData"};

// Functional group macros of enhanced multi-frame images (PS3.3 C.7.6.16.2, C.8.13.5).
inline constexpr Tag frame_content_sequence{0x0020, 0x9111, "FrameContentSequence"};
inline constexpr Tag plane_position_sequence{0x0020, 0x9113, "PlanePositionSequence"};
inline constexpr Tag plane_orientation_sequence{0x0020, 0x9116, "PlaneOrientationSequence"};
inline constexpr Tag frame_anatomy_sequence{0x0020, 0x9071, "FrameAnatomySequence"};
inline constexpr Tag pixel_measures_sequence{0x0028, 0x9110, "PixelMeasuresSequence"};
inline constexpr Tag pixel_value_sequence{0x0028, 0x9145, "PixelValueTransformationSequence"};
inline constexpr Tag mr_image_frame_type_sequence{0x0018, 0x9226, "MRImageFrameTypeSequence"};
inline constexpr Tag mr_echo_sequence{0x0018, 0x9114, "MREchoSequence"};
inline constexpr Tag mr_timing_sequence{0x0018, 0x9112, "MRTimingAndRelatedParametersSequence"};
inline constexpr Tag mr_modifier_sequence{0x0018, 0x9115, "MRModifierSequence"};
inline constexpr Tag mr_imaging_modifier_sequence{0x0018, 0x9006, "MRImagingModifierSequence"};
inline constexpr Tag mr_fov_geometry_sequence{0x0018, 0x9125, "MRFOVGeometrySequence"};
inline constexpr Tag unassigned_shared_sequence{0x0020, 0x9170,
                                                "UnassignedSharedConvertedAttributesSequence"};
inline constexpr Tag unassigned_per_frame_sequence{0x0020, 0x9171,
                                                   "UnassignedPerFrameConvertedAttributesSequence"};
inline constexpr Tag mr_diffusion_sequence{0x0018, 0x9117, "MRDiffusionSequence"};

/// Attributes read from the top of a data set.
inline constexpr Tag of_data_set[] = {image_type,
                                      sop_class,
                                      sop_instance,
                                      study_date,
                                      series_date,
                                      acquisition_date,
                                      accession_number,
                                      modality,
                                      patient_name,
                                      patient_id,
                                      other_patient_ids,
                                      other_patient_names,
                                      patient_birth_name,
                                      patient_birth_date,
                                      patient_sex,
                                      patient_age,
                                      patient_species,
                                      body_part,
                                      scanning_sequence,
                                      sequence_name,
                                      echo_planar,
                                      acquisition_type,
                                      slice_thickness,
                                      repetition_time,
                                      echo_time,
                                      inversion_time,
                                      echo_numbers,
                                      field_strength,
                                      spacing_between_slices,
                                      pixel_bandwidth,
                                      trigger_time,
                                      reconstruction_diameter,
                                      phase_encoding,
                                      flip_angle,
                                      diffusion_b_value,
                                      mosaic_images,
                                      study_instance,
                                      series_instance,
                                      series_number,
                                      acquisition_number,
                                      instance_number,
                                      patient_orientation,
                                      image_position,
                                      image_orientation,
                                      frame_of_reference,
                                      series_laterality,
                                      image_laterality,
                                      temporal_position_identifier,
                                      concatenation,
                                      in_concatenation,
                                      in_concatenation_total,
                                      slice_location,
                                      samples_per_pixel,
                                      photometric_interpretation,
                                      number_of_frames,
                                      rows,
                                      columns,
                                      pixel_spacing,
                                      bits_allocated,
                                      bits_stored,
                                      high_bit,
                                      pixel_representation,
                                      burned_in_annotation,
                                      rescale_intercept,
                                      rescale_slope,
                                      philips_scale_intercept,
                                      philips_scale_slope,
                                      complex_image_component,
                                      volume_calculation,
                                      private_creator_0019,
                                      private_creator_2005,
                                      lossy_compression};

/// Who and what else a free text may name (identity.hpp).
inline constexpr Tag of_identity[] = {
    institution_name,       station_name,           referring_physician,  performing_physician,
    reading_physician,      requesting_physician,   operators_name,       mothers_birth_name,
    patient_address,        patient_telephone,      issuer_of_patient_id, study_id,
    admission_id,           device_serial_number,   responsible_person,   consulting_physician,
    medical_record_locator, trial_subject_id,       trial_reading_id,     placer_order_number,
    filler_order_number,    requested_procedure_id, performed_step_id};

/// Read besides where a header alone is asked for: what objects of the same study must repeat.
inline constexpr Tag of_study[] = {study_time,       study_description, patient_birth_time,
                                   patient_size,     patient_weight,    ethnic_group,
                                   patient_comments, identity_removed,  deidentification_method};

/// Attributes of classic images that a legacy converted one may keep in its unassigned groups (PS3.3 C.7.6.16.2).
inline constexpr Tag of_classic_images[] = {image_type,         complex_image_component,
                                            volume_calculation, scanning_sequence,
                                            sequence_name,      acquisition_type,
                                            repetition_time,    echo_time,
                                            inversion_time,     echo_numbers,
                                            field_strength,     pixel_bandwidth,
                                            trigger_time,       reconstruction_diameter,
                                            phase_encoding,     flip_angle,
                                            acquisition_number, series_laterality,
                                            image_laterality,   temporal_position_identifier,
                                            slice_location};

struct FrameTag {
  Tag macro, attribute;
};
/// Attributes read from the shared and per-frame functional groups.
inline constexpr FrameTag of_frames[] = {{plane_position_sequence, image_position},
                                         {plane_orientation_sequence, image_orientation},
                                         {pixel_measures_sequence, pixel_spacing},
                                         {pixel_measures_sequence, slice_thickness},
                                         {pixel_measures_sequence, spacing_between_slices},
                                         {pixel_value_sequence, rescale_intercept},
                                         {pixel_value_sequence, rescale_slope},
                                         {frame_anatomy_sequence, frame_laterality},
                                         {mr_image_frame_type_sequence, frame_type},
                                         {mr_image_frame_type_sequence, complex_image_component},
                                         {mr_image_frame_type_sequence, volume_calculation},
                                         {mr_echo_sequence, effective_echo_time},
                                         {mr_timing_sequence, repetition_time},
                                         {mr_timing_sequence, flip_angle},
                                         {mr_modifier_sequence, inversion_times},
                                         {mr_imaging_modifier_sequence, pixel_bandwidth},
                                         {mr_fov_geometry_sequence, phase_encoding},
                                         {mr_diffusion_sequence, diffusion_b_value},
                                         {frame_content_sequence, temporal_position_index},
                                         {frame_content_sequence, stack_id}};
}  // namespace tag

/// SOP classes and transfer syntaxes with a meaning here (PS3.4, PS3.5).
namespace uid {
inline constexpr const char* mr_image = "1.2.840.10008.5.1.4.1.1.4";
inline constexpr const char* enhanced_mr_image = "1.2.840.10008.5.1.4.1.1.4.1";
inline constexpr const char* legacy_converted_enhanced_mr_image = "1.2.840.10008.5.1.4.1.1.4.4";
inline constexpr const char* image_storage = "1.2.840.10008.5.1.4.1.1.";  ///< begins all of the standard's
inline constexpr const char* directory = "1.2.840.10008.1.3.10";
inline constexpr const char* jpeg_2000_lossless = "1.2.840.10008.1.2.4.90";
inline constexpr const char* jpeg_2000 = "1.2.840.10008.1.2.4.91";
}  // namespace uid

}  // namespace emmetrope::segmentation
