#pragma once
#include <optional>
#include <string>
#include <vector>

#include "pipeline/base/command_line.hpp"
#include "pipeline/eye/model/eye_model.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"

/// What `emmetrope eye` and `emmetrope ray` answer.
namespace emmetrope {

struct EyeQuery {
  std::string eye;  ///< name or file
  EyeOptions options;
  std::optional<double> wavelength_nm;  ///< default: the eye's reference wavelength
  std::string output;                   ///< where to write the eye (exchange/eye_file.hpp); empty: nowhere
};
/// Cardinal points, pupils, axial length and paraxial refraction.
Answer describe_eye(const EyeQuery& query);

struct RayQuery {
  std::string eye;
  EyeOptions options;  ///< without a pupil, a schematic eye's iris stops no ray
  std::optional<double> wavelength_nm;
  std::vector<double> from_mm, to_mm;
};
/// One exact ray, hit by hit.
Answer describe_ray(const RayQuery& query);

/// --accommodation, --accommodation-parameter and --pupil.
void declare_eye_options(CLI::App& app, EyeOptions& options);
/// The names of the schematic eyes, for --help.
std::string schematic_eyes_line();

}  // namespace emmetrope
