#pragma once
#include <filesystem>
#include <optional>
#include <string>

#include "pipeline/base/laterality.hpp"
#include "pipeline/eye/meshes/triangle_mesh.hpp"
#include "pipeline/eye/model/eye_model.hpp"
#include "pipeline/eye/population/population.hpp"

namespace emmetrope::raytrace {

/// What MR images do not show of an eye.
struct MeasuredEyeOptions {
  std::optional<double> age_years;  ///< default: the study's, else 40
  /// Equivalent index; default: lens_index_at_age
  std::optional<double> lens_index;
  bool lens_core = false;  ///< Gullstrand's cortex and core scaled to the lens, the paper's choice
  std::optional<double> retinal_depth_mm = {};  ///< that the case was meshed with, to be sure of it
  double pupil_mm = 4;                          ///< iris aperture, at the lens front vertex
};

/// An eye of a case as it is traced.
struct MeasuredEye {
  EyeModel eye;
  TriangleMesh photoreceptors_in_lps;  ///< what light ends on: the interface moved outward along the axis
  std::string warning;                 ///< of an age that is not the study's, of an unusual index; or nothing
  double lens_index = 0, lens_index_sigma = 0;
  std::string lens_source;  ///< "--lens-index", "age 41 years", "age 40 years (unknown)", "cortex and core"
};

/// The eye's meshes as one optical system: Gullstrand's indices with Le Grand's dispersion.
/// \throw Error (input_invalid) naming what is missing in CASE/meshing/<eye>, (usage) an index that no human lens has,
///   another depth of the photoreceptors than the meshing's
MeasuredEye read_measured_eye(const std::filesystem::path& case_folder, Laterality eye,
                              const MeasuredEyeOptions& options);

/// eye.json and photoreceptors.ply of CASE/raytrace/<eye>; paths relative to that folder.
void write_measured_eye(const std::filesystem::path& folder, const MeasuredEye& measured, Laterality eye);

}  // namespace emmetrope::raytrace
