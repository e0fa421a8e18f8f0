#pragma once
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "correction/prescription/known_data.hpp"
#include "correction/prescription/prescription.hpp"
#include "correction/what_if/what_if.hpp"
#include "pipeline/base/case_folder.hpp"
#include "pipeline/base/command_line.hpp"

namespace emmetrope::correction {

/// How corrected.png is made. In a case it is made as the trace stage made uncorrected.png, so that the two
/// compare.
struct PictureSettings {
  std::string scene = "letters";
  int width = 500, height = 500;
  double field_x_mm = 6, field_y_mm = 6;
  int samples = 128;
  double pupil_mm = 4;
  std::optional<double> wavelength_nm;
  bool achromatic = false, diffraction = false, illuminance = false;
  int exposure_steps = 32;  ///< where the scene moves
  double stiles_crawford_per_mm2 = 0;

  /// \throw Error (usage) naming the field
  void check() const;
};

struct CorrectionSettings {
  PrescriptionSettings prescription;
  /// Where prescription and picture are of, on the retina from the pole; where none is given of a case as it was
  /// traced, of another eye the pole
  std::optional<Eigen::Vector2d> fovea_mm;
  PictureSettings picture;
  /// Prior of a measured eye's lens index; where none is given lens_index_at_age()'s, or 0 where the trace
  /// stage was told the index
  std::optional<double> lens_index_sigma;
  WhatIfSettings what_if;  ///< of a case at the age at which it was traced, where that is known
  std::map<Laterality, KnownData> known;  ///< of a case, by eye
  bool ablation_picture = false;  ///< what the eye sees after an ablation of its refraction: ablated.png

  /// \throw Error (usage) naming the field
  void check() const;
};

/// CASE/correction/<eye>/: prescription.json, corrected.png, sweep.csv, sweep.svg, for every eye that was
/// traced. An eye whose sharpest lens is not found gets no number; the reasons stand in stage.json.
/// \throw Error (input_invalid) when the case, or the eye that is asked for, has not been traced; (usage) when it
///   was traced of another fovea or at another age, or its picture shows more than the eye (a spectacle, a gaze)
Answer correct_case(const std::filesystem::path& case_folder, CorrectionSettings settings,
                    const CommonOptions& common);

/// The same files for a schematic eye or an eye.json, in `output`; all of them or, on an error, none.
Answer correct_eye(const EyeModel& eye, const std::filesystem::path& output, CorrectionSettings settings,
                   const CommonOptions& common);

}  // namespace emmetrope::correction
