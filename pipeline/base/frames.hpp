#pragma once
#include <Eigen/Core>
#include <Eigen/Geometry>

#include "pipeline/base/json.hpp"

/// Frames of the project, all right-handed, lengths in mm. Transforms are named target_from_source.
///
/// lps: DICOM patient frame: +x to the patient's left, +y posterior, +z superior.
/// eye: ANSI Z80.28 / ISO 24157: +z out of the eye along its axis, +x horizontal (no superior component) to
///      the examiner's right, which is the patient's left, +y up; origin at the anterior corneal apex. OD and
///      OS alike.
/// A depth d is a distance behind the apex into the eye: d = -z.
namespace emmetrope {

inline constexpr double pi = 3.141592653589793238462643;
inline constexpr double degree = pi / 180;

/// The eye's frame from its apex and the outward direction of its axis.
/// \param axis_in_lps  need not be a unit vector
/// \throw Error (input_invalid) when the axis is vertical, so that no horizontal direction is defined
Eigen::Isometry3d lps_from_eye(const Eigen::Vector3d& apex_in_lps, const Eigen::Vector3d& axis_in_lps);

/// Outward axis in LPS of an eye that looks this far to the patient's left and up from straight ahead, and
/// back.
Eigen::Vector3d gaze_axis(double horizontal_deg, double vertical_deg);
Eigen::Vector2d gaze_deg(const Eigen::Vector3d& axis_in_lps);

/// [x, y, z]
Json to_json_vector(const Eigen::Vector3d& vector);
/// 4 x 4 row-major matrix as nested arrays, the form of `lps_from_eye` in every JSON file.
Json to_json_matrix(const Eigen::Isometry3d& transform);
/// \throw Error (input_invalid) when it is no rigid transform to 1e-6
Eigen::Isometry3d isometry_from_json(const Json& json);

/// An axis in [0, 180).
double normalise_axis_deg(double axis_deg);

}  // namespace emmetrope
