#pragma once
#include <Eigen/Geometry>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/eye/model/eye_model.hpp"

/// An eye as optical design programs hold it. Their frames have z along the light and x to the left of one who
/// looks along it, turned by half a turn about y from the eye's (pipeline/base/frames.hpp).
namespace emmetrope {

/// Turns the frame of the light into the eye's and back.
inline const Eigen::Matrix3d half_turn = Eigen::Vector3d(-1, 1, -1).asDiagonal();

struct LensSurface {
  std::string comment;
  ShapePtr shape;  ///< as EyeModel holds it, its z against the light; null for a stop that refracts nothing
  Eigen::Isometry3d light_from_surface = Eigen::Isometry3d::Identity();
  std::string medium_after;
  double semi_diameter_mm = 0;  ///< clear aperture; 0: no limit
  bool is_stop = false;
};

/// A sequential lens without its object surface, the image last, light from air.
struct LensSystem {
  std::string name;
  double wavelength_nm = 0;
  std::map<std::string, Medium> media;
  std::vector<LensSurface> surfaces;
  std::optional<double> stop_diameter_mm, entrance_pupil_mm;  ///< one of them where there is a stop
};

/// The eye: surfaces that divide no media are left out, a stop upon a refracting surface lies before it, the
/// corneal vertex is the origin, names follow the comments ("cornea front").
/// \throw Error (input_invalid) for what makes no eye
EyeModel eye_of(const LensSystem& system);

}  // namespace emmetrope
