#pragma once
#include <vector>

#include "pipeline/base/case_folder.hpp"
#include "segmentation/intake/study.hpp"
#include "segmentation/stage.hpp"

/// What the stage is made from: which files, and which of the study's series.
namespace emmetrope::segmentation {

/// The files that reading the study reads, and the labels; numbered, as a file's name may be the patient's.
/// \throw Error (usage) where the case would be the study, or labels lie where the stage writes or reads
///   images; (input_invalid) where something does not exist
std::vector<StageInput> input_files(const SegmentOptions& options);

/// A study that is still being copied has files that were read and not noted.
/// \throw Error (input_invalid) where it has not as many files as when its inputs were noted
void require_same_files(const SegmentOptions& options, const std::vector<StageInput>& noted);

/// Why a usable series is not used unless it is asked for: it shows fat alone or opposed phases, or it was computed
/// from another series of the study, or is its water alone, and would count twice; empty: it is used.
std::string why_left_out(const SeriesInfo& info, const StudyInventory& inventory);

/// The series asked for, or all usable ones but those left out; at least one, of one study.
/// \throw Error with a series' reason where it is not usable; (input_invalid) for series of two studies, or for NIfTI
///   volumes among DICOM series where none is asked for
std::vector<const SeriesInfo*> choose_series(const StudyInventory& inventory,
                                             const std::vector<SeriesChoice>& wanted);

/// The patient of the DICOM series; where a NIfTI volume is among them, nobody by name.
/// \pre at least one series
Subject subject_of(const StudyInventory& inventory, const std::vector<const SeriesInfo*>& chosen);

/// That nothing tells of several NIfTI volumes whether they are of one person; empty: there are not several.
std::string volumes_warning(const std::vector<const SeriesInfo*>& chosen);

}  // namespace emmetrope::segmentation
