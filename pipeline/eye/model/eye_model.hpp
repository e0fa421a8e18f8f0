#pragma once
#include <Eigen/Geometry>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/base/laterality.hpp"
#include "pipeline/eye/media/medium.hpp"
#include "pipeline/eye/surfaces/shape.hpp"

namespace emmetrope {

/// What a surface turns with: a spectacle stays with the head while the eye turns behind it.
enum class Bearer { eye, head };

/// One optical surface of an eye, or its stop, in the order that light meets them.
struct Surface {
  std::string name;  ///< "cornea_anterior", "cornea_posterior", "lens_anterior", "lens_posterior", "retina"
  ShapePtr shape;    ///< null for a stop
  double position_mm = 0;  ///< depth of the vertex behind the anterior corneal apex, positive into the eye
  Eigen::Vector2d decentre_mm{0, 0};  ///< along eye x and y
  /// about the vertex, first about +x, then about the fixed +y, right-handed
  Eigen::Vector2d tilt_deg{0, 0};
  double semi_diameter_mm = 0;  ///< clear aperture; 0: as far as the shape reaches
  double stop_diameter_mm = 0;  ///< for a stop: the iris aperture
  std::string medium_after;     ///< key of EyeModel::media; empty for a stop and for the retina
  /// eye.json says head by a name that begins with "spectacle"
  Bearer bearer = Bearer::eye;

  bool is_stop() const { return shape == nullptr; }
  /// From the shape's own frame into the eye's.
  Eigen::Isometry3d eye_from_surface() const;
};

/// An optical system in the eye's frame (pipeline/base/frames.hpp), the retina last. Light comes from air.
/// Surfaces in front of the cornea (spectacle, contact lens) have negative positions.
struct EyeModel {
  std::string name;
  double reference_wavelength_nm = 589.3;
  std::map<std::string, Medium> media;
  std::vector<Surface> surfaces;
  std::optional<Eigen::Isometry3d> lps_from_eye;  ///< applies to mesh files that say SPACE=LPS

  const Surface& surface(const std::string& surface_name) const;  ///< \throw Error (input_invalid)
  Surface& surface(const std::string& surface_name);
  const Surface* stop() const;  ///< null where there is none
  /// "air" is there in every eye, index 1. \throw Error (input_invalid) for one that is not
  const Medium& medium(const std::string& medium_name) const;
  /// Opens or closes the iris; nothing happens where there is none.
  void set_stop_diameter(double diameter_mm);
  const Surface& retina() const { return surfaces.back(); }
  /// Depth of the retina's vertex, mm.
  double axial_length_mm() const { return retina().position_mm; }
};

/// What to say where the eye's media have not been measured at the wavelength; nothing where they have.
/// \throw Error (input_invalid) where a formula gives no index there
std::string extrapolation_warning(const EyeModel& eye, double wavelength_nm);

/// The eye without its stop: all rays that its surfaces pass.
EyeModel without_stop(EyeModel eye);
/// The eye without what it wears before it.
EyeModel without_spectacle(EyeModel eye);

/// Reads an eye.json; every key and value is checked.
/// \throw Error (input_invalid) naming file and key
EyeModel read_eye(const std::filesystem::path& file);
/// \param folder  what relative mesh paths are relative to
EyeModel eye_from_json(const Json& json, const std::filesystem::path& folder);
Json to_json(const EyeModel& eye);
void write_eye(const std::filesystem::path& file, const EyeModel& eye);

}  // namespace emmetrope
