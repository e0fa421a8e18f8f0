#pragma once
#include <optional>
#include <string>
#include <vector>

#include "pipeline/base/laterality.hpp"
#include "pipeline/eye/model/eye_model.hpp"

namespace emmetrope {

/// A schematic eye by name ("navarro", "atchison:-4", ...) or a file (exchange/eye_file.hpp) by path.
struct EyeOptions {
  double accommodation_D = 0;                     ///< change of refraction from the relaxed eye
  std::optional<double> accommodation_parameter;  ///< the model's own, instead
  std::optional<double> pupil_mm;                 ///< iris aperture
  Laterality laterality = Laterality::od;         ///< where a schematic eye's nasal side is
};
/// \throw Error (usage) for an unknown name, listing the known ones; (unsupported) when it cannot accommodate
EyeModel make_eye(const std::string& name_or_file, const EyeOptions& options = {});
std::vector<std::string> schematic_eye_names();
/// Whether make_eye would take it for a schematic eye and not for a file.
bool is_schematic_eye(const std::string& name_or_file);

}  // namespace emmetrope
